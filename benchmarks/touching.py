"""Separation of rocks that touch or are on top of each other, from scans only, and fit of its coefficients.

`python benchmarks/touching.py FOLDER [--fit] SCENE...`

A scene is `analog_SEED_TERRAIN`, `foreign_SEED` (`foreign.py --touching` with the scanned rocks below
`$POLAR_SIM_ROOT`) or `strewn_SEED` (the same rocks without contact). Scenes that are missing in FOLDER are generated:
scans and cameras, without photos and boxes. Each rock with at least 20 visible cells of the floor grid is one of

    found   a detection and the rock share more than half of their cells
    lost    most of it was classified as rock, but as a part of another rock
    missed  all other rocks

and is cut if each of two detections, mostly on this rock, covers 15 % of it. A false detection is mostly on no rock.

`--fit` fits `polarsim.rocks.creases.COEFFICIENTS`: logistic regression (ridge) on all pairs of pieces that occur while
pieces are joined as in the ground truth, most certain pairs first. It prints the coefficients from all scenes, and the
result of each scene with coefficients from the other scenes.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from types import ModuleType
from unittest import mock

import numpy as np
import open3d as o3d
import pandas as pd

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions
from polarsim.formats import obj, site_files
from polarsim.formats.calibrations import read_calibration
from polarsim.geometry.poses import Pose
from polarsim.rocks import splitting
from polarsim.rocks.creases import COEFFICIENTS, TERMS, Joining, chance_of_two, cut_along_creases
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.find import CONFIRMED_HEIGHT, CONFIRMING_IOU, FOOT_HEIGHT, read_scans
from polarsim.rocks.ground import GROUND_CELL, SandSurface, find_ground, sand_extent
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.regions import Limits, find_regions, standing
from polarsim.run_files.inventory import Inventory, read_inventory, write_inventory
from polarsim.run_files.rigs import read_all_localised, read_localised, write_rig
from polarsim.site import polar

OPTIONS = RocksOptions()
LIMITS = Limits(FOOT_HEIGHT, OPTIONS.min_height_mm / 1000, CONFIRMED_HEIGHT, OPTIONS.min_size_mm / 1000)
OWN_DISTANCE = 0.03  # metres from a rock's true surface within which the surface above the ground belongs to the rock
MIN_VISIBLE_CELLS, LARGE = 20, 0.08  # minimum number of visible cells of a rock; minimum size of a large rock, metres
MIN_PURITY = 0.75  # minimum share of a piece on a single rock for the fit
RIDGE, ROUNDS = 10.0, 2


@dataclass(frozen=True)
class Scene:
    """Scans of a scene; arrays are (rows, columns)."""

    name: str
    sand: SandSurface
    true: np.ndarray  # number of the rock at each cell, 0 for none
    size: dict[int, float]  # metres, of each rock


def make(folder: Path, name: str) -> None:
    """Write scans, cameras and ground truth of a scene."""
    kind, seed, *terrain = name.split("_")
    number, positions = (int(terrain[0]), ["A", "C"]) if kind == "analog" else (2, ["A", "B", "C"])
    if kind == "analog":
        options, receipt = AnalogOptions(seed=int(seed), photos=False), folder / "receipt.json"
        generate_terrain(
            site=polar(), root=folder, receipt=receipt, terrain=number, keys=[], options=options, threads=1
        )
        files = {position: str(path) for position, path in site_files.find_range_maps(polar(), folder, number).items()}
        write_inventory(folder / "inventory.json", Inventory(number, "files", range_maps=files))
        write_rig(
            folder / "calibration.json",
            read_calibration(site_files.find_calibration(polar(), folder, number), polar()),
            "file",
        )
    else:
        meshes = Path(os.environ["POLAR_SIM_ROOT"]) / "TerrainMeshes"
        _foreign().make(folder, int(seed), meshes, touching=kind == "foreign")
    (folder / "seeds").mkdir(exist_ok=True)
    locate_cameras(
        site=polar(), terrain=number, positions=positions, inventory=folder / "inventory.json",
        calibration=folder / "calibration.json", seeds=folder / "seeds", cameras=folder / "cameras",
        options=LocalisationOptions(),
    )  # fmt: skip


def _foreign() -> ModuleType:
    spec = importlib.util.spec_from_file_location("foreign", Path(__file__).with_name("foreign.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def read(folder: Path) -> Scene:
    """Read a scene's sand and the rock at each cell."""
    localised = read_all_localised(folder / "cameras")
    scans = read_scans(read_inventory(folder / "inventory.json"), localised, polar().files, polar().sandbox)
    extent = sand_extent(scans, polar().sandbox)
    scans = scans.select(extent.contains(scans.points))
    sand = find_ground(scans, extent, GROUND_CELL)
    truth = next((folder / "truth").glob("Terrain*"), folder / "truth")  # only the analog has a folder per terrain
    true = read_localised(truth / "cameras/PosA.json").sandbox_from_left
    cells = np.flatnonzero(np.isfinite(sand.surface) & (sand.above > LIMITS.foot))
    owner = np.zeros(sand.surface.size, np.int64)
    true_from_sandbox = true @ localised["A"].sandbox_from_left.inverse()
    points = np.column_stack([sand.grid.centres().reshape(-1, 2)[cells], sand.top.ravel()[cells]])
    owner[cells] = _nearest_rocks(truth / "meshes", true_from_sandbox, points)
    rocks = pd.read_parquet(truth / "rocks.parquet")
    sizes = dict(zip(rocks["rock"].tolist(), rocks["size_m"].tolist(), strict=True))
    return Scene(folder.name, sand, owner.reshape(sand.surface.shape), sizes)


