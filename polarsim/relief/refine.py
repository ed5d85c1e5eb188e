"""Refinement of a terrain's ground mesh by photos: plane sweep without scans, shading, and a map of the sources."""

from __future__ import annotations

import logging
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import ReconstructionError
from polarsim.formats import gltf, npz, obj, png, tables
from polarsim.formats.files import write_json, writing_folder
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK
from polarsim.relief.heights import INFERRED, INVENTED, MEASURED, HeightMap
from polarsim.relief.pairs import comparable_groups
from polarsim.relief.photos import read_views
from polarsim.relief.sweep import Scene, sweep_ground
from polarsim.rocks.folder import MAX_VIEWER_VERTICES, SUPPORT_FILE
from polarsim.rocks.heights import FloorGrid, filled
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import cluster_vertices
from polarsim.run_files.scene import MESH_TABLE, PHOTOS, SCANNED, TerrainMesh, mesh_origins, read_terrain
from polarsim.run_files.walls import level_walls
from polarsim.survey import half_width

log = logging.getLogger("polarsim")
MAP, PICTURE, SUMMARY = "ground_map.npz", "ground_kind.png", "ground.json"
CELL_OF_PHOTOS, CELL_OF_COVERS = 0.005, 0.010  # cells of height maps from linear photos and from published covers, m
WALL_MARGIN = 0.03  # width of the sand along the walls that is not refined, metres
SCAN_SD = 0.0012  # standard deviation of scanned heights in a cell, metres
KIND_COLOURS = {INVENTED: (200, 200, 200), INFERRED: (86, 180, 233), MEASURED: (0, 114, 178)}  # RGB


def refine_ground(*, terrain: int, meshes: Path, cameras: Path, photos: Path, refined: Path) -> None:
    """Copy a terrain's meshes with the ground refined by photos; write a map of the heights and their sources.

    A ground without scans is measured by a plane sweep. If photos are missing, do not agree, or have unknown lamps, the
    ground is copied unchanged with a warning. The map contains heights, standard deviations and kinds of cells.

    Parameters
    ----------
    meshes, refined : Path
        Folders of the terrain's meshes: as read, and as written.
    photos : Path
        Table of photos, or folder of cover photos.
    """
    scene = read_terrain(meshes, terrain)
    origins = mesh_origins(meshes)
    name = obj.ground_name(terrain)
    scanned = origins.get(name) == SCANNED
    views = read_views(terrain, photos, cameras)
    cell = CELL_OF_COVERS if views and not views[0].linear else CELL_OF_PHOTOS
    start = start_map(scene, terrain, cell, _support(meshes, name) if scanned else None)
    reason = ""
    try:
        found = start if scanned else sweep_ground(start, _scene(scene, terrain, views))
    except ReconstructionError as error:
        found, reason = start, error.reason
        log.warning("terrain %02d: the ground is not refined by photos: %s", terrain, reason)
    changed = found is not start
    with writing_folder(refined) as folder:
        shutil.copytree(meshes, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".*"))
        if changed:
            _write_ground(folder, terrain, moved_ground(scene.part(NO_ROCK), start, found))
        _write_map(folder, found)
        write_json(folder / SUMMARY, summary(start, found, [str(view.key) for view in views], reason))


def start_map(scene: TerrainMesh, terrain: int, cell: float, support: np.ndarray | None) -> HeightMap:
    """Return the heights of the ground mesh inside the walls; `support` (v,): of the mesh's vertices by scans."""
    low, high = (scene.walls.bounds if scene.walls else _nominal_bounds(terrain)) + [[WALL_MARGIN], [-WALL_MARGIN]]
    grid = FloorGrid(Extent(*low, *high).snapped(cell), cell)
    ground = scene.part(NO_ROCK)
    centres = grid.centres().reshape(-1, 2)
    high_points = np.column_stack([centres, np.full(len(centres), ground.vertices[:, 2].max() + 1.0)])
    down = np.broadcast_to([0.0, 0.0, -1.0], high_points.shape)
    distance, face = make_caster(ground.vertices, ground.faces).nearest(high_points, down)
    height = (high_points[:, 2] - distance).reshape(grid.shape)
    hit = np.isfinite(height)
    measured = np.zeros(grid.shape, bool)
    if support is not None:
        measured = hit & (support[ground.faces[face]].min(axis=1) > 0).reshape(grid.shape)
    return HeightMap(
        grid,
        filled(np.where(hit, height, 0.0), hit),
        np.where(measured, SCAN_SD, np.inf),
        np.where(measured, MEASURED, INVENTED).astype(np.uint8),
    )


