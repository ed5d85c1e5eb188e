"""Random practice ground for each seed: rough, with angular rocks, independent of any terrain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.errors import RoverError
from polarsim.geometry.topology import hull_faces
from polarsim.randomness import generator
from polarsim.rover.world.surface import PlacedRock, World, bare_world, with_rocks

CORNERS = 24  # number of points whose convex hull is a rock
BURIED = 0.25  # share of a rock's height below the ground, as in POLAR's sandbox


@dataclass(frozen=True)
class PracticeGround:
    """Size of a practice ground, m; heights vary by `roughness_m` (standard deviation) over lengths of `wave_m`."""

    length_m: float = 10.0
    width_m: float = 5.0
    cell_m: float = 0.02
    roughness_m: float = 0.012
    wave_m: float = 0.25
    rocks: int = 12
    smallest_m: float = 0.06
    largest_m: float = 0.25
    clear_m: float = 1.3  # minimum distance of rocks from the start


def practice_world(options: PracticeGround, seed: int) -> World:
    """Return a random world; x from 0 to its length, y about 0."""
    if min(options.length_m, options.width_m) < 3:
        raise RoverError(f"a practice ground of {options.length_m:g} x {options.width_m:g} m, the rover needs 3 x 3 m")
    cell = options.cell_m
    shape = (round(options.width_m / cell) + 1, round(options.length_m / cell) + 1)
    noise = ndimage.gaussian_filter(generator(seed, "practice ground").normal(size=shape), options.wave_m / cell / 2)
    level = noise * (options.roughness_m / noise.std())
    bare = bare_world(level, cell, 0.0, -options.width_m / 2)
    return with_rocks(bare, _rocks(bare, options, seed))


def _rocks(bare: World, options: PracticeGround, seed: int) -> Iterator[PlacedRock]:
    rng, placed = generator(seed, "practice rocks"), 0
    while placed < options.rocks:
        x, y = rng.uniform([0.5, bare.y[0] + 0.5], [options.length_m - 0.5, bare.y[-1] - 0.5])
        size = options.smallest_m * (options.largest_m / options.smallest_m) ** rng.random()
        points, faces = _rock(rng, size)
        if np.hypot(x - (options.length_m - 2.0), y) < options.clear_m:
            continue
        top, bottom = points[:, 2].max(), points[:, 2].min()
        foot = np.array([x, y, float(bare.height_at(x, y)) - bottom - BURIED * (top - bottom)])
        yield PlacedRock(0, placed, points + foot, faces)
        placed += 1


def _rock(rng: np.random.Generator, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and outward triangles of the convex hull of points on a flattened sphere."""
    points = rng.normal(size=(CORNERS, 3))
    points *= 0.5 * size * np.array([1.0, 0.8, 0.6]) / np.linalg.norm(points, axis=1, keepdims=True)
    return points, hull_faces(points)
