"""Conversion between masks and polygons: rings (n, 2) in pixels, pixel centres at integer + 0.5, without closing point.

Rings of `outlines` are simple and have no holes: a region with a hole is cut in two through it. They run clockwise in
the photo (y down), so that the shoelace sum is positive.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import GREY_VALUES, POLYGON_CLASSES

MAX_CHANGED = 0.01  # maximum share of a region's pixels that a simpler outline may change
NUDGE_PX = np.array([2e-3, -1e-3])  # offset of pixel centres on a line, which the rounding of files would decide
MIN_TOLERANCE_PX = 0.1  # minimum distance, which hardly removes a corner

PAINT_ORDER = tuple(POLYGON_CLASSES.index(name) for name in ("background", "ground", "shadow", "rock"))


def signed_area(ring: np.ndarray) -> float:
    """Return the shoelace area of a ring (n, 2), px^2; positive if it is clockwise in the photo."""
    ring = np.asarray(ring, float)
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)


def outlines(mask: np.ndarray, simplify_px: float = 0.0) -> list[np.ndarray]:
    """Return rings around the true pixels of a mask (h, w), largest first.

    `simplify_px`: maximum distance of a removed point from its ring (Douglas and Peucker, topology kept); less for a
    ring that would gain or lose more than 1 % of its pixels.
    """
    import contourpy

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return []
    top, left = rows[0], columns[0]
    # With a border of one false pixel, marching squares closes every line half way between pixel centres.
    part = np.pad(np.asarray(mask[top : rows[-1] + 1, left : columns[-1] + 1], np.uint8), 1)
    lines = contourpy.contour_generator(z=part, fill_type=contourpy.FillType.OuterOffset).filled(0.5, 1.5)
    rings = []
    for points, offsets in zip(*lines, strict=True):
        parts = [points[a : b - 1] for a, b in pairwise(offsets)]
        rings += _without_holes(parts[0], parts[1:])
    # Index 0 is the centre of the padding, half a pixel before the first corner.
    offset = np.array([left - HALF_PIXEL, top - HALF_PIXEL])
    fewer = [_simplify(ring, simplify_px) for ring in rings]
    rings = [_clockwise(ring + offset) for ring in fewer if ring is not None]
    return sorted(rings, key=lambda ring: (-signed_area(ring), ring[0, 0], ring[0, 1]))


def rasterised(ring: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return a mask (h, w) of the pixels with centres inside a ring (n, 2), by the even-odd rule."""
    mask = np.zeros(shape, bool)
    rows, columns, inside = _fill(np.asarray(ring, float), shape)
    mask[rows, columns] = inside
    return mask


def paint(polygons: Sequence[tuple[int, np.ndarray]], shape: tuple[int, int]) -> np.ndarray:
    """Return a grey map (h, w) uint8 of polygons (class, ring), painted as background, ground, shadow, rock.

    The release's script paints in file order, so that a ground polygon covers earlier rocks.
    """
    return paint_on(np.full(shape, GREY_VALUES["background"], np.uint8), polygons)


def paint_on(below: np.ndarray, polygons: Sequence[tuple[int, np.ndarray]]) -> np.ndarray:
    """Return a copy of a grey map (h, w) with polygons (class, ring), painted in the order of `paint`."""
    grey = below.copy()
    for number in PAINT_ORDER:
        for kind, ring in polygons:
            if kind == number:
                rows, columns, inside = _fill(np.asarray(ring, float), grey.shape)
                grey[rows, columns][inside] = GREY_VALUES[POLYGON_CLASSES[number]]
    return grey


