"""Heights of meshes at points of the ground, and the soil nodes under rocks."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.rover.world.surface import World

ABOVE = 1.0  # m above a surface at which vertical rays start


def top_at(vertices: np.ndarray, triangles: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return (n,) heights of the highest surface at points (x, y); -inf if there is none."""
    start = float(vertices[:, 2].max()) + ABOVE
    origins = np.stack([x, y, np.full(len(x), start)], axis=1)
    directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    distance, _ = EmbreeCaster(vertices, triangles).nearest(origins, directions)
    return np.asarray(start - distance, float)


def under_rocks(world: World) -> np.ndarray:
    """Return (rows, columns) bool: nodes with rock above the ground, where the rock carries the load."""
    under = np.zeros(world.level.shape, bool)
    for row in world.rocks_on_grid.to_dict("records"):
        vertices, faces = world.rock_mesh(int(row["rock"]))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        columns = slice(*np.searchsorted(world.x, [low[0], high[0]]))
        rows = slice(*np.searchsorted(world.y, [low[1], high[1]]))
        y, x = np.meshgrid(world.y[rows], world.x[columns], indexing="ij")
        if x.size:
            top = top_at(vertices, faces, x.ravel(), y.ravel()).reshape(x.shape)
            under[rows, columns] |= top > world.level[rows, columns]
    return under
