"""Convex parts of rocks for MuJoCo's collision detection.

A convex hull fills hollows. `convex_parts` cuts a rock until the surface of the parts deviates from the mesh by at most
`DEVIATION_M` where the rover can reach it (on top, at the sides, and on moderate overhangs), and then joins adjacent
parts within this bound. The mesh itself is inside the parts, since each of its triangles belongs to a part. While parts
are cut and joined, the deviation is measured where lines from points of the mesh, along its normals, leave the part.
These lines miss the middle of large facets, so the surfaces of the final parts are measured too, and parts are cut
again where necessary. A rock that would need more than `MAX_PARTS` parts has a larger deviation, see
`rock_parts.RockPart`. A drive records the deviation of each rock.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache

import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull, KDTree, QhullError

from polarsim.errors import RoverError
from polarsim.geometry.orientation import outward_signs
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.geometry.topology import is_watertight
from polarsim.geometry.vectors import cross

DEVIATION_M = 0.0045  # m; a part with a larger deviation from the mesh is cut in two
MAX_PARTS = 256  # maximum number of convex parts of a rock
STEP_M = 0.008  # maximum distance of the mesh's points at which deviations are measured
OVERHANG = -0.7  # minimum vertical component of the normal of a surface that the rover can reach
MIN_VOLUME_M3 = 1e-8  # m3, a cube of 2 mm; minimum volume of a rock
_STEPS = 50  # maximum number of these points along a rock; their distance is larger on rocks above 0.4 m
_OFF_M = 1e-4  # smaller distances count as 0
_ENOUGH = 0.85  # a cut with at most this share of the deviation is accepted without trying other axes
_INSIDE = (0.2, 0.8)  # range of cuts as shares of a part's extent
_NEIGHBOURS = 6  # maximum number of adjacent parts with which a part is joined on trial
_BATCH = 128  # number of points whose distances are searched together
_LEVEL = 0.05  # maximum horizontal component of the normal of a surface that is open from above only
_THICKNESS_M = 0.002  # of flat parts
_MIN_PART_M3 = 1e-10  # m3, minimum volume of flat parts with this thickness: a triangle of 0.05 mm2


def convex_parts(
    vertices: np.ndarray, faces: np.ndarray, deviation_m: float = DEVIATION_M, max_parts: int = MAX_PARTS
) -> tuple[tuple[np.ndarray, float], ...]:
    """Return corners (n, 3) of convex parts of a mesh, and each part's deviation from the mesh, m.

    `max_parts` takes precedence over `deviation_m`, the maximum distance of the surface from the mesh.
    """
    vertices, faces = np.ascontiguousarray(vertices, float), np.ascontiguousarray(faces, np.int64)
    return _convex_parts(vertices.tobytes(), faces.tobytes(), deviation_m, max_parts)


@lru_cache(maxsize=512)  # episodes of a world start with the same rocks
def _convex_parts(
    vertices: bytes, faces: bytes, deviation_m: float, max_parts: int
) -> tuple[tuple[np.ndarray, float], ...]:
    rock = _Rock(np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, np.int64).reshape(-1, 3), deviation_m)
    parts = [rock.whole()]
    while len(parts) < max_parts:
        worst = max(range(len(parts)), key=lambda number: parts[number].deviation)
        if parts[worst].deviation <= deviation_m:
            break
        halves = rock.halves(parts[worst])
        if halves is None:
            break
        parts[worst : worst + 1] = halves
    checked = _checked(rock, _merged(rock, parts, deviation_m), max_parts)
    return tuple((part.corners, part.deviation) for part in checked)


def _checked(rock: _Rock, parts: Sequence[_Part], max_parts: int) -> list[_Part]:
    """Measure the surfaces of the parts, and cut parts with a larger deviation than the bound."""
    queue, final = list(parts), list[_Part]()
    while queue:
        part = rock.measured(queue.pop())
        is_full = len(queue) + len(final) + 2 > max_parts
        halves = None if is_full or part.deviation <= rock.bound else rock.halves(part)
        if halves is None:
            final.append(part)
        else:
            queue += halves
    return final


def _merged(rock: _Rock, parts: Sequence[_Part], deviation_m: float) -> list[_Part]:
    """Join adjacent parts, small ones first, where the deviation remains within the bound: cuts make too many parts."""
    queue, final = sorted(parts, key=_extent, reverse=True), []
    while queue:
        part = queue.pop()
        near = sorted((other for other in queue if _overlap(part, other)), key=_extent)
        for other in near[:_NEIGHBOURS]:
            joined = rock.joined(part, other)
            if joined.deviation <= deviation_m:
                queue = [each for each in queue if each is not other]
                insort(queue, joined, key=lambda each: -_extent(each))
                break
        else:
            final.append(part)
    return final


def _extent(part: _Part) -> float:
    return float(np.ptp(part.corners, axis=0).max())


def _overlap(first: _Part, second: _Part) -> bool:
    """Return whether the bounding boxes of two parts overlap."""
    low = np.maximum(first.corners.min(axis=0), second.corners.min(axis=0))
    return bool((low <= np.minimum(first.corners.max(axis=0), second.corners.max(axis=0))).all())


@dataclass(frozen=True)
class _Part:
    triangles: np.ndarray  # (t,) indices of the rock's faces
    corners: np.ndarray  # (n, 3)
    deep: np.ndarray  # (d,) indices of the rock's points that are deeper below the hull than the bound
    deviation: float  # m
    farthest: np.ndarray  # (3,) point of the mesh with the largest deviation


class _Rock:
    """A mesh, the outward normals of its faces, and points on it at which deviations are measured."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, bound: float) -> None:
        self.vertices, self.faces, self.bound = vertices, faces, bound
        triangles = vertices[faces]
        self._centres = triangles.mean(axis=1)
        normals = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        volume = np.einsum("nk,nk->", self._centres, normals)  # six times; negative if all normals are inward
        self._caster = EmbreeCaster(vertices, faces)
        self._sides = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        self._has_holes = not is_watertight(faces)
        if volume <= 0 or self._has_holes:
            self._sides *= outward_signs(self._centres, self._sides, self._caster)[:, None]
        self._step = max(STEP_M, float(np.ptp(vertices, axis=0).max()) / _STEPS)
        large = np.flatnonzero(longest_edges(triangles) > self._step)
        divided, owners = points_on(triangles[large], self._step)
        self._points = np.concatenate([self._centres, divided])
        self._normals = self._sides[np.concatenate([np.arange(len(faces)), large[owners]])]

    def whole(self) -> _Part:
        """Return the hull of the rock."""
        return self._part(np.arange(len(self.faces)), np.arange(len(self._points)), 0.0)

    def joined(self, first: _Part, second: _Part) -> _Part:
        """Return the hull of two parts."""
        corners = np.concatenate([first.corners, second.corners])
        near = np.ones(len(self._points), bool)
        for values, low, high in zip(self._points.T, corners.min(axis=0), corners.max(axis=0), strict=True):
            near &= (values > low) & (values < high)
        return self._part(np.concatenate([first.triangles, second.triangles]), np.flatnonzero(near), 0.0)

    def measured(self, part: _Part) -> _Part:
        """Return a part with the deviation of points on its surface, half a step apart, that the rover can reach.

        Holes of the mesh are filled and therefore excluded: below the surface, a hole shows the inner side of the mesh.
        """
        hull = ConvexHull(part.corners)
        facets = np.flatnonzero(hull.equations[:, 2] > OVERHANG)
        points, owners = points_on(hull.points[hull.simplices[facets]], self._step / 2)
        sides = hull.equations[facets[owners], :3]
        if self._has_holes:
            hits = self._caster.intersect(points + _OFF_M * sides, -sides)
            solid = hits.ray[np.einsum("nk,nk->n", self._sides[hits.face], sides[hits.ray]) > 0]
            points, sides = points[solid], sides[solid]
        points = points[self._reached(points + _OFF_M * sides, sides)]
        if not len(points):
            return part
        distances, nearest = map(np.asarray, self._tree.query(points))
        worst = distances.argmax()
        if distances[worst] <= max(part.deviation, _OFF_M):
            return part
        return replace(part, deviation=float(distances[worst]), farthest=self._tree.data[nearest[worst]])

    def halves(self, part: _Part) -> list[_Part] | None:
        """Cut a part at its largest deviation, across the axis with the best result; return None if it cannot be cut.

        A triangle belongs to the side of its centre, so the parts overlap by a triangle at the cut.
        """
        best: list[_Part] | None = None
        within = min(part.deviation, self.bound)
        for axis, cut in self._cuts(part):
            below = self._centres[part.triangles, axis] < cut
            if below.all() or not below.any():
                continue
            try:
                halves = [self._part(part.triangles[side], part.deep, within) for side in (below, ~below)]
            except RoverError:  # a side is smaller than any part
                continue
            best = min(best or halves, halves, key=_worst)
            if _worst(best) <= _ENOUGH * part.deviation:
                break
        return best

    def _part(self, triangles: np.ndarray, deep: np.ndarray, within: float) -> _Part:
        """Return the hull of some triangles; the hull of flat triangles gets a thickness inwards.

        Points at the indices `deep` are measured, others are at most `within` below the hull: the hull is inside that
        of the part that was cut, so no point becomes deeper.
        """
        used = np.zeros(len(self.vertices), bool)
        used[self.faces[triangles]] = True
        corners = self.vertices[used]
        try:
            hull = require_volume(corners)
        except RoverError:
            inwards = -_THICKNESS_M * self._sides[triangles].mean(axis=0)
            corners = np.concatenate([corners, corners + inwards])
            hull = require_volume(corners, _MIN_PART_M3)
        on_hull = np.zeros(len(corners), bool)
        on_hull[hull.simplices] = True  # `hull.vertices` sorts all corners of all facets
        return _Part(triangles, corners[on_hull], *self._deviation(hull, deep, within))

    def _cuts(self, part: _Part) -> Iterator[tuple[int, float]]:
        """Yield axes and coordinates to cut at, in descending order of extent; medians last."""
        low, high = part.corners.min(axis=0), part.corners.max(axis=0)
        axes = np.argsort(low - high)
        for axis in axes:
            inner = low[axis] + np.array(_INSIDE) * (high - low)[axis]
            yield int(axis), float(np.clip(part.farthest[axis], *inner))
        for axis in axes:
            yield int(axis), float(np.median(self._centres[part.triangles, axis]))

    def _deviation(self, hull: ConvexHull, rows: np.ndarray, within: float) -> tuple[np.ndarray, float, np.ndarray]:
        """Return which of the points at `rows` are deep, the deviation of a hull, and the point with the largest one.

        Lines from the points along the normals leave the hull; the deviation is the maximum distance of the exits from
        the mesh. Exits that the rover cannot reach are excluded: below, and where the rock encloses the exit from above
        and from the side.
        """
        from polarsim.rover.world.hull_kernels import exits  # an optional dependency

        depths, facets = exits(self._points[rows], self._normals[rows], hull.equations)
        far = depths > self.bound  # the mesh is at most as far from an exit as the start of the line
        largest, farthest = max(float(depths[~far].max(initial=0.0)), within), np.zeros(3)
        deep, depths, sides = rows[far], depths[far], hull.equations[facets[far], :3]
        left = self._points[deep] + depths[:, None] * self._normals[deep]
        order = np.argsort(-depths)
        order = order[(sides[order, 2] > OVERHANG) & self._reached(left, sides)[order]]
        while len(order) and largest <= self.bound:  # farther exits first; a part beyond the bound is cut anyway
            batch, order = order[:_BATCH], order[_BATCH:]
            distance = np.asarray(self._tree.query(left[batch])[0])
            if distance.max() > largest:
                largest, farthest = float(distance.max()), self._points[deep[batch[distance.argmax()]]]
            order = order[depths[order] > largest]
        return deep, largest, farthest

    def _reached(self, points: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """Return (n,) bool: points (n, 3) outside the mesh that are open from above or from a side, a normal (n, 3)."""
        if not len(points):
            return np.zeros(0, bool)
        upwards = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
        level = np.linalg.norm(sides[:, :2], axis=1) < _LEVEL
        sidewards = np.where(level[:, None], upwards, sides * [1.0, 1.0, 0.0])
        free = [np.isinf(self._caster.nearest(points, direction)[0]) for direction in (upwards, sidewards)]
        return np.asarray(np.any(free, axis=0))

    @cached_property
    def _tree(self) -> KDTree:
        points = pd.DataFrame(points_on(self.vertices[self.faces], self._step / 4)[0].round(5))
        # Hashing is faster than sorting rows, and an unbalanced tree is faster to build; distances are the same.
        return KDTree(points.drop_duplicates().to_numpy(), balanced_tree=False)


def _worst(parts: Sequence[_Part]) -> float:
    return max(part.deviation for part in parts)


def longest_edges(triangles: np.ndarray) -> np.ndarray:
    """Return (t,) lengths of the longest edges of triangles (t, 3, 3)."""
    return np.asarray(np.linalg.norm(triangles - triangles[:, [2, 0, 1]], axis=2).max(axis=1, initial=0.0))


def points_on(triangles: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) on triangles (t, 3, 3), at most `step` apart along edges, and (n,) their triangles."""
    halvings = np.ceil(np.log2(np.maximum(longest_edges(triangles) / step, 1))).astype(int)
    points, owners = [np.zeros((0, 3))], [np.zeros(0, int)]
    for number in range(halvings.max(initial=-1) + 1):
        rows, weights = np.flatnonzero(halvings == number), _barycentric(2**number)
        points.append((weights @ triangles[rows]).reshape(-1, 3))
        owners.append(np.repeat(rows, len(weights)))
    return np.concatenate(points), np.concatenate(owners)


@cache
def _barycentric(count: int) -> np.ndarray:
    """Return (n, 3) weights of a triangle's corners at points that divide each edge into `count` parts."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
    inside = i + j <= count
    return np.stack([i[inside], j[inside], count - i[inside] - j[inside]], axis=1) / count


def require_volume(points: np.ndarray, least_m3: float = MIN_VOLUME_M3) -> ConvexHull:
    """Return the hull of points (n, 3); coplanar points, and a volume below `least_m3`, are an error."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise RoverError(f"a rock's mesh of {len(points)} corners has no volume") from error
    if hull.volume < least_m3:
        raise RoverError(f"a rock's mesh of {1e9 * hull.volume:.3g} mm3 has no volume")
    return hull
