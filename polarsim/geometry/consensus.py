"""One box a rock from the boxes that people drew under several lamps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from polarsim.geometry.boxes import iou


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
    while overlap.size and overlap.max() > same_iou:
        box, cluster = np.unravel_index(overlap.argmax(), overlap.shape)
        clusters[cluster].append(boxes[box])
        overlap[box], overlap[:, cluster] = -1, -1
    taken = (overlap < 0).all(axis=1) if overlap.size else np.zeros(len(boxes), bool)
    clusters += [[box] for box in boxes[~taken]]


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
