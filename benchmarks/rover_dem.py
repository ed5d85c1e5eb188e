"""A world on an elevation model beside the strip of terrains: time, memory, laws, and what a second driven costs.

.venv/bin/python benchmarks/rover_dem.py MESHES --terrains 4 1 11 [--dem FILE.tif] [--size 60] [--autonomy]
MESHES: a run's meshes, TerrainNN/; without a file the relief is made up. `--autonomy` drives by labels instead.
Figures of the last run: docs/notes/rover.md.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import run_drive
from polarsim.rover.planning.cases import Light
from polarsim.rover.planning.drive import drive, job_for
from polarsim.rover.planning.metrics import figures
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.craters import per_m2 as craters_per_m2
from polarsim.rover.world.craters import strewn_craters
from polarsim.rover.world.dem import dem_world
from polarsim.rover.world.hulls import top_at
from polarsim.rover.world.options import DemOptions, WorldOptions
from polarsim.rover.world.rock_field import covered_share, per_m2
from polarsim.rover.world.stitch import read_terrain
from polarsim.rover.world.surface import World

RAYS = 24  # along each side of a rock
SIZES_M = (0.05, 0.1, 0.2, 0.4)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[4, 1, 11])
    parser.add_argument("--dem", type=Path)
    parser.add_argument("--size", type=float, default=60.0)
    parser.add_argument("--autonomy", action="store_true")
    asked = parser.parse_args()
    dem = DemOptions(path=asked.dem, size_m=asked.size, drive_m=3.5 * len(asked.terrains))
    strip = WorldOptions(terrains=tuple(asked.terrains))
    site = strip.model_copy(update={"dem": dem})
    _world(asked.meshes, site, dem)
    for name, options in (("warming up", strip), ("strip", strip), ("elevation model", site)):
        _drive(asked, name, options)


def _world(meshes: Path, options: WorldOptions, dem: DemOptions) -> None:
    begun = time.process_time()
    terrains = [read_terrain(meshes / f"Terrain{number:02d}", number) for number in options.terrains]
    read = time.process_time() - begun
    world = dem_world(options, terrains, np.array([[dem.drive_m / 2, 0.0], [-dem.drive_m / 2, 0.0]]))
    made = time.process_time() - begun - read
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    assert world.around is not None
    print(
        f"{dem.size_m:g} x {dem.size_m:g} m: meshes {read:.1f} CPU s, world {made:.1f}, {memory:.2f} GiB; grid "
        f"{world.level.shape}, around {world.around.level.shape}, {len(world.rocks)} rocks with labels, "
        f"{len(world.rocks_on_grid)} on the grid"
    )
    _laws(world, dem)


def _laws(world: World, dem: DemOptions) -> None:
    """Rocks as their meshes are, craters as they were drawn, against what the laws say."""
    assert world.around is not None
    assert dem.rocks is not None
    outlines = _outlines(world)
    diameter, area, abundance = np.sqrt(4 * outlines / np.pi), dem.size_m**2, dem.rocks.abundance
    end = dem.rocks.largest_m
    for size in SIZES_M:
        large = diameter >= size
        share = float(covered_share(size, abundance) - covered_share(end, abundance))
        count = float(per_m2(size, abundance) - per_m2(end, abundance)) * area
        print(
            f"rocks of {100 * size:.0f} cm or more: {large.sum()}, law {count:.0f} +- {np.sqrt(count):.0f}; they cover "
            f"{100 * outlines[large].sum() / area:.3f} %, law {100 * share:.3f} %"
        )
    craters = strewn_craters(dem.craters, dem.size_m, dem.seed)
    for size in (0.3, 0.6, 1.2, 2.4):
        count = float(craters_per_m2(size) - craters_per_m2(dem.craters.largest_m)) * area * dem.craters.share
        found = (craters.diameter >= size).sum()
        print(f"craters of {size:g} m or more: {found}, law {count:.0f} +- {np.sqrt(count):.0f}")


def _outlines(world: World) -> np.ndarray:
    """(n,) areas that rocks cover, seen from above, m2: by 24 x 24 rays each, of which those count that end on it."""
    assert world.around is not None
    scenery = world.around
    parts = [world.rock_mesh(int(rock)) for rock in world.rocks["rock"]] + _apart(scenery.vertices, scenery.triangles)
    areas = []
    for vertices, faces in parts:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        x, y = (a + (b - a) * (np.arange(RAYS) + 0.5) / RAYS for a, b in zip(low[:2], high[:2], strict=True))
        across, along = (values.ravel() for values in np.meshgrid(x, y))
        above = top_at(vertices, faces, across, along) > world.height_at(across, along)
        areas.append(above.mean() * np.prod(high[:2] - low[:2]))
    return np.array(areas)


def _apart(points: np.ndarray, faces: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vertices and faces of all meshes that hang together."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(len(points), len(points)))
    label = connected_components(graph, directed=False)[1][faces[:, 0]]
    starts = np.searchsorted(label, np.arange(label.max(initial=-1) + 2))  # a rock's faces follow each other
    found = []
    for first, last in pairwise(starts):
        used, corners = np.unique(faces[first:last], return_inverse=True)
        found.append((points[used].astype(float), corners.reshape(-1, 3)))
    return found


def _drive(asked: argparse.Namespace, name: str, options: WorldOptions) -> None:
    soil, route = SoilOptions(), DriveOptions()
    if asked.autonomy:
        own = AutonomyOptions()
        job = job_for(meshes=asked.meshes, world=options, soil=soil, drive=route, options=own, seed=0)
        outcome = drive(job, "truth", Light("3", 256.0), own, CameraSuiteOptions())
        rows = figures(outcome, job.vehicle, own).set_index("metric")["value"]
        print(f"{name}, by labels: {outcome.trace.drive['ended']}", rows.round(3).to_dict())
        return
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        trace = run_drive(meshes=asked.meshes, folder=Path(folder), world=options, soil=soil, drive=route, seed=0)
    spent, seconds = time.process_time() - begun, float(trace.drive["seconds"])
    print(f"{name}: {trace.drive['ended']}, {seconds:.1f} s driven, {spent:.1f} CPU s, {spent / seconds:.3f} a second")


if __name__ == "__main__":
    main()
