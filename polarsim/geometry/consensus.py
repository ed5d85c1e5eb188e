"""What boxes that people drew under several lamps tell together: one box a rock, and which boxes are mistaken.

A shadow that was annotated where other lamps show a rock is that rock. Boxes under another position's name meet the
terrain's rocks from that position's pose, not from their own: a rock that nobody found, or a box that nobody drew,
changes little of the share of boxes that are met; boxes of another view are met by chance alone.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import iou, largest_iou, pairs
from polarsim.geometry.camera import Camera

SAME_ROCK = 0.3  # IoU of a rock's boxes that two people drew, or one person twice
SHADOW_ON_ROCK = 0.5  # IoU of a shadow's box with a rock that makes it the rock
AZIMUTHS = 2  # that must show the rock
MET = 0.3  # IoU of a box and a projected rock
LEAST_BOXES = 4  # fewer tell nothing
LEAD = 0.3  # of the share of boxes by which another pose must be better
FEW = 0.5  # ... and the share that is met from their own pose is less than that of what the other pose meets
log = logging.getLogger("polarsim")


def consensus_boxes(annotated: Sequence[np.ndarray], share: float = 0.3, same_iou: float = 0.5) -> np.ndarray:
    """Boxes that enough of the photos agree on.

    Parameters
    ----------
    annotated : sequence of (n, 4) float
        Rock boxes of one view in pixels, one array a photo (an azimuth each).
    share : float
        A rock counts when it was annotated in at least this part of the photos.
    same_iou : float
        Boxes of two photos that overlap by more are one rock's.

    Returns
    -------
    (m, 4) float
        Median box of each rock, in order of first sight; none at all for no photos.
    """
    clusters: list[list[np.ndarray]] = []
    for boxes in annotated:
        _add_photo(clusters, np.asarray(boxes, float).reshape(-1, 4), same_iou)
    clusters = _merged(clusters, same_iou)
    kept = [_median(cluster) for cluster in clusters if len(cluster) >= share * len(annotated)]
    return np.array(kept).reshape(-1, 4)


def consensus_of_sets(sets: Sequence[Sequence[np.ndarray]], share: float = 0.3, same_iou: float = 0.5) -> np.ndarray:
    """(m, 4) boxes that the exposure brackets of one view agree on, one set for each light and azimuth.

    Each set speaks with one voice, the medians over its exposures, however many of them were labelled.
    """
    return consensus_boxes([consensus_boxes(annotated, 0.0, same_iou) for annotated in sets], share, same_iou)


def _add_photo(clusters: list[list[np.ndarray]], boxes: np.ndarray, same_iou: float) -> None:
    """Give each box to its best cluster, best pairs first, one box a cluster; boxes left over found new ones."""
    overlap = iou(boxes, np.array([_median(cluster) for cluster in clusters]))
    taken, best = pairs(overlap, overlap > same_iou, "greedy")
    for box, cluster in zip(taken, best, strict=True):
        clusters[cluster].append(boxes[box])
    clusters += [[box] for box in np.delete(boxes, taken, axis=0)]


def _merged(clusters: list[list[np.ndarray]], same_iou: float) -> list[list[np.ndarray]]:
    """Running medians drift: clusters that ended on one another are joined, the larger first."""
    done: list[list[np.ndarray]] = []
    for cluster in sorted(clusters, key=len, reverse=True):
        overlap = iou(_median(cluster)[None], np.array([_median(other) for other in done]))
        if overlap.size and overlap.max() > same_iou:
            continue  # a redrawn double adds no vote
        done.append(cluster)
    return done


def _median(cluster: list[np.ndarray]) -> np.ndarray:
    return np.asarray(np.median(cluster, axis=0))


def rocks_called_shadows(shadows: np.ndarray, rocks: np.ndarray, elsewhere: Sequence[np.ndarray]) -> np.ndarray:
    """Which shadows of a photo are rocks.

    Parameters
    ----------
    shadows, rocks : (n, 4), (m, 4) float
        Boxes of one photo, pixels.
    elsewhere : sequence of (k, 4) float
        Rock boxes of the same view under other lamps, one array an azimuth.

    Returns
    -------
    (n,) bool
    """
    shown = np.sum([largest_iou(shadows, boxes) >= SHADOW_ON_ROCK for boxes in elsewhere], axis=0)
    return np.asarray((shown >= AZIMUTHS) & (largest_iou(shadows, rocks) < SAME_ROCK))


@dataclass(frozen=True)
class Stranger:
    """Boxes of a position that another one's pose explains."""

    position: str
    met: float  # share of the boxes that rocks meet, from their own position's pose
    other: str
    met_from_other: float

    def __str__(self) -> str:
        return (
            f"the seeds of position {self.position} show another position: rocks meet {self.met:.0%} of their boxes "
            f"from its own pose, {self.met_from_other:.0%} from that of position {self.other}; they are left out"
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
