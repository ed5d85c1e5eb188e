"""Outlines of rocks: the few points of a mesh that determine its box in a photo, and points of its foot."""

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

RIM_SECTORS = 24  # number of sectors with a rim point, the lowest outer vertex
OUTER_SHARE = 0.75  # of the half sides of a rock's cuboid; its foot is farther out
EDGES = 4  # left, top, right, bottom edge of a box
# Scanned rocks have skirts of sand that people do not annotate: left and right edges are computed from vertices this
# far above the rim, metres, or above this share of the rock's height, whichever is lower.
TRIM, TRIM_SHARE = 0.004, 0.35


@dataclass(frozen=True)
class Outlines:
    """Points (m, k, 3) of m rocks in the sandbox, padded by repetition.

    `whole` determines the top and bottom edges of a rock's box, `upper` the left and right edges: scanned meshes have a
    skirt of sand at their foot, which people do not annotate.
    """

    rocks: np.ndarray  # (m,) ids
    whole: np.ndarray
    upper: np.ndarray

    def __len__(self) -> int:
        return len(self.rocks)

    @cached_property
    def centres(self) -> np.ndarray:
        """Centres (m, 3) of the rocks' extents."""
        return np.asarray((self.whole.min(axis=1) + self.whole.max(axis=1)) / 2)

    def part(self, rows: np.ndarray) -> Outlines:
        """Select rocks by index or mask."""
        return Outlines(self.rocks[rows], self.whole[rows], self.upper[rows])

    def thinned(self, directions: int) -> Outlines:
        """Reduce each rock to its outermost points in at most `directions` directions, spread over the sphere."""
        spread = spread_directions(directions)
        return Outlines(self.rocks, _furthest(self.whole, spread), _furthest(self.upper, spread))

    def project(self, camera: Camera) -> np.ndarray:
        """Return boxes (m, 4) in pixels, not clipped; NaN for rocks with points of negative depth."""
        return self.edges(camera)[0]

    def seen(self, camera: Camera) -> np.ndarray:
        """Return boxes (m, 4) clipped at the image border."""
        return clip(self.project(camera), *camera.size)

    def edges(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return boxes (m, 4), and the points (m, 4, 3) that define their left, top, right and bottom edges."""
        u, v = camera.project(self.upper)[..., 0], camera.project(self.whole)[..., 1]
        row = np.arange(len(self))
        makers = (u.argmin(axis=1), v.argmin(axis=1), u.argmax(axis=1), v.argmax(axis=1))
        boxes = np.stack([u[row, makers[0]], v[row, makers[1]], u[row, makers[2]], v[row, makers[3]]], axis=1)
        points = [(self.upper, self.whole)[edge % 2][row, makers[edge]] for edge in range(EDGES)]
        return boxes, np.stack(points, axis=1)


def rock_outline(mesh: Mesh, trim: float, trim_share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) and (k, 3) that determine a rock's box: of the entire rock, and of the part above its skirt.

    `trim`: height of the upper part above the plane through the rock's rim, metres.
    `trim_share`: maximum height of the lower end of the upper part, share of the rock's height.
    """
    vertices = largest_island(mesh).vertices
    bottom, top = vertices[:, 2].min(), vertices[:, 2].max()
    limit = np.minimum(_rim_height(vertices) + trim, bottom + trim_share * (top - bottom))
    return hull_corners(vertices), hull_corners(vertices[vertices[:, 2] > limit])


def outlines_of(meshes: dict[int, Mesh], trim: float = TRIM, trim_share: float = TRIM_SHARE) -> Outlines:
    """Return the outlines of meshes by rock id."""
    if not meshes:
        return Outlines(np.zeros(0, int), np.zeros((0, 1, 3)), np.zeros((0, 1, 3)))
    parts = [rock_outline(mesh, trim, trim_share) for mesh in meshes.values()]
    whole, upper = _filled([full for full, _ in parts]), _filled([up for _, up in parts])
    return Outlines(np.array(list(meshes), int), whole, upper)


def hull_corners(points: np.ndarray) -> np.ndarray:
    """Return the corners (k, 3) of the convex hull; all points if the hull has no volume."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        return points


def spread_directions(count: int) -> np.ndarray:
    """Return unit vectors (count, 3) spread evenly over the sphere (Fibonacci lattice)."""
    step = np.arange(count) + 0.5
    z, angle = 1 - 2 * step / count, np.pi * (1 + np.sqrt(5)) * step
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def rim(mesh: Mesh) -> np.ndarray:
    """Return points (n, 3) of a rock's foot, where it touches the ground: the lowest outer vertex of each sector.

    Single low vertices are outliers: heights are medians over three neighbouring sectors.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    offset = (mesh.vertices - (low + high) / 2)[:, :2] / np.maximum((high - low)[:2] / 2, 1e-9)
    outer = np.flatnonzero(np.abs(offset).max(axis=1) > OUTER_SHARE)
    angle = np.arctan2(offset[outer, 1], offset[outer, 0]) / (2 * np.pi) + 0.5
    sector = (angle * RIM_SECTORS).astype(int) % RIM_SECTORS
    order = outer[np.lexsort((mesh.vertices[outer, 2], sector))]
    first = np.unique(np.sort(sector), return_index=True)[1]
    points = mesh.vertices[order[first]].copy()
    points[:, 2] = np.median([np.roll(points[:, 2], step) for step in (-1, 0, 1)], axis=0)
    return points


def _rim_height(vertices: np.ndarray) -> np.ndarray:
    """Return the height (n,) of the plane through the rock's rim at each vertex, by a robust fit to its rim points."""
    low, high = vertices[:, :2].min(axis=0), vertices[:, :2].max(axis=0)
    share = (2 * vertices[:, :2] - low - high) / np.maximum(high - low, 1e-9)  # -1 to 1 over the rock's extent
    outer = np.flatnonzero(np.abs(share).max(axis=1) > OUTER_SHARE)
    sector = np.floor((np.arctan2(share[outer, 1], share[outer, 0]) / (2 * np.pi) + 0.5) * RIM_SECTORS).astype(int)
    order = np.lexsort((vertices[outer, 2], sector))
    _, first = np.unique(sector[order], return_index=True)
    plane = robust_plane(vertices[outer[order[first]]], scale=0.003)
    return np.asarray(vertices[:, :2] @ plane[:2] + plane[2])


def _furthest(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Return the outermost (m, d, 3) of points (m, k, 3) in directions (d, 3)."""
    furthest = np.argmax(points @ directions.T, axis=1)
    return np.asarray(np.take_along_axis(points, furthest[..., None], axis=1))


def _filled(groups: list[np.ndarray]) -> np.ndarray:
    """Return groups of points (k_i, 3) as an array (m, max k, 3), padded by repetition."""
    longest = max(len(group) for group in groups)
    return np.stack([group[np.minimum(np.arange(longest), len(group) - 1)] for group in groups])
