"""What is really to be seen: the pixels of every rock and of its shadow, in every view and under every lamp."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage

from polarsim.analog.light import SURFACE_OFFSET, Lamp
from polarsim.analog.rays import Caster, rays_from
from polarsim.analog.sandbox import GROUND_OBJECT, Scene
from polarsim.analog.view import GBuffer
from polarsim.photo import HEIGHT, WIDTH

LEAST_PIXELS = 12  # smaller regions are not labelled
_FULLY_LIT = 0.95
_RIM = 3  # px: parts of a shadow thinner than this are not seen as shadow
_CRUMB = 0.1  # of the largest part: smaller ones neither
_RING = 0.3  # width of the surroundings that a region is compared with, in box sizes


@dataclass(frozen=True)
class Region:
    """The visible pixels of one thing: its tight box and the mask inside it."""

    rock: int
    box: tuple[int, int, int, int]  # x0, y0, x1, y1 in px; the far edges excluded
    mask: np.ndarray  # (y1 - y0, x1 - x0) bool

    @property
    def pixels(self) -> int:
        return int(self.mask.sum())

    @cached_property
    def width_px(self) -> int:
        """Side of the largest square of pixels about one of them that lies in the region: 1 for a line, px."""
        return 2 * int(ndimage.distance_transform_cdt(np.pad(self.mask, 1), "chessboard").max()) - 1

    def inside(self, picture: np.ndarray) -> np.ndarray:
        """The picture's values at the region's pixels."""
        x0, y0, x1, y1 = self.box
        return picture[y0:y1, x0:x1][self.mask]


def rock_regions(view: GBuffer) -> list[Region]:
    """The rocks of a view with at least `LEAST_PIXELS` visible pixels, lit or not."""
    rows, columns = np.nonzero(view.objects > 0)
    rock = view.objects[rows, columns]
    return [found for k in np.unique(rock) for found in _region(rows[rock == k], columns[rock == k], k)]


def shadow_regions(
    scene: Scene, caster: Caster, rock_caster: Caster | None, view: GBuffer, lamp: Lamp, seen: np.ndarray, threads: int
) -> list[Region]:
    """Cast shadows on the ground by rock: visible sand whose light a rock blocks, and nothing but rocks.

    Rims of a pixel or two along a rock's foot and small components apart from the rest are left out: people do not
    box them. Where two rocks block the same light the pixel belongs to both shadows. The lamp counts as a point, its
    centre; `seen` (h, w) is the share of it that each pixel sees.
    """
    if rock_caster is None:
        return []
    rows, columns = np.nonzero((view.objects == GROUND_OBJECT) & (seen < _FULLY_LIT))
    start = view.points[rows, columns] + SURFACE_OFFSET * view.normals[rows, columns]
    rays = rays_from(start, lamp.position.astype(np.float32) - start)
    found = rock_caster.first_hits(rays, threads)
    behind = found["t_hit"] < 1
    rows, columns, rays = rows[behind], columns[behind], rays[behind]
    if not len(rows):
        return []
    ray, face = caster.all_hits(rays, threads)
    rock = scene.object_of_face[face]
    other = np.zeros(len(rows), bool)
    other[ray[rock <= 0]] = True
    good = (rock > 0) & ~other[ray]
    regions = []
    for number in np.unique(rock[good]):
        mine = np.unique(ray[good & (rock == number)])
        for whole in _region(rows[mine], columns[mine], number):
            y, x = np.nonzero(_without_rims(whole.mask))
            regions += _region(y + whole.box[1], x + whole.box[0], number)
    return regions


def _without_rims(mask: np.ndarray) -> np.ndarray:
    """A shadow's mask (h, w) without what nobody sees as part of it: lines at the rock's foot, far small components."""
    solid = ndimage.binary_opening(np.pad(mask, _RIM), np.ones((_RIM, _RIM), bool))
    if not solid.any():
        return mask
    parts, count = ndimage.label(solid, np.ones((3, 3), bool))
    sizes = ndimage.sum_labels(solid, parts, np.arange(1, count + 1))
    large = np.isin(parts, 1 + np.flatnonzero(sizes >= _CRUMB * sizes.max()))
    tips = ndimage.binary_dilation(large, np.ones((2 * _RIM + 1, 2 * _RIM + 1), bool))[_RIM:-_RIM, _RIM:-_RIM]
    return np.asarray(mask & tips)


def _region(rows: np.ndarray, columns: np.ndarray, rock: int) -> list[Region]:
    """The region of some pixels, if they are enough."""
    if len(rows) < LEAST_PIXELS:
        return []
    box = (int(columns.min()), int(rows.min()), int(columns.max()) + 1, int(rows.max()) + 1)
    mask = np.zeros((box[3] - box[1], box[2] - box[0]), bool)
    mask[rows - box[1], columns - box[0]] = True
    return [Region(int(rock), box, mask)]


def contrast(region: Region, photo: np.ndarray) -> float:
    """Mean of a region in a photo less the mean of what surrounds it, DN."""
    return float(region.inside(photo).astype(np.float32).mean()) - surroundings(region, photo)


def surroundings(region: Region, photo: np.ndarray) -> float:
    """Mean of what surrounds a region in a photo, DN."""
    x0, y0, x1, y1 = region.box
    dx, dy = max(3, round(_RING * (x1 - x0))), max(3, round(_RING * (y1 - y0)))
    left, top, right, bottom = max(0, x0 - dx), max(0, y0 - dy), min(WIDTH, x1 + dx), min(HEIGHT, y1 + dy)
    window = photo[top:bottom, left:right].astype(np.float32)
    around = np.ones(window.shape, bool)
    around[y0 - top : y1 - top, x0 - left : x1 - left] &= ~region.mask
    return float(window[around].mean()) if around.any() else 0.0
