"""World from an elevation model, with finer relief, craters and rocks; fine near the path, coarse up to the horizon.

The drive's grid surrounds the path; outside it, the distance between nodes grows up to the horizon. All heights are
samples of the same ground at different nodes. The origin is the centre of the square, at height 0.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.interpolate import RectBivariateSpline

from polarsim.errors import RoverError
from polarsim.formats.geotiff import Elevation, read_elevation
from polarsim.geometry.heightfields import amplitudes, octave_relief, spacings
from polarsim.geometry.meshes import Mesh
from polarsim.rover.world.craters import dig, random_craters
from polarsim.rover.world.options import DemOptions, WorldOptions
from polarsim.rover.world.rock_field import (
    RING_RADII,
    RockField,
    RockModel,
    random_rocks,
    rock_shapes,
    smooth,
    vertices_in_world,
)
from polarsim.rover.world.stitch import TerrainSolids
from polarsim.rover.world.surface import PlacedRock, World, WorldBackdrop, bare_world, stored_arrays, with_rocks
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS

GROWTH, GROWTH_FAR = 1.02, 1.1  # ratio of adjacent node distances, in the square and outside
HURST = 0.76  # Hurst exponent of the added relief: lunar maria (Rosenburg et al., J. Geophys. Res. 116 (2011) E02001)
COARSE_CELL_M = 0.25  # maximum distance between nodes in the square
CORNERS = (150, 32)  # vertices of rocks outside the grid, and of rocks without labels
_MOST_ROCKS = SHADOW_IDS - ROCK_IDS - 1  # maximum number of rocks with labels; the others are part of the surroundings


def dem_world(options: WorldOptions, terrains: list[TerrainSolids], path: np.ndarray) -> World:
    """Return the world around a path (n, 2); `terrains` provide the shapes of rocks.

    A path that leaves the square, an elevation model that is too small or has gaps, and terrains without rocks are
    errors.
    """
    dem = options.dem
    assert dem is not None
    inner = _grid(options, dem, path)
    elevation = read_elevation(dem.path, dem.size_m / 2, dem.horizon_m, dem.centre_m) if dem.path else None
    x, y = (_nodes(nodes, dem) for nodes in inner)
    level = ground_at(x, y, dem, options.cell_m, elevation)
    inside = tuple(
        slice(*np.searchsorted(all_, [nodes[0], nodes[-1] + options.cell_m / 2]))
        for all_, nodes in zip((y, x), inner[::-1], strict=True)
    )
    around = WorldBackdrop(x, y, level.astype(np.float32), *stored_arrays([]))
    bare = replace(bare_world(level[inside], options.cell_m, inner[0][0], inner[1][0]), around=around)
    if not dem.rocks:
        return bare
    shapes = rock_shapes(terrains, CORNERS)
    return _strewn(bare, random_rocks(dem.rocks, shapes, dem.size_m, path[:1], dem.seed), shapes)


def ground_at(x: np.ndarray, y: np.ndarray, dem: DemOptions, cell: float, elevation: Elevation | None) -> np.ndarray:
    """Return heights (rows, columns) of a ground without rocks at nodes x (columns,) and y (rows,), m."""
    level = np.zeros((len(y), len(x)))
    if elevation is not None:
        spline = RectBivariateSpline(elevation.y, elevation.x, elevation.height)
        heights, centre = (
            spline(np.clip(v, *elevation.y[[0, -1]]), np.clip(u, *elevation.x[[0, -1]]))
            for u, v in ((x, y), (np.zeros(1), np.zeros(1)))
        )
        level += heights - centre
    spacing = spacings(2 * cell, elevation.pixel_m if elevation else dem.horizon_m / 4)
    amplitude = amplitudes(spacing, HURST, dem.relief_m)
    level += octave_relief(
        x, y, spacing=spacing, amplitude=amplitude, half_m=dem.size_m / 2, far_m=dem.horizon_m, seed=dem.seed
    )
    dig(level, x, y, random_craters(dem.craters, dem.size_m, dem.seed))
    return level


def _grid(options: WorldOptions, dem: DemOptions, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes x and y of the drive's grid around the path."""
    axes = []
    for name, positions, reach in (("x", path[:, 0], options.margin_m), ("y", path[:, 1], options.width_m / 2)):
        low, high = positions.min() - reach, positions.max() + reach
        if low < -dem.size_m / 2 or high > dem.size_m / 2:
            raise RoverError(
                f"the drive's ground from {name} {low:.2f} to {high:.2f} m leaves the square of rover.world.dem, "
                f"{name} {-dem.size_m / 2:g} to {dem.size_m / 2:g} m"
            )
        axes.append(options.cell_m * np.arange(round(low / options.cell_m), round(high / options.cell_m) + 1))
    return axes[0], axes[1]


def _nodes(inner: np.ndarray, dem: DemOptions) -> np.ndarray:
    """Return the nodes of the grid and outside it, with growing distances, at most `COARSE_CELL_M` in the square."""
    cell, half = inner[1] - inner[0], dem.size_m / 2
    sides = []
    for rim in (-inner[0], inner[-1]):
        steps, place, step = [], rim, cell
        while place < max(dem.horizon_m, half):
            step = step * GROWTH_FAR if place >= half else min(step * GROWTH, max(COARSE_CELL_M, cell))
            place += step
            steps.append(place)
        sides.append(np.array(steps))
    return np.concatenate([-sides[0][::-1], inner, sides[1]])


def _strewn(bare: World, field: RockField, shapes: list[RockModel]) -> World:
    """Return the world with rocks.

    Rocks with the largest angular size from the grid have rows in the table, others are part of the surroundings.
    """
    assert bare.around is not None
    distance = bare.distance_to_grid(field.x, field.y)
    near = distance <= field.diameter
    order = np.lexsort((-field.diameter / np.maximum(distance, 1e-9), ~near))
    count = max(_MOST_ROCKS, int(near.sum()))
    foot = np.stack([field.x, field.y, _ground_around(bare, field)], axis=1)
    world = with_rocks(bare, _placed(field, shapes, foot, np.sort(order[:count]), near))
    scenery = []
    for rock in np.sort(order[count:]):
        mesh = shapes[field.shape[rock]].levels[-1]
        points = vertices_in_world(mesh, field.diameter[rock], field.angle[rock], foot[rock])
        scenery.append(Mesh(points, mesh.faces))
    vertices, triangles = stored_arrays(scenery)
    return replace(world, around=replace(bare.around, vertices=vertices, triangles=triangles))


def _placed(
    field: RockField, shapes: list[RockModel], foot: np.ndarray, chosen: np.ndarray, near: np.ndarray
) -> Iterator[PlacedRock]:
    for rock in chosen.tolist():
        shape = shapes[field.shape[rock]]
        mesh = smooth(shape.levels[0], field.diameter[rock]) if near[rock] else shape.levels[1]
        points = vertices_in_world(mesh, field.diameter[rock], field.angle[rock], foot[rock])
        yield PlacedRock(shape.terrain, shape.rock, points, mesh.faces)


def _ground_around(bare: World, field: RockField) -> np.ndarray:
    """Return (n,) the median height of the ground on a ring around each rock."""
    ring = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    reach = RING_RADII * field.diameter[:, None]
    around = bare.height_at(field.x[:, None] + reach * np.cos(ring), field.y[:, None] + reach * np.sin(ring))
    return np.asarray(np.median(around, axis=1))
