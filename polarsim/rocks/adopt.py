"""Adoption of published rock meshes, on the published ground or, if there is none, on a ground fitted under them."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats import obj, tables
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import rim
from polarsim.geometry.topology import largest_island
from polarsim.geometry.vectors import cross
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.rocks import table
from polarsim.rocks.fitted_ground import FITTED_GROUND_CELL, fit_ground
from polarsim.rocks.folder import height_mesh, write_meshes
from polarsim.rocks.heights import FloorGrid, filled
from polarsim.rocks.overrides import Cuboid, write_cuboids
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import merged_vertices
from polarsim.run_files import scene
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rock_translations import read_translations
from polarsim.site import Site
from polarsim.site_parts import Sandbox

log = logging.getLogger("polarsim")
PUBLISHED_MARGIN = 0.10  # metres around the sand: the origin of published frames may be a decimetre off the centre
MAX_GROUND_RATIO = 5.0  # maximum size of a ground relative to the sand: a ground in other units is much larger
MIN_FOOT_ON_GROUND = 0.5  # minimum share of the points of a rock's foot with ground below or above
MAX_FOOT_GAP = 0.05  # maximum distance between rocks' feet and the ground, metres, median over rocks


def read_ground(path: str | Path, feet: Mapping[int, np.ndarray], sandbox: Sandbox) -> Mesh:
    """Read the mesh of the ground, oriented upwards, and check that it belongs to the rocks.

    `feet`, rock id -> (n, 3): points of the rims of the published rocks, metres, sandbox frame.
    """
    ground = obj.read_obj(path)
    with with_path(path):
        spans = np.ptp(ground.vertices[:, :2], axis=0)
        x, y = (2 * half for half in sandbox.half_width_m)
        if spans.max() > MAX_GROUND_RATIO * max(x, y):
            raise FormatError(
                f"the ground measures {spans[0]:.4g} by {spans[1]:.4g} m, the sandbox {x:g} by {y:g} m: check that "
                "the unit is metres"
            )
        _check_feet(ground, feet)
    a, b, c = (ground.vertices[ground.faces[:, k]] for k in range(3))
    faces_down = cross(b - a, c - a)[:, 2].sum() < 0
    return Mesh(ground.vertices, ground.faces[:, ::-1]) if faces_down else ground


def heights_on(grid: FloorGrid, ground: Mesh) -> np.ndarray:
    """Return heights (rows, columns) of the mesh at the cells' centres, metres, continued smoothly outside the mesh."""
    nodes = grid.centres().reshape(-1, 2)
    heights = _heights_at(ground, nodes).reshape(grid.shape)
    return filled(np.nan_to_num(heights), np.isfinite(heights))


def _check_feet(ground: Mesh, feet: Mapping[int, np.ndarray]) -> None:
    gaps = {rock: points[:, 2] - _heights_at(ground, points) for rock, points in feet.items()}
    bare = [rock for rock, gap in gaps.items() if np.isfinite(gap).mean() < MIN_FOOT_ON_GROUND]
    if bare:
        raise FormatError(
            f"no ground at rock {', '.join(map(str, bare))} of {len(gaps)}: the ground must extend under all rocks"
        )
    if gaps:
        offs = np.array([np.nanmedian(gap) for gap in gaps.values()])
        if np.median(np.abs(offs)) > MAX_FOOT_GAP:
            raise FormatError(
                f"the rocks' feet are {1000 * np.median(offs):+.0f} mm above this ground, median of {len(offs)} rocks, "
                f"maximum {1000 * MAX_FOOT_GAP:.0f} mm: ground and rocks must be in the same frame"
            )


def _heights_at(ground: Mesh, points: np.ndarray) -> np.ndarray:
    """Return the height (n,) of the mesh's upper side at points (n, 2 or 3); NaN outside the mesh."""
    top = ground.vertices[:, 2].max() + 1.0
    origins = np.column_stack([points[:, :2], np.full(len(points), top)])
    distance, _ = make_caster(ground.vertices, ground.faces).nearest(
        origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    )
    return np.where(np.isfinite(distance), top - distance, np.nan)


def adopt_rocks(
    *, site: Site, terrain: Terrain, inventory: Path, cameras: Path, rocks: Path, cuboids: Path, meshes: Path
) -> None:
    """Copy a terrain's published rock meshes and its ground; fit a ground if none is published.

    Rocks are translated as in `cameras/rock_translations.csv`, if that file exists. `meshes.csv` states the source of
    the ground. A terrain without meshes has an empty table and level ground at z = 0.
    """
    published = read_inventory(inventory)
    with with_path(inventory):
        files = published.rock_meshes()
    translations = read_translations(cameras)
    as_published = {rock: cleaned(obj.read_obj(path)) for rock, path in files.items()}
    adopted = {rock: translated_mesh(mesh, translations.get(rock, np.zeros(3))) for rock, mesh in as_published.items()}
    sandbox = site.sandbox_of(terrain)
    half = np.array(sandbox.half_width_m) + PUBLISHED_MARGIN
    grid = FloorGrid(Extent(*-half, *half), FITTED_GROUND_CELL)
    if published.ground:
        ground = read_ground(published.ground, {rock: rim(mesh) for rock, mesh in as_published.items()}, sandbox)
        heights, made_from = heights_on(grid, ground), scene.PUBLISHED
    else:
        heights = fit_ground([rim(mesh) for mesh in adopted.values()], grid)
        ground, made_from = height_mesh(grid, heights), scene.FITTED
        log.warning("%s: no %s, a smooth ground is fitted under the rocks", inventory, obj.ground_name(terrain))
    if not adopted:
        log.warning("%s: terrain %s has no rock meshes", inventory, terrain_text(terrain))
    around = {rock: cuboid_of(mesh) for rock, mesh in adopted.items()}
    rows = [_row(rock, mesh, around[rock], grid, heights) for rock, mesh in adopted.items()]
    sources = {NO_ROCK: made_from, **dict.fromkeys(adopted, scene.PUBLISHED)}
    write_meshes(terrain, meshes, adopted, ground, sources)
    write_cuboids(cuboids, around)
    tables.write_parquet(rocks, table.rock_table(rows))


def cleaned(mesh: Mesh) -> Mesh:
    """Return the largest island without small components, doubled and unused vertices."""
    return largest_island(merged_vertices(mesh))


def translated_mesh(mesh: Mesh, translation: np.ndarray) -> Mesh:
    """Translate a mesh by (3,) metres."""
    return Mesh(mesh.vertices + translation, mesh.faces)


def cuboid_of(mesh: Mesh) -> Cuboid:
    """Return the cuboid around a mesh, rounded outwards to the millimetre."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Cuboid(np.floor(low * 1000) / 1000, np.ceil(high * 1000) / 1000)


def volume_above(mesh: Mesh, grid: FloorGrid, ground: np.ndarray) -> float:
    """Return the volume between the ground and a surface that may be open below the ground, m^3.

    Every face adds the prism between itself and the ground; faces with downward normals subtract theirs.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    centre = (a + b + c) / 3
    return float((area * np.maximum(centre[:, 2] - grid.sample(ground, centre), 0)).sum())


def _row(rock: int, mesh: Mesh, cuboid: Cuboid, grid: FloorGrid, ground: np.ndarray) -> dict[str, object]:
    return table.row(
        rock,
        cuboid,
        size=float(np.ptp(mesh.vertices[:, :2], axis=0).max()),
        height=float((mesh.vertices[:, 2] - grid.sample(ground, mesh.vertices)).max()),
        volume=volume_above(mesh, grid, ground),
        source=scene.PUBLISHED,
    )
