"""Masks of labels: shapes from an image of ids, stretched to the box of the label."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.formats import rle
from polarsim.geometry.boxes import box_of_mask, iou
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.masks import windows_of, without_small_components
from polarsim.geometry.polygons import outlines
from polarsim.labels.casting import VisibleIds
from polarsim.photo import photo_scale

MIN_BOX_IOU = 0.2  # minimum IoU of the box of a shape with the box of the label to use the shape
SIMPLIFY_PX = 0.6  # maximum distance of a removed corner from the simplified outline
SMALL_REGION = 400  # minimum area of a polygon of ground or background, px of a photo of the reference width
THIN_PX = 2  # minimum width of such a polygon


@dataclass(frozen=True)
class MaskShape:
    """Mask (h, w) with the position (left, top) of the first pixel in an image."""

    mask: np.ndarray
    left: int
    top: int

    @property
    def box(self) -> np.ndarray:
        """Bounding box (4,) of the mask in the image."""
        box = box_of_mask(self.mask)
        assert box is not None
        return box + np.tile([self.left, self.top], 2)

    @property
    def window(self) -> tuple[slice, slice]:
        """Slices of the image covered by the mask array."""
        height, width = self.mask.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    def runs(self, size: tuple[int, int]) -> rle.Rle:
        """Return the run-length encoding in a photo (width, height) that contains the mask."""
        return rle.encode_rle(self.mask, size, self.left, self.top)

    def rings(self) -> list[np.ndarray]:
        """Return the outlines (n, 2) in image coordinates, largest first."""
        offset = np.array([self.left, self.top], float)
        return [ring + offset for ring in outlines(self.mask, SIMPLIFY_PX)]

    def cut(self, width: int, height: int) -> MaskShape:
        """Return the part inside an image."""
        left, top = max(0, -self.left), max(0, -self.top)
        mask = self.mask[top : max(0, height - self.top), left : max(0, width - self.left)]
        return MaskShape(mask, self.left + left, self.top + top)


def mask_shapes(ids: np.ndarray) -> dict[int, MaskShape]:
    """Return the shape of each rock in an image of ids (h, w), without holes and small components."""
    return {
        rock: _trimmed(
            MaskShape(_filled(without_small_components(ids[rows, columns] == rock)), columns.start, rows.start)
        )
        for rock, (rows, columns) in windows_of(ids).items()
    }


def fit_shape(shape: MaskShape | None, box: np.ndarray, own_share: float = 0.0) -> MaskShape:
    """Stretch a shape to the box of a label; return a rounded box if the shape is missing or does not overlap.

    `own_share` interpolates the target box between the box of the label (0) and the box of the shape (1).
    """
    if shape is None or iou(shape.box[None], box[None])[0, 0] < MIN_BOX_IOU:
        return superellipse(box)
    return stretch_shape(shape, own_share * shape.box + (1 - own_share) * box)


def convex_shape(shape: MaskShape) -> MaskShape:
    """Return the convex hull."""
    import cv2

    rows, columns = np.nonzero(shape.mask)
    corners = cv2.convexHull(np.stack([columns, rows], axis=1).astype(np.int32))
    hull = cv2.fillConvexPoly(np.zeros(shape.mask.shape, np.uint8), corners, 1) > 0
    return MaskShape(hull, shape.left, shape.top)


def stretch_shape(shape: MaskShape, box: np.ndarray) -> MaskShape:
    """Return the shape with the bounding box mapped to `box` (4,)."""
    source, x, y = shape.box, *_pixel_centres(box)
    column = source[0] + (x - box[0]) / (box[2] - box[0]) * (source[2] - source[0]) - shape.left
    row = source[1] + (y - box[1]) / (box[3] - box[1]) * (source[3] - source[1]) - shape.top
    column = np.clip(np.floor(column).astype(int), 0, shape.mask.shape[1] - 1)
    row = np.clip(np.floor(row).astype(int), 0, shape.mask.shape[0] - 1)
    inside = ((y > box[1]) & (y < box[3]))[:, None] & ((x > box[0]) & (x < box[2]))
    return MaskShape(shape.mask[np.ix_(row, column)] & inside, int(x[0] - HALF_PIXEL), int(y[0] - HALF_PIXEL))


def superellipse(box: np.ndarray, power: float = 2.5) -> MaskShape:
    """Return the superellipse that fills a box (4,), for objects of unknown shape."""
    x, y = _pixel_centres(box)
    across = np.abs((2 * x - box[0] - box[2]) / (box[2] - box[0])) ** power
    down = np.abs((2 * y - box[1] - box[3]) / (box[3] - box[1])) ** power
    return MaskShape(down[:, None] + across <= 1, int(x[0] - HALF_PIXEL), int(y[0] - HALF_PIXEL))


def visible_parts(shapes: Sequence[MaskShape], width: int, height: int) -> list[MaskShape | None]:
    """Return the visible parts, without small components, of shapes painted in order; None if fully hidden."""
    painted = np.full((height, width), -1, np.int16)
    inside = [shape.cut(width, height) for shape in shapes]
    for number, shape in enumerate(inside):
        painted[shape.window][shape.mask] = number
    visible_masks = [(shape, painted[shape.window] == number) for number, shape in enumerate(inside)]
    return [
        MaskShape(without_small_components(mask), shape.left, shape.top) if mask.any() else None
        for shape, mask in visible_masks
    ]


def _filled(mask: np.ndarray) -> np.ndarray:
    import cv2

    lines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(np.zeros(mask.shape, np.uint8), lines, -1, 1, cv2.FILLED) > 0


def _trimmed(shape: MaskShape) -> MaskShape:
    left, top, right, bottom = (shape.box - np.tile([shape.left, shape.top], 2)).astype(int)
    return MaskShape(shape.mask[top:bottom, left:right], shape.left + left, shape.top + top)


def _pixel_centres(box: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    left, top = np.floor(box[:2]).astype(int)
    right, bottom = np.maximum(np.ceil(box[2:]).astype(int), [left + 1, top + 1])
    return np.arange(left, right) + HALF_PIXEL, np.arange(top, bottom) + HALF_PIXEL


def backdrop(ids: VisibleIds) -> list[tuple[str, np.ndarray]]:
    """Return rings (n, 2) of background and ground, which includes rocks and shadows; `ids` has a ray per pixel."""
    import cv2

    ground = np.zeros(ids.shape, np.uint8)
    hit = ids.hit.astype(np.uint8)
    lines, _ = cv2.findContours(hit, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    smallest = SMALL_REGION * photo_scale(ids.shape[1]) ** 2
    cv2.drawContours(ground, [line for line in lines if cv2.contourArea(line) >= smallest], -1, 1, cv2.FILLED)
    rings = [
        (name, ring)
        for name, mask in (("background", ground == 0), ("ground", ground == 1))
        for ring in MaskShape(mask, 0, 0).rings()
    ]
    return [(name, ring) for name, ring in rings if np.ptp(ring, axis=0).min() >= THIN_PX]