def _fill(ring: np.ndarray, shape: tuple[int, int]) -> tuple[slice, slice, np.ndarray]:
    """Return the part of an image around a ring, and a mask of its pixel centres inside the ring."""
    low = np.clip(np.floor(ring.min(axis=0)).astype(int), 0, [shape[1], shape[0]])
    high = np.clip(np.ceil(ring.max(axis=0)).astype(int), 0, [shape[1], shape[0]])
    width, height = np.maximum(high - low, 0)
    start, end = ring - low, np.roll(ring, -1, axis=0) - low
    upper, lower = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    # Rows with centres that an edge crosses: [first, last).
    first = np.clip(np.ceil(upper - HALF_PIXEL).astype(int), 0, height)
    last = np.clip(np.ceil(lower - HALF_PIXEL).astype(int), 0, height)
    count = np.maximum(last - first, 0)
    edge = np.repeat(np.arange(len(ring)), count)
    row = np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + first[edge]
    along = (row + HALF_PIXEL - start[edge, 1]) / (end[edge, 1] - start[edge, 1])
    crossing = start[edge, 0] + along * (end[edge, 0] - start[edge, 0])
    # The first pixel centre from the crossing to the right.
    column = np.clip(np.ceil(crossing - HALF_PIXEL).astype(int), 0, width)
    odd = np.zeros((height, width + 1), np.uint8)
    np.add.at(odd.ravel(), row * (width + 1) + column, np.uint8(1))
    inside = np.bitwise_xor.accumulate(odd[:, :width] & 1, axis=1).view(bool)
    return slice(low[1], low[1] + height), slice(low[0], low[0] + width), inside


def _without_holes(outer: np.ndarray, holes: list[np.ndarray]) -> list[np.ndarray]:
    """Return rings that together cover a region with holes: cut vertically through each hole, from edge to edge."""
    if not holes:
        return [outer]
    from shapely import Polygon, box

    region = Polygon(outer, holes)
    x0, y0, x1, y1 = region.bounds
    # A quarter pixel off the centre: contour points are at half pixels, and a cut through them could leave slivers.
    cut = np.floor((holes[0][:, 0].min() + holes[0][:, 0].max()) / 2) + 0.25
    rings = []
    for low, high in ((x0 - 1, cut), (cut, x1 + 1)):
        side = region.intersection(box(low, y0 - 1, high, y1 + 1))
        for piece in getattr(side, "geoms", [side]):
            if piece.geom_type == "Polygon" and piece.area > 0:
                exterior, *interiors = (np.asarray(line.coords)[:-1] for line in (piece.exterior, *piece.interiors))
                rings += _without_holes(exterior, interiors)
    return rings


def _simplify(ring: np.ndarray, tolerance: float) -> np.ndarray | None:
    """Return a ring around grid points with fewer corners that encloses nearly the same points; None without points.

    The tolerance is halved until this holds, because the line of thin regions is close to all of their points.
    """
    from shapely import Polygon

    origin = np.floor(ring.min(axis=0)) - HALF_PIXEL  # moves grid points to centres of pixels
    local = ring - origin
    width, height = np.ceil(local.max(axis=0)).astype(int)
    inside = rasterised(local, (height, width))
    if not inside.any():
        return None
    while tolerance >= MIN_TOLERANCE_PX:
        fewer = Polygon(local).simplify(tolerance, preserve_topology=True)
        if fewer.geom_type == "Polygon" and fewer.is_valid:
            corners = np.asarray(fewer.exterior.coords)[:-1]
            nudged = (rasterised(corners + nudge, inside.shape) for nudge in (NUDGE_PX, -NUDGE_PX))
            if max((found ^ inside).sum() for found in nudged) <= MAX_CHANGED * inside.sum():
                return np.asarray(corners + origin)
        tolerance /= 2
    return _without_collinear(ring)


def _without_collinear(ring: np.ndarray) -> np.ndarray:
    """Return a ring without the points on the straight line between their neighbours."""
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return ring[np.abs(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) > 1e-12]


def _clockwise(ring: np.ndarray) -> np.ndarray:
    return ring if signed_area(ring) > 0 else ring[::-1]


def without_thin_parts(mask: np.ndarray, size: int) -> np.ndarray:
    """Return the `thick_parts` (h, w) of a mask, or the mask if it has none."""
    thick = thick_parts(mask, size)
    return thick if thick.any() else mask


def thick_parts(mask: np.ndarray, size: int) -> np.ndarray:
    """Return a mask (h, w) opened by squares of `size` samples, with the tips that this cuts off; it may be empty."""
    import cv2

    if size < 2:
        return mask
    whole = np.zeros((mask.shape[0] + 2 * size, mask.shape[1] + 2 * size), np.uint8)
    whole[size:-size, size:-size] = mask
    opened = cv2.morphologyEx(whole, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    grown = cv2.dilate(opened, np.ones((2 * size + 1, 2 * size + 1), np.uint8)) & whole
    return grown[size:-size, size:-size] > 0
