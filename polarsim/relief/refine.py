"""Refinement of a terrain's ground mesh by photos: plane sweep without scans, shading, and a map of the sources."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.errors import ReconstructionError
from polarsim.formats import gltf, npz, obj, png, tables
from polarsim.formats.files import write_json, writing_folder
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.outlines import rim
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.relief.feet import continued_down
from polarsim.relief.heights import INFERRED, INVENTED, MEASURED, HeightMap, PhotoView
from polarsim.relief.pairs import comparable_groups
from polarsim.relief.photos import read_ground_photos
from polarsim.relief.shading import refine
from polarsim.relief.sweep import SweptScene, below_rocks, sweep_ground
from polarsim.render.options import RenderOptions
from polarsim.rocks.folder import MAX_VIEWER_VERTICES, SUPPORT_FILE, mesh_row
from polarsim.rocks.heights import FloorGrid, filled
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import cluster_vertices
from polarsim.run_files.fitted_photos import GROUND_FILE
from polarsim.run_files.scene import MESH_TABLE, PHOTOS, PUBLISHED, SCANNED, TerrainMesh, mesh_origins, read_terrain
from polarsim.run_files.walls import flat_walls
from polarsim.site import Site
from polarsim.site_parts import Sandbox

log = logging.getLogger("polarsim")
MAP, PICTURE = "ground_map.npz", "ground_kind.png"
CELL_OF_PHOTOS, CELL_OF_COVERS = 0.005, 0.010  # cells of height maps from linear photos and from published covers, m
WALL_MARGIN = 0.03  # width of the sand along the walls that is not refined, metres
SCAN_SD = 0.0012  # standard deviation of scanned heights in a cell, metres
KIND_COLOURS = {INVENTED: (200, 200, 200), INFERRED: (86, 180, 233), MEASURED: (0, 114, 178)}  # RGB


def refine_ground(
    *, site: Site, terrain: Terrain, meshes: Path, cameras: Path, photos: Path, refined: Path, options: RenderOptions
) -> None:
    """Copy a terrain's meshes with the ground refined by photos; write a map of the heights and their sources.

    A ground without scans is measured by a plane sweep; shading of cover photos refines it. Published rocks are
    continued down to the ground. A step that photos do not allow (none, other scenes, unknown lamps) is skipped with a
    warning; without any step the meshes are unchanged. The map has heights, standard deviations and kinds of cells.

    Parameters
    ----------
    meshes, refined : Path
        Folders of the terrain's meshes: as read, and as written.
    photos : Path
        Table of photos, or folder of cover photos.
    options : RenderOptions
        Reflectance of the sand.
    """
    sandbox = site.sandbox_of(terrain)
    scene = read_terrain(meshes, terrain, sandbox, cameras=cameras)
    origins = mesh_origins(meshes)
    name = obj.ground_name(terrain)
    scanned = origins.get(name) == SCANNED
    views = [] if scanned else read_ground_photos(site, terrain, photos, cameras)
    rocks = {rock: scene.part(rock) for rock in scene.rocks}
    published = {rock: mesh for rock, mesh in rocks.items() if origins.get(obj.rock_name(terrain, rock)) == PUBLISHED}
    cell = CELL_OF_COVERS if views and not views[0].linear else CELL_OF_PHOTOS
    start = start_map(scene, sandbox, cell, _support(meshes, name) if scanned else None)
    around = _scene(scene, sandbox, views, [rim(mesh) for mesh in published.values()])
    found, reasons = start, []
    if scanned:
        reasons.append("scans are more accurate than photos")
        log.warning("terrain %s: the ground is not measured in photos: %s", terrain_text(terrain), reasons[0])
    for step in _steps(scanned, views):
        try:
            found = step(found, around, options)
        except ReconstructionError as error:
            reasons.append(error.reason)
            log.warning("terrain %s: %s: %s", terrain_text(terrain), FAILURES[step], error.reason)
    with writing_folder(refined) as folder:
        shutil.copytree(meshes, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns(".*"))
        if found is not start:
            ground = moved_ground(scene.part(NO_ROCK), start, found)
            longer = {rock: continued_down(mesh, found.grid, found.height_m) for rock, mesh in published.items()}
            _write_refined(folder, terrain, ground, rocks | longer)
        _write_map(folder, found)
        write_json(folder / GROUND_FILE, _summary(start, found, [str(view.key) for view in views], reasons))


def _steps(scanned: bool, views: list[PhotoView]) -> list[Step]:
    """Return the steps for a source of photos.

    On the analog's terrain 3, shading of 16 linear photos takes 126 CPU s and makes swept heights worse (0.64 to 1.33
    mm, normals 3.1 to 3.2 degrees). Scans are more accurate than the sweep (0.24 mm).
    """
    if scanned:
        return []
    return [_swept] if views and views[0].linear else [_swept, _shaded]


def _swept(start: HeightMap, around: SweptScene, options: RenderOptions) -> HeightMap:  # noqa: ARG001
    """Measure heights by a plane sweep."""
    return sweep_ground(start, around)


def _shaded(start: HeightMap, around: SweptScene, options: RenderOptions) -> HeightMap:
    """Refine heights by shading.

    Errors of neighbouring cells of a sweep are correlated over its window. Therefore, their common standard deviation
    is that of a single cell, and shading determines the finer relief.
    """
    cells = 2 * np.sqrt(np.pi) * around.trust.window_cells  # width of the square with the area of the window's square
    loose = replace(start, sd_m=start.sd_m * cells)
    masked = below_rocks(start.grid, around.rocks)
    solid = join_meshes([around.rocks, around.walls])
    parameters = options.parameters(options.reflectance_models[0], "ground")
    found = refine(loose, around.views, masked, make_caster(solid.vertices, solid.faces), parameters)
    return replace(found, sd_m=np.where(start.kind == MEASURED, start.sd_m, found.sd_m))


Step = Callable[[HeightMap, SweptScene, RenderOptions], HeightMap]
FAILURES: dict[Step, str] = {
    _swept: "the ground is not measured in photos",
    _shaded: "the ground is not refined by shading",
}


def start_map(scene: TerrainMesh, sandbox: Sandbox, cell: float, support: np.ndarray | None) -> HeightMap:
    """Return the heights of the ground mesh inside the walls; `support` (v,): of the mesh's vertices by scans."""
    low, high = (scene.walls.bounds if scene.walls else _nominal_bounds(sandbox)) + [[WALL_MARGIN], [-WALL_MARGIN]]
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


