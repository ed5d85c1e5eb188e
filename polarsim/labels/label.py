"""Labels: boxes of a photo with rock id, origin and confidence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area
from polarsim.photo import photo_scale

REFERENCE_PX = 50.0  # sqrt(area) of a common label
# Coefficients of the log odds that a label has IoU >= 0.5 with the box of an annotator. Fitted by
# `benchmarks/transfers.py --fit` to terrains 01, 03, 04, 08, 11 of the published labels as ground truth. `fused` rocks
# under Sun lamps also use terrain 12; without a Sun lamp, `rover_light` of `annotator.json` applies. `translated` was
# fitted to terrains 03, 04, 08, 11, 12 without the pose of each position in turn, with the share coefficient of `fused`
# rocks. `figures/reliability.png` of a run shows the calibration.
COEFFICIENTS = {  # by kind and source: offset at full share and usual size; factor of the missing share; of log size
    ("rock", "seed"): (5.06, 0.0, 0.89),
    ("rock", "fused"): (2.18, 3.30, 1.08),
    ("rock", "translated"): (1.75, 3.30, 1.61),
    ("rock", "projected"): (0.81, 0.0, 0.56),
    ("shadow", "seed"): (4.27, 0.0, 0.31),
    ("shadow", "fused"): (1.90, 0.0, 1.31),
    ("shadow", "translated"): (1.03, 0.0, 1.40),
    ("shadow", "cast"): (0.31, 0.0, 0.79),
}
PITCH_UNKNOWN = {"rock": (0.90, 3.30, 1.61), "shadow": (0.46, 0.0, 1.40)}  # `translated` labels with a default pitch
ROVER_CAST = (-2.4, 0.0, 0.0)  # shadows cast by the rover light: slivers next to their rocks


def confidence(
    kind: str, source: str, share: float, size_px: float, *, by_rover_light: bool = False, pitch_known: bool = True
) -> float:
    """Return the probability that a label is correct, logistic in `share` and in the logarithm of the size.

    `share`: share of the annotated azimuths of the position in which the rock is annotated, among azimuths whose lamp
    lights the rock; 1 if not applicable.
    `size_px`: sqrt(width * height) of the label in a photo of the reference width.
    `by_rover_light`: whether the rover light, not a Sun lamp, casts the shadow.
    `pitch_known`: whether the pitch of the camera is known. It determines the shift of translated labels.
    """
    start, missed, size = COEFFICIENTS[kind, source]
    if source == "cast" and by_rover_light:
        start, missed, size = ROVER_CAST
    if source == "translated" and not pitch_known:
        start, missed, size = PITCH_UNKNOWN[kind]
    score = start + missed * (share - 1) + size * math.log(max(size_px, 1.0) / REFERENCE_PX)
    return 1 / (1 + math.exp(-score))


@dataclass(frozen=True)
class Label:
    """Box (4,) in a photo and its `source`: seed, fused, translated, projected or cast."""

    kind: str
    rock: int
    source: str
    confidence: float
    box: np.ndarray


def make_label(
    kind: str,
    rock: int,
    source: str,
    box: np.ndarray,
    photo_width: int,
    share: float = 1.0,
    *,
    by_rover_light: bool = False,
    pitch_known: bool = True,
) -> Label:
    """Return a label with its `confidence`. Boxes of seeds are not clipped to the photo, all others are.

    `photo_width`: width of the photo, px.
    """
    size = float(np.sqrt(area(box))) / photo_scale(photo_width)
    probability = confidence(kind, source, share, size, by_rover_light=by_rover_light, pitch_known=pitch_known)
    return Label(kind, int(rock), source, round(probability, 3), box)