def moved_ground(ground: Mesh, start: HeightMap, found: HeightMap) -> Mesh:
    """Return the ground mesh with vertices raised by the difference of two height maps; the border's outside."""
    vertices = ground.vertices.copy()
    vertices[:, 2] += start.grid.sample(found.height_m - start.height_m, vertices)
    return replace(ground, vertices=vertices)


def summary(start: HeightMap, found: HeightMap, photos: list[str], reason: str) -> dict[str, object]:
    """Return the shares of measured, inferred and invented cells, the change of the ground, mm, and the photos."""
    known = found.kind == MEASURED
    change = (found.height_m - start.height_m)[known]
    return {
        "refined": found is not start,
        "reason": reason,
        "photos": photos,
        "cell_mm": 1000 * found.grid.cell,
        "measured_share": round(float(known.mean()), 3),
        "inferred_share": round(float((found.kind == INFERRED).mean()), 3),
        "invented_share": round(float((found.kind == INVENTED).mean()), 3),
        "median_change_mm": round(1000 * float(np.median(change)), 1) if change.size else 0.0,
        "median_sd_mm": round(1000 * float(np.median(found.sd_m[known])), 2) if known.any() else None,
    }


def _scene(scene: TerrainMesh, terrain: int, views: list) -> Scene:  # type: ignore[type-arg]
    walls = scene.walls or level_walls(half_width(terrain), scene.sand_level)
    vertices, faces, _ = walls.mesh(scene.sand_level - 0.5)
    rocks = Mesh(scene.vertices, scene.faces[scene.rock_of_face != NO_ROCK])
    return Scene(views, comparable_groups(views), rocks, Mesh(vertices, faces))


def _nominal_bounds(terrain: int) -> np.ndarray:
    half = half_width(terrain)
    return np.array([[-half, -half], [half, half]])


def _support(meshes: Path, name: str) -> np.ndarray:
    """Return the support (v,) of the ground's vertices by scans."""
    table = tables.read_parquet(meshes / SUPPORT_FILE, ["mesh", "vertex", "support"])
    own = table[table["mesh"].astype(str) == name].sort_values("vertex")
    return own["support"].to_numpy(float)


def _write_ground(folder: Path, terrain: int, ground: Mesh) -> None:
    """Replace the ground in a folder of meshes: OBJ file, its origin in the table, and the file for viewers."""
    name = obj.ground_name(terrain)
    obj.write_obj(folder / name, ground, Path(name).stem)
    table = tables.read_csv(folder / MESH_TABLE, ["mesh", "made_from"])
    table.loc[table["mesh"] == name, "made_from"] = PHOTOS
    tables.write_csv(folder / MESH_TABLE, pd.DataFrame(table))
    rocks = {f"rock{rock}": obj.read_obj(path) for rock, path in sorted(obj.rock_files(folder).items())}
    shown = {gltf.GROUND_NODE: cluster_vertices(ground, MAX_VIEWER_VERTICES), **rocks}
    gltf.write_glb(folder / gltf.name(terrain), shown, {})


def _write_map(folder: Path, found: HeightMap) -> None:
    extent = found.grid.extent
    npz.write_arrays(
        folder / MAP,
        x0_y0_cell_m=np.array([extent.x0, extent.y0, found.grid.cell]),
        height_m=found.height_m.astype(np.float32),
        sd_m=found.sd_m.astype(np.float32),
        kind=found.kind,
    )
    colours = np.array([KIND_COLOURS[kind] for kind in (INVENTED, INFERRED, MEASURED)], np.uint8)
    png.write_png(folder / PICTURE, colours[found.kind[::-1]])  # north (+y) up
