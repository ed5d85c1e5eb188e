"""A label: one box of a photo, whose it is, where it comes from and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area, clip
from polarsim.labels.confidence import confidence


@dataclass(frozen=True)
class Label:
    """One box (4,) of a photo, and where it comes from: seed, fused, shifted, projected or cast."""

    kind: str
    rock: int
    source: str
    confidence: float
    box: np.ndarray


def label_of(
    kind: str, rock: int, source: str, box: np.ndarray, share: float = 1.0, *, by_rover_light: bool = False
) -> Label:
    """A label with its confidence; `share` of the annotated azimuths show its rock. Seeds are not cut at the border."""
    box = box if source == "seed" else clip(box)
    size = float(np.sqrt(area(box)))
    sure = confidence(kind, source, share, size, by_rover_light=by_rover_light)
    return Label(kind, int(rock), source, round(sure, 3), box)
