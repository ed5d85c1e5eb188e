"""Defects of published rock meshes, and repaired copies: closed underground, without skirt and small parts."""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import ReconstructionError, with_path
from polarsim.formats import obj, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.ply import Cloud
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.orientation import oriented
from polarsim.geometry.outlines import rim
from polarsim.geometry.planes import robust_plane
from polarsim.geometry.topology import is_watertight, largest_island, linked_parts, open_edges, part_of_face
from polarsim.photo import Terrain, terrain_text
from polarsim.progress import track
from polarsim.rocks.fitted_ground import FITTED_GROUND_CELL
from polarsim.rocks.folder import DECIMATED_SHARE, write_named
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.mesh import ground_heights
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.solids import decimate_mesh, merged_vertices
from polarsim.rocks.surfaces import closed_rock
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import PUBLISHED
from polarsim.schemas.stages import DEFECTS
from polarsim.site import Site

log = logging.getLogger("polarsim")
FILE = "defects.csv"
SKIRT = 0.004  # metres above the plane through a rock's rim: lower parts are sand that was cut out with the rock
SKIRT_SHARE = 0.35  # maximum share of a rock's height that the skirt has
MAX_EXCESS = 0.02  # metres by which a copy may extend beyond the published surface without a warning
RIM_SCALE = 0.003  # scale of the robust plane through the rim, metres


def defect_table(published: Mapping[int, Mesh]) -> pd.DataFrame:
    """Return a row for each published rock, see `docs/formats.md`."""
    return pd.DataFrame(
        [{"rock": rock, **defects(mesh)} for rock, mesh in published.items()], columns=list(DEFECTS.columns)
    )


def defects(mesh: Mesh) -> dict[str, object]:
    """Count the defects of a mesh; lengths in metres."""
    used = np.unique(mesh.faces)
    joined = merged_vertices(mesh)
    part = part_of_face(joined.faces)
    main = largest_island(joined)
    edges = open_edges(main.faces)
    lengths = np.linalg.norm(main.vertices[edges[:, 0]] - main.vertices[edges[:, 1]], axis=1)
    loop = linked_parts(edges, len(main.vertices))[edges[:, 0]]
    loops = np.bincount(loop, lengths)
    loops = loops[loops > 0]
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "unused_vertices": len(mesh.vertices) - len(used),
        "doubled_vertices": len(used) - len(np.unique(mesh.vertices[used], axis=0)),
        "islands": int(part.max(initial=-1)) + 1,
        "small_component_faces": len(joined.faces) - len(main.faces),
        "watertight": is_watertight(main.faces),
        "holes": max(0, len(loops) - 1),  # the longest loop is the rim
        "rim_m": round(float(loops.max(initial=0.0)), 4),
        "skirt_share": round(_skirt_share(main), 4),
    }


def repaired(mesh: Mesh, grid: FloorGrid, ground: np.ndarray, scanners: np.ndarray, cell: float) -> Mesh:
    """Return a closed copy: the surface above the skirt, the hidden back, and an underside below the ground.

    Faces of some published rocks have no common orientation, so the outer sides are searched.

    `ground` (rows, columns): heights of the ground on `grid`, also under the rock.
    `scanners` (s, 3): positions of the scanners, which distinguish scanned and hidden sides.
    `cell`: cell of the reconstruction, metres.
    """
    normals = oriented(mesh).normals()
    directed = np.linalg.norm(normals, axis=1) > 0.5  # vertices of faces without area have no normal
    rock = directed & (mesh.vertices[:, 2] > _skirt_height(mesh, mesh.vertices))
    return closed_rock(
        Cloud(mesh.vertices[rock], normals[rock]), grid, ground, np.zeros(grid.shape, bool), scanners, cell
    )


def excess(copy: Mesh, mesh: Mesh) -> float:
    """Return the length, m, by which a copy extends beyond a mesh, upwards or sideways; at most 14 mm in POLAR-Sim."""
    above = copy.vertices.max(axis=0) - mesh.vertices.max(axis=0)
    below = mesh.vertices.min(axis=0) - copy.vertices.min(axis=0)  # downwards, a copy has an underside
    return float(max(above.max(), below[:2].max()))


def _skirt_share(mesh: Mesh) -> float:
    """Return the share of a surface's area in its skirt."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    centre = (a + b + c) / 3
    return float(area[centre[:, 2] < _skirt_height(mesh, centre)].sum() / max(area.sum(), 1e-30))


def _skirt_height(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of the upper end of the skirt at points (n, 3)."""
    slope_x, slope_y, level = robust_plane(rim(mesh), RIM_SCALE)
    bottom, top = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    over_rim = slope_x * points[:, 0] + slope_y * points[:, 1] + level + SKIRT
    return np.minimum(over_rim, bottom + SKIRT_SHARE * (top - bottom))


def repair_rocks(
    *, site: Site, terrain: Terrain, inventory: Path, cameras: Path, meshes: Path, copies: Path, options: RocksOptions
) -> None:
    """Write `copies`: each rock watertight, also decimated, the ground, `meshes.csv`, and `defects.csv` of the release.

    A rock with a surface that encloses no volume is skipped with a warning.

    `meshes`: folder of the terrain's adopted rocks and their ground.
    """
    with with_path(inventory):
        published = {rock: obj.read_obj(path) for rock, path in read_inventory(inventory).rock_meshes().items()}
    ground = obj.read_obj(meshes / obj.ground_name(terrain)).vertices
    half = np.array(site.sandbox_of(terrain).half_width_m)
    grid, heights = ground_heights(Cloud(ground, np.zeros_like(ground)), FITTED_GROUND_CELL, half)
    rigs = read_all_localised(cameras).values()
    scanners = np.array([rig.sandbox_from_left.translation for rig in rigs]).reshape(-1, 3)
    closed = {}
    for rock, path in track(list(obj.rock_files(meshes).items()), f"repair of terrain {terrain_text(terrain)}"):
        adopted = obj.read_obj(path)
        try:
            copy = repaired(adopted, grid, heights, scanners, options.rock_cell_mm / 1000)
        except ReconstructionError as error:
            log.warning("terrain %s, rock %d cannot be closed: %s", terrain_text(terrain), rock, error)
            continue
        if (beyond := excess(copy, adopted)) > MAX_EXCESS:
            log.warning(
                "terrain %s, rock %d: the closed copy extends %.0f mm beyond the published surface",
                terrain_text(terrain), rock, 1000 * beyond,
            )  # fmt: skip
        closed[obj.rock_name(terrain, rock)] = copy
        closed[obj.rock_name(terrain, rock, decimated=True)] = decimate_mesh(copy, DECIMATED_SHARE)
    with writing_folder(copies) as folder:
        write_named(folder, closed, dict.fromkeys(closed, PUBLISHED))
        shutil.copyfile(meshes / obj.ground_name(terrain), folder / obj.ground_name(terrain))
        tables.write_csv(folder / FILE, defect_table(published))
