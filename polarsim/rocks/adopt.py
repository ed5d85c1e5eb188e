"""Published rock meshes, cleaned, on the published ground, or on one fitted under them where none is published."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, about
from polarsim.formats import obj, tables
from polarsim.geometry.casters import caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.rims import rim
from polarsim.geometry.vectors import cross
from polarsim.photo import NO_ROCK
from polarsim.rocks import table
from polarsim.rocks.fitted_ground import FITTED_GROUND_CELL, fit_ground
from polarsim.rocks.folder import height_mesh, write_meshes
from polarsim.rocks.heights import FloorGrid, filled
from polarsim.rocks.overrides import Cuboid, write_cuboids
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import largest_island, merged_vertices
from polarsim.run_files import scene
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rock_translations import read_translations

log = logging.getLogger("polarsim")
HALF_WIDTH = 2.10  # metres: published frames are not centred on the box to better than a decimetre
WIDEST = 20.0  # metres: the sandbox measures 4, a ground in other units far more
LEAST_FOOT = 0.5  # of a rock's foot, by its points, that must have ground below or above it
MOST_GAP = 0.05  # metres between a rock's foot and the ground, median over rocks: in one frame they meet


def read_ground(path: str | Path, feet: Mapping[int, np.ndarray]) -> Mesh:
    """The mesh of a file, facing up, where it is the ground of these rocks.

    Parameters
    ----------
    feet : rock id -> (n, 3)
        Points of the rocks' rims as published, metres, sandbox frame.

    Raises
    ------
    FormatError
        The mesh cannot be read, is no sandbox in metres, lacks ground at a rock or lies away from the rocks' feet.
    """
    ground = obj.read(path)
    with about(path):
        spans = np.ptp(ground.vertices[:, :2], axis=0)
        if spans.max() > WIDEST:
            raise FormatError(
                f"a ground of {spans[0]:.4g} by {spans[1]:.4g} m, the sandbox measures 4 m: not in metres?"
            )
        _check_feet(ground, feet)
    a, b, c = (ground.vertices[ground.faces[:, k]] for k in range(3))
    faces_down = cross(b - a, c - a)[:, 2].sum() < 0
    return Mesh(ground.vertices, ground.faces[:, ::-1]) if faces_down else ground


def heights_on(grid: FloorGrid, ground: Mesh) -> np.ndarray:
    """(rows, columns) heights of the mesh at the cells' centres, metres; carried on smoothly where it has none."""
    nodes = grid.centres().reshape(-1, 2)
    heights = _heights_at(ground, nodes).reshape(grid.shape)
    return filled(np.nan_to_num(heights), np.isfinite(heights))


def _check_feet(ground: Mesh, feet: Mapping[int, np.ndarray]) -> None:
    gaps = {rock: points[:, 2] - _heights_at(ground, points) for rock, points in feet.items()}
    bare = [rock for rock, gap in gaps.items() if np.isfinite(gap).mean() < LEAST_FOOT]
    if bare:
        raise FormatError(f"no ground at rock {', '.join(map(str, bare))} of {len(gaps)}: the ground covers all rocks")
    if gaps:
        offs = np.array([np.nanmedian(gap) for gap in gaps.values()])
        if np.median(np.abs(offs)) > MOST_GAP:
            raise FormatError(
                f"the rocks' feet lie {1000 * np.median(offs):+.0f} mm above this ground, median of {len(offs)} "
                f"rocks, {1000 * MOST_GAP:.0f} mm allowed: ground and rocks are not in one frame"
            )


def _heights_at(ground: Mesh, points: np.ndarray) -> np.ndarray:
    """(n,) height of the mesh's upper side at points (n, 2 or 3); NaN beside it."""
    top = ground.vertices[:, 2].max() + 1.0
    origins = np.column_stack([points[:, :2], np.full(len(points), top)])
    distance, _ = caster(ground.vertices, ground.faces).nearest(
        origins, np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    )
    return np.where(np.isfinite(distance), top - distance, np.nan)


def adopt_rocks(*, terrain: int, inventory: Path, cameras: Path, rocks: Path, cuboids: Path, meshes: Path) -> None:
    """Take over a terrain's published rock meshes under their ids, and its ground; fit a ground where none is there.

    Rocks are moved as `cameras/rock_translations.csv` says, where there is one. `meshes.csv` tells where the ground is
    from.

    A terrain without meshes has an empty table and level ground at z = 0.

    Raises
    ------
    FormatError
        A mesh cannot be read, or the published ground does not belong to the rocks.
    """
    published = read_inventory(inventory)
    with about(inventory):
        files = published.rock_meshes()
    translations = read_translations(cameras)
    as_published = {rock: cleaned(obj.read(path)) for rock, path in files.items()}
    adopted = {rock: moved(mesh, translations.get(rock, np.zeros(3))) for rock, mesh in as_published.items()}
    grid = FloorGrid(Extent(-HALF_WIDTH, -HALF_WIDTH, HALF_WIDTH, HALF_WIDTH), FITTED_GROUND_CELL)
    if published.ground:
        ground = read_ground(published.ground, {rock: rim(mesh) for rock, mesh in as_published.items()})
        heights, made_from = heights_on(grid, ground), scene.PUBLISHED
    else:
        heights = fit_ground([rim(mesh) for mesh in adopted.values()], grid)
        ground, made_from = height_mesh(grid, heights), scene.FITTED
        log.warning("%s: no %s, a smooth ground is fitted under the rocks", inventory, obj.ground_name(terrain))
    if not adopted:
        log.warning("%s: terrain %02d has no rock meshes", inventory, terrain)
    around = {rock: cuboid_of(mesh) for rock, mesh in adopted.items()}
    rows = [_row(rock, mesh, around[rock], grid, heights) for rock, mesh in adopted.items()]
    sources = {NO_ROCK: made_from, **dict.fromkeys(adopted, scene.PUBLISHED)}
    write_meshes(terrain, meshes, adopted, ground, sources)
    write_cuboids(cuboids, around)
    tables.write_parquet(rocks, table.rock_table(rows))


def cleaned(mesh: Mesh) -> Mesh:
    """The largest island; small components, doubled and unused vertices go."""
    return largest_island(merged_vertices(mesh))


def moved(mesh: Mesh, translation: np.ndarray) -> Mesh:
    """The mesh translated by (3,) metres."""
    return Mesh(mesh.vertices + translation, mesh.faces)


def cuboid_of(mesh: Mesh) -> Cuboid:
    """The cuboid around a mesh, to the millimetre outwards."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Cuboid(np.floor(low * 1000) / 1000, np.ceil(high * 1000) / 1000)


def volume_above(mesh: Mesh, grid: FloorGrid, ground: np.ndarray) -> float:
    """Volume between the ground and a surface that may be open below it, m^3.

    Every face adds the prism that it spans with the ground; faces that look down take theirs away.
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
