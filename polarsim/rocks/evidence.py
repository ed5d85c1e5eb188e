"""Seed boxes as evidence: which positions' labels show a rock."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.formats.rigs import PlacedRig
from polarsim.geometry.boxes import around, iou


def confirming_positions(
    points: np.ndarray, placed: Mapping[str, PlacedRig], boxes: Mapping[str, np.ndarray], min_iou: float
) -> list[str]:
    """Positions in whose left photos a drawn rock box overlaps the points' box by at least `min_iou`.

    Parameters
    ----------
    points : (n, 3) float
        Of one rock, sandbox frame, metres.
    boxes : position -> (b, 4) float
        Rock boxes of the position's seeds, pixels of the left photo.
    """
    found = []
    for position, drawn in sorted(boxes.items()):
        if position not in placed or not len(drawn):
            continue
        pixels = placed[position].project("L", points)
        pixels = pixels[np.isfinite(pixels).all(axis=1)]
        if not len(pixels):
            continue

        if iou(around(pixels)[None], drawn).max() >= min_iou:
            found.append(position)
    return found
