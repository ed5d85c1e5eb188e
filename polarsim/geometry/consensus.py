"""Consensus of boxes that were annotated under several lamps: one box per rock, and detection of wrong labels.

A shadow at a place where other lamps show a rock is that rock. Boxes with the name of another position match the
terrain's rocks from the pose of that position, not from the named one. Missing rocks and false boxes change the share
of matched boxes slightly; boxes of another view match only by chance.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import iou, largest_iou, match_pairs
from polarsim.geometry.camera import Camera

MIN_SAME_ROCK_IOU = 0.3  # minimum IoU of two annotations of the same rock
SHADOW_ON_ROCK = 0.5  # minimum IoU of a shadow's box with the rock that it is
MIN_AZIMUTHS = 2  # minimum number of azimuths that show the rock
MIN_MATCHED_ROCK_IOU = 0.3  # minimum IoU of a box and a matching projected rock
MIN_BOXES_OF_A_POSITION = 4  # minimum number of boxes for a decision
MIN_POSITION_LEAD = 0.3  # minimum lead of another pose, in the share of matched boxes
MAX_OWN_SHARE = 0.5  # maximum share of matched boxes from the named pose, relative to the share from the other pose
log = logging.getLogger("polarsim")


def consensus_boxes(annotated: Sequence[np.ndarray], share: float = 0.3, same_iou: float = 0.5) -> np.ndarray:
    """Return the boxes (m, 4) that enough photos agree on: the median box of each rock, in the order of annotation.

    `annotated`, sequence of (n, 4): rock boxes of a view in pixels, one array per photo (one photo per azimuth).
    `share`: minimum share of the photos in which a rock is annotated.
    `same_iou`: minimum IoU of boxes of the same rock in two photos.
    """
    clusters: list[list[np.ndarray]] = []
    for boxes in annotated:
        _add_photo(clusters, np.asarray(boxes, float).reshape(-1, 4), same_iou)
    clusters = _merge_clusters(clusters, same_iou)
    kept = [_median(cluster) for cluster in clusters if len(cluster) >= share * len(annotated)]
    return np.array(kept).reshape(-1, 4)


def consensus_of_sets(sets: Sequence[Sequence[np.ndarray]], share: float = 0.3, same_iou: float = 0.5) -> np.ndarray:
    """Return the boxes (m, 4) that the exposure brackets of a view agree on, one set for each light and azimuth.

    Each set has one vote, the medians over its exposures, independent of the number of labelled exposures.
    """
    return consensus_boxes([consensus_boxes(annotated, 0.0, same_iou) for annotated in sets], share, same_iou)


def _add_photo(clusters: list[list[np.ndarray]], boxes: np.ndarray, same_iou: float) -> None:
    """Add each box to its best cluster, best pairs first, one box per cluster; remaining boxes start new clusters."""
    overlap = iou(boxes, np.array([_median(cluster) for cluster in clusters]))
    taken, best = match_pairs(overlap, overlap > same_iou, "greedy")
    for box, cluster in zip(taken, best, strict=True):
        clusters[cluster].append(boxes[box])
    clusters += [[box] for box in np.delete(boxes, taken, axis=0)]


def _merge_clusters(clusters: list[list[np.ndarray]], same_iou: float) -> list[list[np.ndarray]]:
    """Merge clusters that overlap because running medians drift, the larger first."""
    done: list[list[np.ndarray]] = []
    for cluster in sorted(clusters, key=len, reverse=True):
        overlap = iou(_median(cluster)[None], np.array([_median(other) for other in done]))
        if overlap.size and overlap.max() > same_iou:
            continue  # a repeated annotation adds no vote
        done.append(cluster)
    return done


def _median(cluster: list[np.ndarray]) -> np.ndarray:
    return np.asarray(np.median(cluster, axis=0))


def find_rocks_labelled_shadow(shadows: np.ndarray, rocks: np.ndarray, elsewhere: Sequence[np.ndarray]) -> np.ndarray:
    """Return (n,) which shadows of a photo are rocks.

    `shadows` (n, 4), `rocks` (m, 4): boxes of one photo, pixels.
    `elsewhere`, sequence of (k, 4): rock boxes of the same view under other lamps, one array per azimuth.
    """
    shown = np.sum([largest_iou(shadows, boxes) >= SHADOW_ON_ROCK for boxes in elsewhere], axis=0)
    return np.asarray((shown >= MIN_AZIMUTHS) & (largest_iou(shadows, rocks) < MIN_SAME_ROCK_IOU))


@dataclass(frozen=True)
class MislabelledPosition:
    """Position with boxes that the pose of another position explains."""

    position: str
    met: float  # share of the boxes that match rocks from the pose of `position`
    other: str
    met_from_other: float

    def __str__(self) -> str:
        return (
            f"the seeds of position {self.position} show another position: {self.met:.0%} of their boxes match rocks "
            f"from its pose, {self.met_from_other:.0%} from the pose of position {self.other}; they are excluded"
        )


def find_mislabelled_positions(
    annotated: Mapping[str, np.ndarray], projected: Mapping[str, np.ndarray]
) -> list[MislabelledPosition]:
    """Return positions with boxes of another position.

    `annotated`, position -> (b, 4): rock boxes of the left photos, one per rock, pixels.
    `projected`, position -> (m, 4): boxes of the terrain's rocks in left photos from the pose of each position; NaN for
    rocks out of view.
    """
    mislabelled = []
    for position, boxes in sorted(annotated.items()):
        if len(boxes) < MIN_BOXES_OF_A_POSITION or position not in projected:
            continue
        met = {
            pose: float((largest_iou(boxes, _in_view(rocks)) >= MIN_MATCHED_ROCK_IOU).mean())
            for pose, rocks in projected.items()
        }
        own_share = met.pop(position)
        best = max(sorted(met), key=lambda pose: met[pose], default=None)
        if best is not None and met[best] - own_share >= MIN_POSITION_LEAD and own_share < MAX_OWN_SHARE * met[best]:
            mislabelled.append(MislabelledPosition(position, own_share, best, met[best]))
    return mislabelled


def warn_mislabelled_positions(
    annotated: Mapping[str, np.ndarray], cameras: Mapping[str, Camera], rocks: Sequence[np.ndarray]
) -> set[str]:
    """Return the positions of `find_mislabelled_positions`, from rock points (n, 3) and left cameras; log warnings."""
    projected = {
        position: np.array([camera.box_around(points) for points in rocks]).reshape(-1, 4)
        for position, camera in cameras.items()
    }
    strangers = find_mislabelled_positions(annotated, projected)
    for stranger in strangers:
        log.warning("%s", stranger)
    return {stranger.position for stranger in strangers}


def _in_view(boxes: np.ndarray) -> np.ndarray:
    return boxes[np.isfinite(boxes).all(axis=1)]
