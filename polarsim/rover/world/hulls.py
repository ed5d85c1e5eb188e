"""Convex parts of rocks for MuJoCo's collision detection, and the soil nodes under rocks.

A convex hull fills hollows. `convex_parts` cuts a rock until the surface of the parts that is open to the sky deviates
from the mesh by at most `DEVIATION_M` at points `STEP_M` apart. The distance to a surface changes no faster than the
position, so between these points it exceeds the bound by less than `STEP_M / sqrt(3)`. The deviation may be larger if a
rock would need more than `MAX_PARTS` parts, or if cut triangles have no volume: see `RockPart.deviation_m`. A drive
records the maximum.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial import ConvexHull, KDTree, QhullError

from polarsim.errors import RoverError
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.rover.world.surface import World

DEVIATION_M = 0.010  # m; a part with a larger deviation from the mesh is cut in two
MAX_PARTS = 64  # maximum number of convex parts of a rock
STEP_M = 0.006  # spacing of points on a part's surface
MIN_VOLUME_M3 = 1e-8  # m3, a cube of 2 mm; minimum volume of a rock
ABOVE = 1.0  # m above a surface at which vertical rays start
_MESH_STEP_M = 0.005  # spacing of points of the mesh for distances: at most 0.4 mm too long at 10 mm
_OFF_M = 1e-4  # offset from a surface at which rays start
_ENOUGH = 0.7  # a cut with at most this share of the deviation is accepted without trying other axes
_INSIDE = (0.2, 0.8)  # range of cuts as shares of a part's extent


@dataclass(frozen=True)
class RockPart:
    """A convex part of a rock."""

    rock: int  # number of the rock in the world
    corners: np.ndarray  # (n, 3) m
    deviation_m: float  # maximum distance of the part's upper surface from the mesh


def rock_parts(world: World) -> list[RockPart]:
    """Return the convex parts of all rocks on the grid, rock by rock; a rock without volume is an error."""
    result = []
    for row in world.rocks_on_grid.to_dict("records"):
        rock = int(row["rock"])
        try:
            parts = convex_parts(*world.rock_mesh(rock))
        except RoverError as error:
            raise RoverError(f"terrain {row['terrain']}, rock {row['rock_in_terrain']}: {error}") from error
        result += [RockPart(rock, corners, deviation) for corners, deviation in parts]
    return result


def convex_parts(
    vertices: np.ndarray, faces: np.ndarray, deviation_m: float = DEVIATION_M, max_parts: int = MAX_PARTS
) -> tuple[tuple[np.ndarray, float], ...]:
    """Return corners (n, 3) of convex parts of a mesh, and each part's deviation from the mesh, m.

    `max_parts` takes precedence over `deviation_m`, the maximum distance of the upper surface from the mesh.
    """
    vertices, faces = np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)
    return _convex_parts(vertices.tobytes(), faces.tobytes(), deviation_m, max_parts)


@lru_cache(maxsize=512)  # episodes of a world start with the same rocks
def _convex_parts(
    vertices: bytes, faces: bytes, deviation_m: float, max_parts: int
) -> tuple[tuple[np.ndarray, float], ...]:
    rock = _Rock(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int64).reshape(-1, 3), deviation_m)
    open_parts = [rock.part(np.arange(len(rock.faces)))]
    final: list[_Part] = []
    while open_parts and len(open_parts) + len(final) < max_parts:
        worst = max(range(len(open_parts)), key=lambda number: open_parts[number].deviation)
        if open_parts[worst].deviation <= deviation_m:
            break
        halves = rock.halves(open_parts[worst])
        if halves is None:
            final.append(open_parts.pop(worst))
        else:
            open_parts[worst : worst + 1] = halves
    return tuple((part.corners, part.deviation) for part in [*open_parts, *final])


@dataclass(frozen=True)
class _Part:
    triangles: np.ndarray  # (t,) indices of the rock's faces
    corners: np.ndarray  # (n, 3)
    deviation: float  # m
    farthest: np.ndarray  # (3,) point with the largest deviation


class _Rock:
    """A mesh with distance queries."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, bound: float) -> None:
        self.vertices, self.faces, self._bound = vertices, faces, bound
        self._centres = vertices[faces].mean(axis=1)
        self._caster = EmbreeCaster(vertices, faces)

    def part(self, triangles: np.ndarray) -> _Part:
        """Return the hull of some triangles; triangles without volume are an error."""
        points = self.vertices[np.unique(self.faces[triangles])]
        hull = require_volume(points)
        corners = points[np.sort(hull.vertices)]
        up = hull.equations[:, 2] > 0
        on_hull, facet = points_on(points[hull.simplices[up]], STEP_M)
        deviation, farthest = self._deviation(on_hull, hull.equations[up, :3][facet])
        return _Part(triangles, corners, deviation, farthest)

    def halves(self, part: _Part) -> list[_Part] | None:
        """Cut a part at its largest deviation, across the axis with the best result; return None if it cannot be cut.

        A triangle belongs to the side of its centre, so the parts overlap by a triangle at the cut.
        """
        best: list[_Part] | None = None
        for axis, cut in self._cuts(part):
            below = self._centres[part.triangles, axis] < cut
            try:
                halves = [self.part(part.triangles[side]) for side in (below, ~below)]
            except RoverError:  # a side has no volume
                continue
            best = min(best or halves, halves, key=_worst)
            if _worst(best) <= _ENOUGH * part.deviation:
                break
        return best

    def _cuts(self, part: _Part) -> Iterator[tuple[int, float]]:
        """Yield axes and coordinates to cut at, in descending order of extent; medians last."""
        low, high = part.corners.min(axis=0), part.corners.max(axis=0)
        axes = np.argsort(low - high)
        for axis in axes:
            inner = low[axis] + np.array(_INSIDE) * (high - low)[axis]
            yield int(axis), float(np.clip(part.farthest[axis], *inner))
        for axis in axes:
            yield int(axis), float(np.median(self._centres[part.triangles, axis]))

    def _deviation(self, points: np.ndarray, normals: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the maximum distance of points (n, 3) of a hull to the mesh, 0 within the bound, and its point.

        Points below the mesh are excluded, since wheels cannot reach them.
        """
        # The distance against the normal is an upper bound of the distance to the nearest point, and fast to compute.
        against, _ = self._caster.nearest(points + _OFF_M * normals, -normals)
        points = points[against > self._bound + _OFF_M]
        if len(points):
            upwards = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
            points = points[np.isinf(self._caster.nearest(points + _OFF_M * upwards, upwards)[0])]
        if not len(points):
            return 0.0, np.zeros(3)
        distance = np.asarray(self._tree.query(points)[0])
        return float(distance.max()), points[distance.argmax()]

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(np.unique(points_on(self.vertices[self.faces], _MESH_STEP_M)[0].round(5), axis=0))


def _worst(parts: Sequence[_Part]) -> float:
    return max(part.deviation for part in parts)


def points_on(triangles: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) on triangles (t, 3, 3), at most `step` apart along edges, and (n,) their triangles."""
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    counts = np.maximum(np.ceil(longest / step).astype(int), 1)
    points, owners = [np.zeros((0, 3))], [np.zeros(0, int)]
    for count in np.unique(counts):
        rows = np.flatnonzero(counts == count)
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        weights = np.stack([i[inside], j[inside], count - i[inside] - j[inside]], axis=1) / count
        points.append(np.einsum("pk,fkd->fpd", weights, triangles[rows]).reshape(-1, 3))
        owners.append(np.repeat(rows, len(weights)))
    return np.concatenate(points), np.concatenate(owners)


def require_volume(points: np.ndarray) -> ConvexHull:
    """Return the hull of points (n, 3); coplanar and nearly coplanar points are an error."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise RoverError(f"a rock's mesh of {len(points)} corners has no volume") from error
    if hull.volume < MIN_VOLUME_M3:
        raise RoverError(f"a rock's mesh of {1e9 * hull.volume:.3g} mm3 has no volume")
    return hull


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
