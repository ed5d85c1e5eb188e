"""What of a rock's mesh shapes its box in a photo: few points instead of thousands of vertices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from polarsim.geometry.boxes import clip
from polarsim.geometry.camera import Camera
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.planes import robust_plane
from polarsim.geometry.topology import largest_island

RIM_SECTORS = 24  # the rim is the lowest outer vertex in each of these
EDGES = 4  # of a box: left, top, right, bottom
# Scanned rocks carry skirts of sand that people do not draw: left and right edges come from vertices this far above the
# rim, metres, but never from above this share of the rock's height.
TRIM, TRIM_SHARE = 0.004, 0.35


@dataclass(frozen=True)
class Outlines:
    """Points (m, k, 3) of m rocks in the sandbox, filled up by repetition.

    `whole` gives the top and bottom edges of a rock's box, `upper` the left and right ones: scans carry a skirt of
    sand that widens meshes at their foot, and people do not draw it.
    """

    rocks: np.ndarray  # (m,) ids
    whole: np.ndarray
    upper: np.ndarray

    def __len__(self) -> int:
        return len(self.rocks)

    @cached_property
    def centres(self) -> np.ndarray:
        """(m, 3) centres of the rocks' extents."""
        return np.asarray((self.whole.min(axis=1) + self.whole.max(axis=1)) / 2)

    def part(self, rows: np.ndarray) -> Outlines:
        """Some of the rocks, by number or mask."""
        return Outlines(self.rocks[rows], self.whole[rows], self.upper[rows])

    def thinned(self, directions: int) -> Outlines:
        """The same with at most so many points a rock: those furthest out in directions spread over the sphere."""
        spread = spread_directions(directions)
        return Outlines(self.rocks, _furthest(self.whole, spread), _furthest(self.upper, spread))

    def project(self, camera: Camera) -> np.ndarray:
        """(m, 4) boxes in pixels, not cut at the photo's border; NaN for rocks that reach behind the camera."""
        return self.edges(camera)[0]

    def seen(self, camera: Camera) -> np.ndarray:
        """(m, 4) the same boxes cut at the photo's border."""
        return clip(self.project(camera), *camera.size)

    def edges(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """The boxes (m, 4), and the points (m, 4, 3) that make their left, top, right and bottom edges."""
        u, v = camera.project(self.upper)[..., 0], camera.project(self.whole)[..., 1]
        row = np.arange(len(self))
        makers = (u.argmin(axis=1), v.argmin(axis=1), u.argmax(axis=1), v.argmax(axis=1))
        boxes = np.stack([u[row, makers[0]], v[row, makers[1]], u[row, makers[2]], v[row, makers[3]]], axis=1)
        points = [(self.upper, self.whole)[edge % 2][row, makers[edge]] for edge in range(EDGES)]
        return boxes, np.stack(points, axis=1)


def outline(mesh: Mesh, trim: float, trim_share: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) and (k, 3) of a rock that shape its box: of the whole rock, and of what stands above its skirt.

    Parameters
    ----------
    trim : float
        Metres above the plane through the rock's rim at which the upper part begins.
    trim_share : float
        The upper part begins below this part of the rock's height in any case.
    """
    vertices = largest_island(mesh).vertices
    bottom, top = vertices[:, 2].min(), vertices[:, 2].max()
    limit = np.minimum(_rim_height(vertices) + trim, bottom + trim_share * (top - bottom))
    return hull_points(vertices), hull_points(vertices[vertices[:, 2] > limit])


def outlines_of(meshes: dict[int, Mesh], trim: float = TRIM, trim_share: float = TRIM_SHARE) -> Outlines:
    """Outlines of meshes by rock id; none for no meshes."""
    if not meshes:
        return Outlines(np.zeros(0, int), np.zeros((0, 1, 3)), np.zeros((0, 1, 3)))
    parts = [outline(mesh, trim, trim_share) for mesh in meshes.values()]
    whole, upper = _filled([full for full, _ in parts]), _filled([up for _, up in parts])
    return Outlines(np.array(list(meshes), int), whole, upper)


def hull_points(points: np.ndarray) -> np.ndarray:
    """(k, 3) corners of the convex hull; all points where there is no solid hull."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points


def spread_directions(count: int) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the sphere (Fibonacci lattice)."""
    step = np.arange(count) + 0.5
    z, angle = 1 - 2 * step / count, np.pi * (1 + np.sqrt(5)) * step
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _rim_height(vertices: np.ndarray) -> np.ndarray:
    """(n,) height of the plane through the rock's rim at each vertex: a robust fit to its lowest outer vertices."""
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    share = (2 * vertices[:, :2] - low - high) / np.maximum(high - low, 1e-9)  # -1 to 1 over the rock's extent
    outer = np.flatnonzero(np.abs(share).max(axis=1) > 0.75)
    sector = np.floor((np.arctan2(share[outer, 1], share[outer, 0]) / (2 * np.pi) + 0.5) * RIM_SECTORS).astype(int)
    order = np.lexsort((vertices[outer, 2], sector))
    _, first = np.unique(sector[order], return_index=True)
    rim = vertices[outer[order[first]]]
    plane = robust_plane(rim, scale=0.003)
    return np.asarray(vertices[:, :2] @ plane[:2] + plane[2])


def _furthest(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(m, d, 3) of points (m, k, 3)."""
    furthest = np.argmax(points @ directions.T, axis=1)
    return np.asarray(np.take_along_axis(points, furthest[..., None], axis=1))


def _filled(groups: list[np.ndarray]) -> np.ndarray:
    """Groups of points (k_i, 3) as one (m, max k, 3) array."""
    longest = max(len(group) for group in groups)
    return np.stack([group[np.minimum(np.arange(longest), len(group) - 1)] for group in groups])
