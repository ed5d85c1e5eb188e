"""Seed boxes under another position's name: rocks of the terrain meet them from that position's pose, not from theirs.

A rock that nobody found, or a box that nobody drew, changes little of the share of boxes that are met; boxes of another
view are met by chance alone.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import largest_iou
from polarsim.geometry.camera import Camera

MET = 0.3  # IoU of a box and a projected rock
LEAST_BOXES = 4  # fewer tell nothing
LEAD = 0.3  # of the share of boxes by which another pose must be better
FEW = 0.5  # ... and the share that is met from their own pose is less than that of what the other pose meets


log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Stranger:
    """Boxes of a position that another one's pose explains."""

    position: str
    met: float  # share of the boxes that rocks meet, from their own position's pose
    other: str
    met_from_other: float

    def __str__(self) -> str:
        return (
            f"the seeds of position {self.position} show another place: rocks meet {self.met:.0%} of their boxes from "
            f"its own pose, {self.met_from_other:.0%} from that of position {self.other}; they are left out"
        )


def find_strangers(annotated: Mapping[str, np.ndarray], projected: Mapping[str, np.ndarray]) -> list[Stranger]:
    """Positions whose boxes belong to another one.

    Parameters
    ----------
    annotated : position -> (b, 4) float
        Rock boxes of its left photos, one a rock, pixels.
    projected : position -> (m, 4) float
        Boxes of the terrain's rocks in the left photos that are taken from its pose; NaN for those that are not seen.
    """
    found = []
    for position, boxes in sorted(annotated.items()):
        if len(boxes) < LEAST_BOXES or position not in projected:
            continue
        met = {pose: float((largest_iou(boxes, _seen(rocks)) >= MET).mean()) for pose, rocks in projected.items()}
        own = met.pop(position)
        best = max(sorted(met), key=lambda pose: met[pose], default=None)
        if best is not None and met[best] - own >= LEAD and own < FEW * met[best]:
            found.append(Stranger(position, own, best, met[best]))
    return found


def positions_of_strangers(
    annotated: Mapping[str, np.ndarray], cameras: Mapping[str, Camera], rocks: Sequence[np.ndarray]
) -> set[str]:
    """The positions that `find_strangers` names, by rocks' points (n, 3) and the left cameras; warns of each."""
    projected = {
        position: np.array([camera.box_around(points) for points in rocks]).reshape(-1, 4)
        for position, camera in cameras.items()
    }
    strangers = find_strangers(annotated, projected)
    for stranger in strangers:
        log.warning("%s", stranger)
    return {stranger.position for stranger in strangers}


def _seen(boxes: np.ndarray) -> np.ndarray:
    return boxes[np.isfinite(boxes).all(axis=1)]