def _summary(start: HeightMap, found: HeightMap, photos: list[str], reasons: list[str]) -> dict[str, object]:
    """Return the shares of measured, inferred and invented cells, the change of the ground, mm, and the photos."""
    known = found.kind == MEASURED
    change = (found.height_m - start.height_m)[known]
    return {
        "refined": found is not start,
        "reasons": reasons,
        "photos": photos,
        "cell_mm": 1000 * found.grid.cell,
        "measured_share": round(float(known.mean()), 3),
        "inferred_share": round(float((found.kind == INFERRED).mean()), 3),
        "invented_share": round(float((found.kind == INVENTED).mean()), 3),
        "median_change_mm": round(1000 * float(np.median(change)), 1) if change.size else 0.0,
        "median_sd_mm": round(1000 * float(np.median(found.sd_m[known])), 2) if known.any() else None,
    }


def _scene(scene: TerrainMesh, sandbox: Sandbox, views: list[PhotoView], feet: list[np.ndarray]) -> SweptScene:
    walls = scene.walls or flat_walls(sandbox, scene.sand_level)
    vertices, faces, _ = walls.mesh(scene.sand_level - 0.5)
    rocks = Mesh(scene.vertices, scene.faces[scene.rock_of_face != NO_ROCK])
    return SweptScene(views, comparable_groups(views), rocks, Mesh(vertices, faces), feet)


def _nominal_bounds(sandbox: Sandbox) -> np.ndarray:
    half = np.array(sandbox.half_width_m)
    return np.array([-half, half])


def _support(meshes: Path, name: str) -> np.ndarray:
    """Return the support (v,) of the ground's vertices by scans."""
    table = tables.read_parquet(meshes / SUPPORT_FILE, ["mesh", "vertex", "support"])
    own = table[table["mesh"].astype(str) == name].sort_values("vertex")
    return own["support"].to_numpy(float)


def _write_refined(folder: Path, terrain: Terrain, ground: Mesh, rocks: Mapping[int, Mesh]) -> None:
    """Replace ground and rocks in a folder of meshes: OBJ files, rows of the table, and the file for viewers."""
    table = tables.read_csv(folder / MESH_TABLE, ["mesh", "made_from"]).set_index("mesh")
    for rock, mesh in {NO_ROCK: ground, **rocks}.items():
        name = obj.ground_name(terrain) if rock == NO_ROCK else obj.rock_name(terrain, rock)
        if rock == NO_ROCK or len(mesh.faces) != table.loc[name, "faces"]:
            obj.write_obj(folder / name, mesh, Path(name).stem)
            row = mesh_row(name, mesh)
            for column in (column for column in row if column != "mesh"):
                table.loc[name, column] = row[column]  # type: ignore[call-overload]
    table.loc[obj.ground_name(terrain), "made_from"] = PHOTOS
    tables.write_csv(folder / MESH_TABLE, table.reset_index())
    shown = {f"rock{rock}": mesh for rock, mesh in sorted(rocks.items())}
    gltf.write_glb(
        folder / gltf.name(terrain), {gltf.GROUND_NODE: cluster_vertices(ground, MAX_VIEWER_VERTICES), **shown}, {}
    )


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
