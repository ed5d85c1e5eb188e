"""Meshes from clouds: closed rocks, and ground without holes."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from polarsim.errors import ReconstructionError
from polarsim.formats import ply, tables
from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.rocks.folder import Scanned, write_meshes
from polarsim.rocks.ground import GROUND_CELL
from polarsim.rocks.heights import FloorGrid, filled, mean_heights
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.scans import Extent
from polarsim.rocks.surfaces import closed_rock, ground_surface
from polarsim.run_files.scene import PHOTOS, SCANNED
from polarsim.run_files.walls import read_walls
from polarsim.site import Site

log = logging.getLogger("polarsim")
WALL_REACH = 0.05  # width of the ground's mesh outside the surveyed sand, under the walls, metres


def mesh_rocks(
    *,
    site: Site,
    terrain: Terrain,
    rocks: Path,
    clouds: Path,
    meshes: Path,
    options: RocksOptions,
    from_photos: bool = False,
) -> None:
    """Reconstruct every rock and the ground of a terrain; write OBJ files, decimated copies, tables, walls, glTF.

    If the points of a rock define no surface, the rock is skipped with a warning. `from_photos`: the points are from
    photos instead of scans, which `meshes.csv` states.
    """
    table = tables.read_parquet(rocks, ["rock"])
    points = ply.read_ply(Path(clouds) / "ground.ply")
    half = np.array(site.sandbox_of(terrain).half_width_m)
    grid, ground = ground_heights(points, GROUND_CELL, half)
    bare = np.zeros(grid.shape, bool)
    bare.ravel()[grid.cell_of(points.points)] = True
    scanners = tables.read_csv(Path(clouds) / "scanners.csv", ["x", "y", "z"])[["x", "y", "z"]].to_numpy(float)
    solids: dict[int, Mesh] = {}
    scanned = {NO_ROCK: Scanned(points.points, GROUND_CELL)}
    for rock in table["rock"].tolist():
        cloud = ply.read_ply(Path(clouds) / f"rock{rock}.ply")
        scanned[rock] = Scanned(cloud.points, options.rock_cell_mm / 1000)
        try:
            solids[rock] = closed_rock(cloud, grid, ground, bare, scanners, options.rock_cell_mm / 1000)
        except ReconstructionError as error:
            log.warning("terrain %s, rock %d has no mesh: %s", terrain_text(terrain), rock, error)
    cell = options.ground_mesh_cell_mm / 1000
    surface = ground_surface(grid, ground, cell)
    sources = dict.fromkeys((NO_ROCK, *solids), PHOTOS if from_photos else SCANNED)
    write_meshes(terrain, meshes, solids, surface, sources, scanned, read_walls(clouds))


def ground_heights(cloud: Cloud, cell: float, half: np.ndarray) -> tuple[FloorGrid, np.ndarray]:
    """Return heights of the ground over all sand and slightly under the walls; level z = 0 without points.

    `half` (2,): half the width of the sand along X and Y, metres.
    """
    low, high = -half - WALL_REACH, half + WALL_REACH
    if len(cloud):
        low, high = np.minimum(low, cloud.points[:, :2].min(axis=0)), np.maximum(high, cloud.points[:, :2].max(axis=0))
    grid = FloorGrid(Extent(*low, *high).grown(cell).snapped(cell), cell)
    mean, weights = mean_heights(grid, cloud.points, np.ones(len(cloud)))
    return grid, filled(np.nan_to_num(mean), weights > 0)
