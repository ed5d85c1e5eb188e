"""Model of a human annotator: which objects are annotated, and the errors of box edges.

The numbers are measured on the published labels: standard deviations (robust and plain) of the edges x0, y0, x1, y1 of
a box, px, by rock size and for shadows, and the share of rocks that are annotated in the left but not the right photo.
Lengths in pixels are those of photos of the reference width; errors are proportional to the width of the photo.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.analog.regions import VisibleRegion, mean_of_surroundings, region_contrast
from polarsim.photo import photo_scale

_SIZES = np.array([25, 35, 50, 80, 120])  # px, upper limits of the size classes except the last
_ROBUST = np.array(
    [[3.4, 1.7, 3.0, 2.6], [3.4, 2.1, 3.4, 2.8], [4.3, 2.1, 4.3, 3.4], [4.3, 2.6, 4.7, 4.3], [5.1, 2.6, 5.1, 5.6],
     [6.6, 3.0, 6.6, 7.7]]
)  # fmt: skip
_FORGOTTEN = np.array([0.068, 0.027, 0.026, 0.004, 0.007, 0.009])
_SHADOW_ROBUST = np.array([5.5, 3.1, 5.4, 3.7])
_SHADOW_TAIL = np.array([12.0, 4.2, 17.0, 6.2])
_SHADOW_FORGOTTEN = 0.05
_TAIL_SHARE, _TAIL_FACTOR = 0.12, 2.2  # share and factor of edges with much larger errors
_SHARE_OF_SIDE = 0.16  # maximum standard deviation over the side of the box
_TINY_PX, _TINY_MISSED = 16, 0.5
_DARK_DN, _DARK_MISSED = 30, 0.7  # regions with lower contrast are missed with this probability


def annotate_rock(region: VisibleRegion, photo: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Return the annotated box (4,) of a rock, integer pixels; None if the rock is missed."""
    x0, y0, x1, y1 = region.box
    scale = photo_scale(photo.shape[1])
    size_class = int(np.searchsorted(_SIZES, np.sqrt((x1 - x0) * (y1 - y0)) / scale))
    chance, tiny, dark = rng.random(3)
    noise = scale * _edge_noise(_ROBUST[size_class], _TAIL_FACTOR * _ROBUST[size_class], rng)
    around = mean_of_surroundings(region, photo)
    low, high = np.percentile(region.inside(photo), [10, 95])
    if max(high - around, around - low) < _DARK_DN and dark < _DARK_MISSED:
        return None
    if (x1 - x0 < scale * _TINY_PX and tiny < _TINY_MISSED) or chance < _FORGOTTEN[size_class]:
        return None
    return _annotated(np.array(region.box, float), noise, photo.shape)


def annotate_shadow(region: VisibleRegion, photo: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Return the annotated box (4,) of the visible part of a shadow; None if the shadow is missed."""
    forgotten = rng.random() < _SHADOW_FORGOTTEN
    noise = photo_scale(photo.shape[1]) * _edge_noise(_SHADOW_ROBUST, _SHADOW_TAIL * 1.8, rng)
    return None if forgotten else _annotated(np.array(region.box, float), noise, photo.shape)


def _edge_noise(robust: np.ndarray, tail: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    in_tail = rng.random(4) < _TAIL_SHARE
    return rng.standard_normal(4) * np.where(in_tail, tail, robust)


def _annotated(box: np.ndarray, noise: np.ndarray, shape: tuple[int, ...]) -> np.ndarray | None:
    sides = np.array([box[2] - box[0], box[3] - box[1]])
    limit = np.tile(np.maximum(_SHARE_OF_SIDE * sides, 1.0), 2) * 2
    edges = np.round(box + np.clip(noise, -limit, limit))
    height, width = shape
    edges = np.clip(edges, 0, [width, height, width, height])
    return edges if (edges[2:] - edges[:2] >= 3).all() else None


def annotate(
    rocks: Sequence[VisibleRegion],
    shadows: Sequence[VisibleRegion],
    photo: np.ndarray,
    rng: np.random.Generator,
    *,
    with_shadows: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the class numbers (n,) and boxes (n, 4), px, of simulated annotations: rocks first, in random order.

    Shadows are annotated only for annotated rocks and only if they are darker than the surrounding sand.
    """
    rock_boxes, annotated = [], set()
    for region in (rocks[index] for index in rng.permutation(len(rocks))):
        box = annotate_rock(region, photo, rng)
        if box is not None:
            rock_boxes.append(box)
            annotated.add(region.rock)
    shadow_boxes = []
    for region in (shadows[index] for index in rng.permutation(len(shadows))):
        box = annotate_shadow(region, photo, rng)
        if with_shadows and box is not None and region.rock in annotated and region_contrast(region, photo) < -_DARK_DN:
            shadow_boxes.append(box)
    classes = np.repeat([0, 1], [len(rock_boxes), len(shadow_boxes)])
    return classes, np.array([*rock_boxes, *shadow_boxes], float).reshape(-1, 4)