def _nearest_rocks(meshes: Path, true_from_sandbox: Pose, points: np.ndarray) -> np.ndarray:
    """Return the number (n,) of the rock nearest to each point (n, 3); 0 if none is near."""
    world, numbers = o3d.t.geometry.RaycastingScene(), []
    for number, path in obj.rock_files(meshes).items():
        mesh = obj.read_obj(path)
        world.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
        numbers.append(number)
    if not numbers:
        return np.zeros(len(points), np.int64)
    there = true_from_sandbox.apply(points).astype(np.float32)
    nearest = world.compute_closest_points(o3d.core.Tensor(there))
    near = np.linalg.norm(nearest["points"].numpy() - there, axis=1) < OWN_DISTANCE
    return np.where(near, np.array(numbers)[np.where(near, nearest["geometry_ids"].numpy(), 0)], 0)


def detection_table(scene: Scene, coefficients: tuple[float, ...]) -> pd.DataFrame:
    """Return a row for each rock: size, found, lost or missed, and whether it was cut; rock 0 for false detections."""
    with mock.patch.object(splitting, "chance_of_two", partial(chance_of_two, coefficients=coefficients)):
        found = find_regions(scene.sand, LIMITS, Evidence({}, {}, CONFIRMING_IOU))
    shared = np.zeros((len(found), max(scene.size, default=0) + 1), np.int64)
    for number, region in enumerate(found):
        shared[number] = np.bincount(scene.true.ravel()[region.seen], minlength=shared.shape[1])
    sizes, owner = shared.sum(axis=1), shared.argmax(axis=1)
    rows = [(scene.name, 0, region.size, "false", False) for n, region in enumerate(found) if owner[n] == 0]
    for rock, size in scene.size.items():
        cells, own = int((scene.true == rock).sum()), shared[:, rock]
        if cells < MIN_VISIBLE_CELLS:
            continue
        overlap = (own / (sizes + cells - own)).max(initial=0)
        what = "found" if overlap > 0.5 else "lost" if own.sum() > 0.4 * cells else "missed"
        rows.append((scene.name, rock, size, what, int(((owner == rock) & (own > 0.15 * cells)).sum()) > 1))
    return pd.DataFrame(rows, columns=["scene", "rock", "size", "what", "cut"])


def training_pairs(
    scene: Scene, joining: Joining, coefficients: tuple[float, ...]
) -> list[tuple[np.ndarray, bool, float]]:
    """Return terms, class (two rocks) and weight of all pairs that occur while pieces of the same rock are joined."""
    met: dict[tuple[int, int, int, int], tuple[np.ndarray, bool, float]] = {}
    apart: set[tuple[int, int, int, int]] = set()
    while True:
        keys = {(*pair, *(len(joining.bodies[n].cells) for n in pair)): pair for pair in joining.pairs}
        for key, pair in keys.items():
            (one, pure), (other, also_pure) = (_main_rock(scene, joining.bodies[n].cells) for n in pair)
            if key not in met and min(pure, also_pure) > MIN_PURITY and (one or other):
                met[key] = joining.pairs[pair], one != other, np.sqrt(min(key[2:]) / 100)
        open_keys = [key for key in keys if key not in apart]
        if not open_keys:
            return list(met.values())
        chances = chance_of_two(np.array([joining.pairs[keys[key]] for key in open_keys]), coefficients)
        key = open_keys[int(chances.argmin())]
        if met[key][1] if key in met else chances.min() > 0.3:
            apart.add(key)
        else:
            joining.join(*keys[key])


