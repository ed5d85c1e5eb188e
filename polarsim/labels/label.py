"""A label: one box of a photo, whose it is, where it comes from and how sure it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area, clip

USUAL_PX = 50.0  # sqrt(area) of a common label
# Of the logarithm of the odds that a label and the box that a person draws there overlap by IoU >= 0.5. Fitted by
# `benchmarks/transfers.py --fit` to terrains 01, 03, 04, 08, 11 of the published labels, where one person's drawing is
# the truth; those of fused rocks (under Sun lamps; without one `rover_light` tells) to 12 too. Those of `translated`
# were fitted to 03, 04, 08, 11, 12, the pose of each position in turn forgotten; the share counts as it does for fused
# rocks. `figures/reliability.png` of a run shows how well they hold.
COEFFICIENTS = {  # by kind and source: at full share and usual size; for every share missed; for size
    ("rock", "seed"): (5.06, 0.0, 0.89),
    ("rock", "fused"): (2.18, 3.30, 1.08),
    ("rock", "translated"): (1.75, 3.30, 1.61),
    ("rock", "projected"): (0.81, 0.0, 0.56),
    ("shadow", "seed"): (4.27, 0.0, 0.31),
    ("shadow", "fused"): (1.90, 0.0, 1.31),
    ("shadow", "translated"): (1.03, 0.0, 1.40),
    ("shadow", "cast"): (0.31, 0.0, 0.79),
}
PITCH_UNKNOWN = {"rock": (0.90, 3.30, 1.61), "shadow": (0.46, 0.0, 1.40)}  # of `translated` by a usual pitch
ROVER_CAST = (-2.4, 0.0, 0.0)  # the same of shadows that the rover light casts: slivers beside their rocks


def confidence(
    kind: str, source: str, share: float, size_px: float, *, by_rover_light: bool = False, pitch_known: bool = True
) -> float:
    """Probability that a label is right: logistic in the share of azimuths that show the rock, and in the log of size.

    Parameters
    ----------
    share
        Of the azimuths annotated at the label's position whose lamps light the rock, those that show it; 1 where
        that says nothing.
    size_px
        sqrt(width * height) of the label.
    by_rover_light
        A shadow of the rover light, not of a Sun lamp.
    pitch_known
        Whether anything tells how far down the camera looks, which decides how far translated labels move.
    """
    start, missed, size = COEFFICIENTS[kind, source]
    if source == "cast" and by_rover_light:
        start, missed, size = ROVER_CAST
    if source == "translated" and not pitch_known:
        start, missed, size = PITCH_UNKNOWN[kind]
    score = start + missed * (share - 1) + size * math.log(max(size_px, 1.0) / USUAL_PX)
    return 1 / (1 + math.exp(-score))


@dataclass(frozen=True)
class Label:
    """One box (4,) of a photo, and where it comes from: seed, fused, translated, projected or cast."""

    kind: str
    rock: int
    source: str
    confidence: float
    box: np.ndarray


def label_of(
    kind: str,
    rock: int,
    source: str,
    box: np.ndarray,
    share: float = 1.0,
    *,
    by_rover_light: bool = False,
    pitch_known: bool = True,
) -> Label:
    """A label with its `confidence`; `share` of the annotated azimuths show its rock.

    Seeds are not cut at the border.
    """
    box = box if source == "seed" else clip(box)
    size = float(np.sqrt(area(box)))
    sure = confidence(kind, source, share, size, by_rover_light=by_rover_light, pitch_known=pitch_known)
    return Label(kind, int(rock), source, round(sure, 3), box)
