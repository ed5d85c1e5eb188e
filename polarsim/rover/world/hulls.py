"""Rocks as convex parts, which is all that MuJoCo collides with, and the soil nodes that lie under them.

A hull fills hollows. How much it does is seen from above, where wheels come from: the mean height by which the hull
stands over the rock, over the hull's outline. That works for open shells too, as scans give them, where a volume does
not. A rock whose hull stands too high is cut across its longest axis, at the centre of its hollow, into two parts with
hulls of their own, the worst part first, until none is too high or there are as many as allowed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from polarsim.errors import RoverError
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.rover.world.surface import World

SAMPLES = 24  # along the longer side of a part, to see its hollow
LEAST_VOLUME = 1e-8  # m3, a cube of 2 mm: less is no rock
ABOVE = 1.0  # m over a surface from which rays look down

HOLLOW_M = 0.01  # a rock is split where its hull stands higher than this above it, on average
MOST_PARTS = 8  # convex parts of a rock


def rock_hulls(world: World, hollow: float = HOLLOW_M, most: int = MOST_PARTS) -> list[np.ndarray]:
    """Corners (n, 3) of the convex parts of all rocks that can be met, m.

    Raises
    ------
    RoverError
        A rock without volume.
    """
    hulls = []
    for row in world.rocks_on_grid.to_dict("records"):
        vertices, faces = world.rock_mesh(int(row["rock"]))
        try:
            hulls += convex_parts(vertices, faces, hollow, most)
        except RoverError as error:
            raise RoverError(f"terrain {row['terrain']}, rock {row['rock_in_terrain']}: {error}") from error
    return hulls


@dataclass(frozen=True)
class _Part:
    triangles: np.ndarray  # (t, 3) of the rock's vertices
    corners: np.ndarray  # (n, 3)
    hollow: float  # m, mean
    cut: float  # coordinate along `axis`
    axis: int


def convex_parts(vertices: np.ndarray, faces: np.ndarray, hollow: float, most: int) -> list[np.ndarray]:
    """Corners (n, 3) of hulls that stand `hollow` over the rock on average, or less, unless `most` are not enough.

    Raises
    ------
    RoverError
        The mesh has no volume.
    """
    parts = [_part(vertices, faces)]
    while len(parts) < most:
        worst = max(range(len(parts)), key=lambda number: parts[number].hollow)
        if parts[worst].hollow <= hollow:
            break
        halves = _split(vertices, parts[worst])
        if halves is None:
            break
        parts[worst : worst + 1] = halves
    return [part.corners for part in parts]


def _split(vertices: np.ndarray, part: _Part) -> list[_Part] | None:
    """A triangle belongs to the side of its centre, so that parts overlap by a triangle at the cut."""
    centres = vertices[part.triangles].mean(axis=1)[:, part.axis]
    halves = []
    for side in (centres < part.cut, centres >= part.cut):
        if side.sum() < 4:
            return None
        try:
            halves.append(_part(vertices, part.triangles[side]))
        except RoverError:  # a flat rest: the whole stays
            return None
    return halves


def require_volume(points: np.ndarray) -> ConvexHull:
    """The hull of points (n, 3).

    Raises
    ------
    RoverError
        They lie in a plane, or nearly.
    """
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise RoverError(f"a rock's mesh of {len(points)} corners has no volume") from error
    if hull.volume < LEAST_VOLUME:
        raise RoverError(f"a rock's mesh of {1e9 * hull.volume:.3g} mm3 has no volume")
    return hull


def _part(vertices: np.ndarray, triangles: np.ndarray) -> _Part:
    points = vertices[np.unique(triangles)]
    hull = require_volume(points)
    corners = points[np.sort(hull.vertices)]
    low, high = corners.min(axis=0), corners.max(axis=0)
    axis = int(np.argmax((high - low)[:2]))
    step = float((high - low)[axis]) / SAMPLES
    x, y = np.meshgrid(np.arange(low[0] + step / 2, high[0], step), np.arange(low[1] + step / 2, high[1], step))
    hull_top = top_at(points, hull.simplices, x.ravel(), y.ravel())
    inside = np.isfinite(hull_top)
    top = top_at(vertices, triangles, x.ravel(), y.ravel())
    # Where the hull roofs ground beside the rock, what is below is the rock's foot.
    gap = np.where(inside, hull_top - np.where(np.isfinite(top), top, low[2]), 0.0)
    gap = np.maximum(gap, 0.0)
    along = (x if axis == 0 else y).ravel()
    cut = float((gap * along).sum() / gap.sum()) if gap.sum() > 0 else float(along.mean())
    cut = float(np.clip(cut, low[axis] + 0.2 * (high - low)[axis], high[axis] - 0.2 * (high - low)[axis]))
    return _Part(triangles, corners, float(gap.sum() / max(inside.sum(), 1)), cut, axis)


def top_at(vertices: np.ndarray, triangles: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(n,) heights of the uppermost surface over points (x, y), -inf where there is none."""
    start = float(vertices[:, 2].max()) + ABOVE
    origins = np.stack([x, y, np.full(len(x), start)], axis=1)
    directions = np.broadcast_to([0.0, 0.0, -1.0], origins.shape)
    distance, _ = EmbreeCaster(vertices, triangles).nearest(origins, directions)
    return np.asarray(start - distance, float)


def under_rocks(world: World) -> np.ndarray:
    """(rows, columns) bool: nodes with rock above the ground, where the rock bears and the soil does not."""
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
