"""Terrains side by side: a grid of heights from their ground meshes, their rocks, and filler ground around them.

The first terrain is in the east. Each terrain contributes its central `terrain_m`; adjacent terrains blend over
`BLEND_M` at the seam, where both grounds overlap. Heights are relative to the sand level of each terrain, so that
published meshes with vertical offsets of decimetres also match.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.sparse import coo_array, diags_array
from scipy.sparse.linalg import spsolve

from polarsim.errors import RoverError, with_path
from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import is_watertight, remove_unused_vertices
from polarsim.photo import Terrain
from polarsim.randomness import generator
from polarsim.rover.world.hulls import require_volume
from polarsim.rover.world.mesh_heights import top_at
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.surface import PlacedRock, World, bare_world, outward, with_rocks
from polarsim.wording import counted

log = logging.getLogger("polarsim")
BLEND_M = 0.4  # width of the blend of two grounds at a seam
FILLER_SD_M = 0.003  # standard deviation of filler ground's heights
FILLER_GRAIN = 0.08  # m, correlation length of the filler ground's heights
FADE = 0.3  # m, width of the transition from a terrain's edge to filler ground


@dataclass(frozen=True)
class TerrainSolids:
    """Meshes of a terrain in the sandbox frame: x towards azimuth 0, east."""

    number: Terrain
    ground: Mesh
    rocks: Mapping[int, Mesh]

    @property
    def sand_level(self) -> float:
        return float(np.median(self.ground.vertices[:, 2]))


def read_terrain_meshes(folder: str | Path, number: Terrain) -> TerrainSolids:
    """Read ground and rocks of a folder; decimated rocks are preferred, and a rock without volume is an error.

    Rocks with holes are reported, because their images differ from their convex parts.
    """
    folder = Path(folder)
    rocks, opened = {}, []
    for rock, path in obj.rock_files(folder).items():
        decimated = folder / obj.rock_name(number, rock, decimated=True)
        chosen = decimated if decimated.exists() else path
        rocks[rock] = obj.read_obj(chosen)
        with with_path(chosen):
            require_volume(rocks[rock].vertices)
        if not is_watertight(rocks[rock].faces):
            opened.append(rock)
    if opened:
        log.warning(
            "%s: %s with holes, which the physics fills and images show: %s",
            folder, counted(len(opened), "rock"), ", ".join(map(str, opened)),
        )  # fmt: skip
    return TerrainSolids(number, obj.read_obj(folder / obj.ground_name(number)), rocks)


def stitch(terrains: list[TerrainSolids], options: WorldOptions) -> World:
    """Return the strip of terrains, from east to west, with the centre at x = y = 0."""
    length, cell = options.terrain_m * len(terrains), options.cell_m
    columns = 2 * round((length / 2 + options.margin_m) / cell) + 1
    rows = 2 * round(options.width_m / 2 / cell) + 1
    x0, y0 = -(columns - 1) / 2 * cell, -(rows - 1) / 2 * cell
    x, y = x0 + cell * np.arange(columns), y0 + cell * np.arange(rows)
    total, weights = np.zeros((rows, columns)), np.zeros((rows, columns))
    for terrain, centre in zip(terrains, terrain_centres(options), strict=True):
        reach = (options.terrain_m + BLEND_M) / 2
        part = slice(*np.searchsorted(x, [centre - reach, centre + reach]))
        heights = _heights(terrain, x[part] - centre, y)
        # Each weight falls from 1 to 0 across the seam, and the weights of adjacent terrains add up to 1.
        share = _ramp((options.terrain_m / 2 - np.abs(x[part] - centre)) / BLEND_M + 0.5)
        covered = np.isfinite(heights)
        total[:, part] += np.where(covered, heights, 0.0) * share
        weights[:, part] += covered * share
    level = _with_filler(total, weights, cell)
    world = bare_world(level, cell, x0, y0)
    return with_rocks(world, _rocks_in_strip(world, terrains, options))


def terrain_centres(options: WorldOptions) -> np.ndarray:
    """Return (n,) x of the terrains' centres, from east to west."""
    count = len(options.terrains)
    return options.terrain_m * ((count - 1) / 2 - np.arange(count))


