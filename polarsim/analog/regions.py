"""Visible regions: pixels of every rock and shadow in every view and under every lamp."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from polarsim.analog.light import SURFACE_OFFSET, DiscLamp
from polarsim.analog.rays import RayCaster
from polarsim.analog.sandbox import GROUND_OBJECT, SandboxScene
from polarsim.analog.view import GBuffer
from polarsim.photo import photo_scale

MIN_PIXELS = 12  # regions with fewer pixels are not labelled
_FULLY_LIT = 0.95
_RIM_PX = 3  # parts of a shadow thinner than this in a photo of the reference width are excluded
_CRUMB = 0.1  # share of the largest component: smaller components are excluded
_RING = 0.3  # width of the surroundings of a region for the contrast, in box sizes


@dataclass(frozen=True)
class VisibleRegion:
    """Visible pixels of a rock or shadow: tight box and mask inside the box."""

    rock: int
    box: tuple[int, int, int, int]  # x0, y0, x1, y1 in px; x1 and y1 are exclusive
    mask: np.ndarray  # (y1 - y0, x1 - x0) bool

    @property
    def pixels(self) -> int:
        return int(self.mask.sum())

    @cached_property
    def width_px(self) -> int:
        """Side of the largest square of pixels inside the region with odd side, px; 1 for a line."""
        return 2 * int(ndimage.distance_transform_cdt(np.pad(self.mask, 1), "chessboard").max()) - 1

    def inside(self, image: np.ndarray) -> np.ndarray:
        """Return the values of an image at the pixels of the region."""
        x0, y0, x1, y1 = self.box
        return image[y0:y1, x0:x1][self.mask]


def rock_regions(view: GBuffer) -> list[VisibleRegion]:
    """Return the rocks of a view with at least `MIN_PIXELS` visible pixels, lit or not."""
    rows, columns = np.nonzero(view.objects > 0)
    rock = view.objects[rows, columns]
    return [region for k in np.unique(rock) for region in _region(rows[rock == k], columns[rock == k], k)]


def shadow_regions(
    scene: SandboxScene,
    caster: RayCaster,
    rock_caster: RayCaster | None,
    view: GBuffer,
    lamp: DiscLamp,
    visible: np.ndarray,
) -> list[VisibleRegion]:
    """Return the cast shadows on the ground by rock: visible sand that is shaded by rocks only.

    Thin rims along the base of a rock and small separate components are excluded, because annotators do not include
    them. A pixel shaded by two rocks belongs to both shadows. The lamp is treated as a point; `visible` (h, w) is the
    visible share of the disc.
    """
    if rock_caster is None:
        return []
    rows, columns = np.nonzero((view.objects == GROUND_OBJECT) & (visible < _FULLY_LIT))
    start = view.points[rows, columns] + SURFACE_OFFSET * view.normals[rows, columns]
    to_lamp = lamp.position.astype(np.float32) - start
    shaded = rock_caster.occluded(start, to_lamp)
    rows, columns, start, to_lamp = rows[shaded], columns[shaded], start[shaded], to_lamp[shaded]
    if not len(rows):
        return []
    ray, face = caster.all_hits(start, to_lamp)
    rock = scene.object_of_face[face]
    other = np.zeros(len(rows), bool)
    other[ray[rock <= 0]] = True
    good = (rock > 0) & ~other[ray]
    regions, rim = [], max(1, round(_RIM_PX * photo_scale(view.objects.shape[1])))
    for number in np.unique(rock[good]):
        of_rock = np.unique(ray[good & (rock == number)])
        for region in _region(rows[of_rock], columns[of_rock], number):
            y, x = np.nonzero(_without_rims(region.mask, rim))
            regions += _region(y + region.box[1], x + region.box[0], number)
    return regions


def _without_rims(mask: np.ndarray, rim: int) -> np.ndarray:
    """Return the mask (h, w) of a shadow without small separate components and parts thinner than `rim` pixels."""
    solid = ndimage.binary_opening(np.pad(mask, rim), np.ones((rim, rim), bool))
    if not solid.any():
        return mask
    parts, count = ndimage.label(solid, np.ones((3, 3), bool))
    sizes = ndimage.sum_labels(solid, parts, np.arange(1, count + 1))
    large = np.isin(parts, 1 + np.flatnonzero(sizes >= _CRUMB * sizes.max()))
    tips = ndimage.binary_dilation(large, np.ones((2 * rim + 1, 2 * rim + 1), bool))[rim:-rim, rim:-rim]
    return np.asarray(mask & tips)


def _region(rows: np.ndarray, columns: np.ndarray, rock: int) -> list[VisibleRegion]:
    """Return the region of the given pixels, or an empty list if there are too few pixels."""
    if len(rows) < MIN_PIXELS:
        return []
    box = (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)
    mask = np.zeros((box[3] - box[1], box[2] - box[0]), bool)
    mask[rows - box[1], columns - box[0]] = True
    return [VisibleRegion(int(rock), box, mask)]


def region_contrast(region: VisibleRegion, photo: np.ndarray) -> float:
    """Return the mean of a region in a photo minus the mean of the surroundings, DN."""
    return float(region.inside(photo).astype(np.float32).mean()) - mean_of_surroundings(region, photo)


def mean_of_surroundings(region: VisibleRegion, photo: np.ndarray) -> float:
    """Return the mean of the surroundings of a region in a photo, DN."""
    x0, y0, x1, y1 = region.box
    dx, dy = max(3, round(_RING * (x1 - x0))), max(3, round(_RING * (y1 - y0)))
    height, width = photo.shape
    left, top, right, bottom = max(0, x0 - dx), max(0, y0 - dy), min(width, x1 + dx), min(height, y1 + dy)
    window = photo[top:bottom, left:right].astype(np.float32)
    around = np.ones(window.shape, bool)
    around[y0 - top : y1 - top, x0 - left : x1 - left] &= ~region.mask
    return float(window[around].mean()) if around.any() else 0.0
