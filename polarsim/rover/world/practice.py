"""Ground to practise on: made up anew for every seed, rough, with angular rocks; no terrain of anybody's."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy import ndimage

from polarsim.errors import RoverError
from polarsim.geometry.topology import hull_faces
from polarsim.randomness import generator
from polarsim.rover.world.surface import ROCK_COLUMNS, World, bare_world

CORNERS = 24  # points whose hull a rock is
BURIED = 0.25  # share of a rock's height below the ground, as in POLAR's sandbox


@dataclass(frozen=True)
class PracticeGround:
    """Metres; heights vary by `roughness_m` (standard deviation) over lengths of `wave_m`."""

    length_m: float = 10.0
    width_m: float = 5.0
    cell_m: float = 0.02
    roughness_m: float = 0.012
    wave_m: float = 0.25
    rocks: int = 12
    smallest_m: float = 0.06
    largest_m: float = 0.25
    clear_m: float = 1.3  # round the position where the rover is put down no rock lies


def practice_world(options: PracticeGround, seed: int) -> World:
    """A made-up world; x from 0 to its length, y about 0.

    Raises
    ------
    RoverError
        No room for the rover.
    """
    if min(options.length_m, options.width_m) < 3:
        raise RoverError(f"a practice ground of {options.length_m:g} x {options.width_m:g} m, the rover needs 3 x 3 m")
    cell = options.cell_m
    shape = (round(options.width_m / cell) + 1, round(options.length_m / cell) + 1)
    noise = ndimage.gaussian_filter(generator(seed, "practice ground").normal(size=shape), options.wave_m / cell / 2)
    level = noise * (options.roughness_m / noise.std())
    bare = bare_world(level, cell, 0.0, -options.width_m / 2)
    return _with_rocks(bare, options, seed) if options.rocks else bare


def _with_rocks(bare: World, options: PracticeGround, seed: int) -> World:
    rng = generator(seed, "practice rocks")
    rows: list[tuple[float, ...]] = []
    vertices, triangles, corners, faces = [], [], 0, 0
    while len(rows) < options.rocks:
        x, y = rng.uniform([0.5, bare.y[0] + 0.5], [options.length_m - 0.5, bare.y[-1] - 0.5])
        size = options.smallest_m * (options.largest_m / options.smallest_m) ** rng.random()
        shape = _rock(rng, size)
        if np.hypot(x - (options.length_m - 2.0), y) < options.clear_m:
            continue
        top, bottom = shape[0][:, 2].max(), shape[0][:, 2].min()
        ground = float(bare.height_at(x, y))
        points = shape[0] + [x, y, ground - bottom - BURIED * (top - bottom)]
        width = float(np.ptp(points[:, :2], axis=0).max())
        height = float(points[:, 2].max()) - ground
        radius = float(np.hypot(points[:, 0] - x, points[:, 1] - y).max())
        rows.append((len(rows), 0, len(rows), x, y, height, width, radius, faces, len(shape[1])))
        vertices.append(points)
        triangles.append(shape[1] + corners)
        corners, faces = corners + len(points), faces + len(shape[1])
    table, corners_of = pd.DataFrame(rows, columns=list(ROCK_COLUMNS)), np.concatenate(vertices).astype(np.float32)
    return replace(bare, rocks=table, vertices=corners_of, triangles=np.concatenate(triangles).astype(np.int32))


def _rock(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and outward triangles of the hull of points on a flattened ball."""
    points = rng.normal(size=(CORNERS, 3))
    points *= 0.5 * size * np.array([1.0, 0.8, 0.6]) / np.linalg.norm(points, axis=1, keepdims=True)
    return points, hull_faces(points)