def rough_world(world: World, deviation: float, seed: int) -> World:
    """Return the world with noise on all nodes, which depends on the seed."""
    around = world.around
    if around is not None:  # otherwise the surroundings would look smoother than the grid
        step = np.maximum(np.gradient(around.y)[:, None], np.gradient(around.x))
        noise = generator(seed, "rover", "ground around").normal(0.0, deviation, step.shape) * (world.cell / step)
        around = replace(around, level=(around.level + noise).astype(np.float32))
    noise = generator(seed, "rover", "ground").normal(0.0, 1.0, world.level.shape) * deviation
    return replace(world, level=world.level + noise, around=around)


def _ramp(value: np.ndarray) -> np.ndarray:
    """Return a smooth step from 0 to 1."""
    t = np.clip(value, 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


def _heights(terrain: TerrainSolids, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return heights (rows, columns) above the sand level, with filled holes; NaN outside the ground's edges."""
    across, along = np.meshgrid(x, y)
    top = top_at(terrain.ground.vertices, terrain.ground.faces, across.ravel(), along.ravel()).reshape(across.shape)
    low, high = terrain.ground.vertices[:, :2].min(axis=0), terrain.ground.vertices[:, :2].max(axis=0)
    inside = (across >= low[0]) & (across <= high[0]) & (along >= low[1]) & (along <= high[1])
    if not np.isfinite(top[inside]).any():
        raise RoverError(f"terrain {terrain.number}: the ground mesh does not overlap its part of the strip")
    level = np.where(np.isfinite(top), top, np.nan) - terrain.sand_level
    return np.where(inside, fill_holes(level, inside), np.nan)


def fill_holes(level: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Fill NaN nodes of `inside` with a membrane: each filled node is the mean of the adjacent nodes."""
    holes = inside & np.isnan(level)
    size = int(holes.sum())
    if not size:
        return level
    padded, usable = np.pad(level, 1), np.pad(inside, 1)
    number = np.full(padded.shape, -1)  # of each hole
    number[1:-1, 1:-1][holes] = np.arange(size)
    rows, columns = np.nonzero(number >= 0)
    here, there, known, count = [], [], np.zeros(size), np.zeros(size)
    for down, right in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        adjacent = rows + down, columns + right
        hole, border = number[adjacent] >= 0, usable[adjacent] & (number[adjacent] < 0)
        here.append(np.flatnonzero(hole))
        there.append(number[adjacent][hole])
        known[border] += padded[adjacent][border]
        count += hole | border
    links = np.concatenate(here), np.concatenate(there)
    adjacency = coo_array((np.ones(len(links[0])), links), shape=(size, size))
    filled = level.copy()
    filled[holes] = spsolve((diags_array(np.maximum(count, 1)) - adjacency).tocsc(), known)
    return filled


def _with_filler(total: np.ndarray, weights: np.ndarray, cell: float) -> np.ndarray:
    """Fill nodes outside terrains with the height of the nearest terrain, fading to level ground with slight relief."""
    covered = weights > 0.5
    level = np.where(covered, total / np.where(covered, weights, 1.0), 0.0)
    distance, nearest = distance_transform_edt(~covered, return_indices=True)
    edge = level[tuple(nearest)]
    grain = gaussian_filter(generator(0, "rover", "filler").normal(size=level.shape), FILLER_GRAIN / cell)
    relief = FILLER_SD_M * grain / grain.std()
    kept = _ramp(1 - distance * cell / FADE)
    return np.where(covered, level, kept * edge + (1 - kept) * relief)


def _rocks_in_strip(world: World, terrains: list[TerrainSolids], options: WorldOptions) -> Iterator[PlacedRock]:
    for terrain, centre in zip(terrains, terrain_centres(options), strict=True):
        for number, rock in sorted(terrain.rocks.items()):
            mesh = remove_unused_vertices(rock.vertices, rock.faces)
            points = mesh.vertices + np.array([centre, 0.0, -terrain.sand_level])
            x, y = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
            if abs(x - centre) <= options.terrain_m / 2 and world.y[0] < y < world.y[-1]:
                yield PlacedRock(terrain.number, number, points, outward(points, mesh.faces))