def _main_rock(scene: Scene, cells: np.ndarray) -> tuple[int, float]:
    """Return the rock that covers most of the flat cells (n,), and its share of the visible cells."""
    counts = np.bincount(scene.true.ravel()[cells][np.isfinite(scene.sand.surface.ravel()[cells])], minlength=1)
    return int(counts.argmax()), float(counts.max() / max(1, counts.sum()))


def fit_coefficients(pairs: list[tuple[np.ndarray, bool, float]]) -> tuple[float, ...]:
    """Fit coefficients of a constant and of each term: ridge on standardised terms, by Newton's method."""
    terms, two, weights = (np.array(column, float) for column in zip(*pairs, strict=True))
    mean = np.average(terms, axis=0, weights=weights)
    spread = np.sqrt(np.average((terms - mean) ** 2, axis=0, weights=weights))
    design = np.column_stack([np.ones(len(terms)), (terms - mean) / spread])
    ridge = RIDGE * np.diag([0.0, *np.ones(terms.shape[1])])
    factors = np.zeros(design.shape[1])
    for _ in range(30):
        chance = 1 / (1 + np.exp(-design @ factors))
        slope = design.T @ (weights * (two - chance)) - ridge @ factors
        factors += np.linalg.solve((design.T * (weights * chance * (1 - chance))) @ design + ridge, slope)
    scaled = factors[1:] / spread
    return (float(factors[0] - scaled @ mean), *scaled.tolist())


def fit(scenes: list[Scene]) -> None:
    """Print the coefficients from all scenes, and the result of each scene with coefficients from the other scenes."""
    coefficients, pairs = COEFFICIENTS, {}
    for _ in range(ROUNDS):
        pairs = {scene.name: training_pairs(scene, _joining(scene), coefficients) for scene in scenes}
        coefficients = fit_coefficients(list(chain(*pairs.values())))
    print("pairs:", sum(map(len, pairs.values())))
    print({name: round(value, 4) for name, value in zip(("constant", *TERMS), coefficients, strict=True)})
    others = {name: list(chain(*(pairs[other] for other in pairs if other != name))) for name in pairs}
    report(pd.concat([detection_table(scene, fit_coefficients(others[scene.name])) for scene in scenes]))


def _joining(scene: Scene) -> Joining:
    relief, labels = splitting.relief_and_regions(*standing(scene.sand, LIMITS.foot), scene.sand.grid.cell)
    return Joining(relief, cut_along_creases(relief, labels))


def report(rows: pd.DataFrame) -> None:
    """Print counts by kind of scene and size of rock, and the rocks that were not found."""
    rows = rows.assign(kind=rows["scene"].str.split("_").str[0], large=rows["size"] >= LARGE)
    rocks = rows[rows["rock"] > 0]
    counts = rocks.pivot_table(index=["kind", "large"], columns="what", aggfunc="size", fill_value=0)
    counts["cut"] = rocks.groupby(["kind", "large"])["cut"].sum()
    print(counts.to_string())
    print("false finds:", rows[rows["rock"] == 0].groupby("kind").size().to_dict())
    for name, left in rocks[rocks["what"] != "found"].groupby("scene"):
        print(name, [(row.rock, round(row.size, 2), row.what) for row in left.itertuples(index=False)])


def main() -> None:
    folder, *names = [Path(argument) for argument in sys.argv[1:] if argument != "--fit"]
    for name in names:
        if not (folder / name / "cameras").exists():
            make(folder / name, str(name))
    scenes = [read(folder / name) for name in names]
    if "--fit" in sys.argv:
        fit(scenes)
    else:
        report(pd.concat([detection_table(scene, COEFFICIENTS) for scene in scenes]))


if __name__ == "__main__":
    main()
