"""Feet of published rocks: heights of the ground below them, and rocks continued down to the ground.

Where the ground was measured in cover photos, the feet of published meshes are above it: by 23, 6 and 9 mm on terrains
01, 03 and 12 (medians over rocks). Meshes that are cut above the sand explain this, as does an error of the poses.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.geometry.meshes import Mesh
from polarsim.geometry.topology import open_edges
from polarsim.rocks.heights import FloorGrid

MIN_ROCKS = 3  # minimum number of rocks with measured ground for a common height of feet above the ground
MAX_CUT_M = 0.04  # maximum height of a cut above the ground
DEPTH_M = 0.01  # depth of continued rocks below the ground, metres
NEAR_M = 0.06  # distance at which measured ground belongs to a foot


def foot_cells(grid: FloorGrid, feet: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the numbers of the cells below the points (n, 3) of each foot."""
    cells = [np.unique(grid.cell_of(points)) for points in feet]
    return [numbers[numbers >= 0] for numbers in cells]


def foot_offset(grid: FloorGrid, offset: np.ndarray, known: np.ndarray, feet: Sequence[np.ndarray]) -> float:
    """Return the common offset of the ground from a surface through the feet: the median over rocks, at most 0."""
    offsets = foot_offsets(grid, offset, known, feet)
    return float(np.clip(np.median(offsets), -MAX_CUT_M, 0.0)) if len(offsets) >= MIN_ROCKS else 0.0


def foot_offsets(grid: FloorGrid, offset: np.ndarray, known: np.ndarray, feet: Sequence[np.ndarray]) -> np.ndarray:
    """Return the median offset (n,) of the measured ground around each foot, metres; feet without it are omitted.

    `offset`, `known`: (rows, columns) offset of the ground from a surface through the feet, and whether it is measured.
    """
    centres, values = grid.centres()[known], offset[known]
    medians = []
    for points in feet:
        low, high = points[:, :2].min(axis=0) - NEAR_M, points[:, :2].max(axis=0) + NEAR_M
        near = ((centres > low) & (centres < high)).all(axis=1)
        if near.sum() * grid.cell**2 > NEAR_M**2:
            medians.append(float(np.median(values[near])))
    return np.array(medians)


def continued_down(rock: Mesh, grid: FloorGrid, height_m: np.ndarray) -> Mesh:
    """Return a rock with vertical sides from its open edges down to `DEPTH_M` below the ground; closed rocks as given.

    Open edges more than `MAX_CUT_M` above the ground are holes, not cuts.
    """
    edges = open_edges(rock.faces)
    ground = grid.sample(height_m, rock.vertices) - DEPTH_M
    gap = rock.vertices[:, 2] - ground
    edges = edges[((gap[edges] > 0) & (gap[edges] < MAX_CUT_M + DEPTH_M)).all(axis=1)]
    if not len(edges):
        return rock
    used, number = np.unique(edges, return_inverse=True)
    number = number.reshape(edges.shape) + len(rock.vertices)
    lower = rock.vertices[used].copy()
    lower[:, 2] = ground[used]
    (first, second), (below_first, below_second) = edges.T, number.T
    sides = [np.stack([second, first, below_first], axis=1), np.stack([second, below_first, below_second], axis=1)]
    return Mesh(np.concatenate([rock.vertices, lower]), np.concatenate([rock.faces, *sides]))
