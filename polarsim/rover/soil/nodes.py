"""Deformable ground: a grid of nodes with levels and the state of the soil at each node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from polarsim.errors import RoverError

# Fields of a node. Levels and depths in metres, stress in Pa, shear displacement as a vector in the world frame.
ORIGINAL, START, LEVEL, PLASTIC, YIELD, FLOW, SHEAR_X, SHEAR_Y, SHEAR_Z, TOUCHED = range(10)
FIELDS = 10
FREE, ROCK = -1, -2  # owner of a node without contact, and of a node under a rock


class SoilGround(NamedTuple):
    """Nodes at (x0 + column cell, y0 + row cell); the contact changes the arrays in place.

    `original` is the level before any contact, `start` the reference level for sinkage (raised by displaced soil),
    `level` the current surface, `plastic` the permanent depth, `yield` the largest earlier pressure, `flow` the depth
    pressed since soil was last moved aside, `touched` the permanent depth at the first contact with the present wheel.
    """

    x0: float
    y0: float
    cell: float
    state: np.ndarray  # (rows, columns, FIELDS)
    normals: np.ndarray  # (rows, columns, 3) normals of the original ground
    owner: np.ndarray  # (rows, columns) int32: index of the wheel in contact with a node, FREE or ROCK

    @property
    def level(self) -> np.ndarray:
        return self.state[..., LEVEL]

    @property
    def x(self) -> np.ndarray:
        return self.x0 + self.cell * np.arange(self.state.shape[1])

    @property
    def y(self) -> np.ndarray:
        return self.y0 + self.cell * np.arange(self.state.shape[0])


def make_soil_ground(
    heights: np.ndarray, cell: float, x0: float = 0.0, y0: float = 0.0, rock: np.ndarray | None = None
) -> SoilGround:
    """Return undisturbed ground with levels `heights` (rows, columns), m; rows run along +y, columns along +x.

    `rock` (rows, columns) marks nodes below a rock's surface, where the rock carries the load, not the soil.
    """
    if heights.ndim != 2 or min(heights.shape) < 2 or not np.isfinite(heights).all():
        raise RoverError(f"heights of shape {heights.shape}, expected at least 2 x 2 finite values")
    state = np.zeros((*heights.shape, FIELDS))
    for field in (ORIGINAL, START, LEVEL):
        state[..., field] = heights
    along_y, along_x = np.gradient(heights, cell)
    normals = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    owner = np.full(heights.shape, FREE, np.int32)
    if rock is not None:
        owner[rock] = ROCK
    return SoilGround(float(x0), float(y0), float(cell), state, normals, owner)
