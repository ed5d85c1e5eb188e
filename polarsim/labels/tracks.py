"""One rock's boxes in the drawings of a position: the rig stands still, so boxes that overlap are the same rock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import iou, match
from polarsim.labels.seeds import Sight
from polarsim.photo import Azimuth

SAME_ROCK_IOU = 0.3  # boxes of two azimuths that overlap this much are the same rock


@dataclass(frozen=True)
class Track:
    """A rock in the drawings of a position: the number of its box in each, and its boxes (4,) in one common view."""

    rows: dict[Sight, int]
    boxes: dict[Sight, np.ndarray]

    @property
    def mean(self) -> np.ndarray:
        """(4,) mean of every edge: edges are annotated with nearly independent errors, and the mean beats the
        median.
        """
        return np.mean(list(self.boxes.values()), axis=0)

    @property
    def azimuths(self) -> set[Azimuth]:
        return {azimuth for _, azimuth in self.rows}


def find_tracks(annotated: Mapping[Sight, np.ndarray], same_rock_iou: float = SAME_ROCK_IOU) -> list[Track]:
    """Group rock boxes (n, 4) of several drawings, all moved into one view; one box a drawing at most.

    Drawings join in the order of their number of boxes, most first, so that the fullest one sets the pattern.
    """
    tracks: list[Track] = []
    for sight in sorted(annotated, key=lambda name: (-len(annotated[name]), name)):
        boxes = annotated[sight]
        means = np.array([track.mean for track in tracks]).reshape(-1, 4)
        rows, columns = match(iou(means, boxes), same_rock_iou)
        for row, column in zip(rows, columns, strict=True):
            tracks[row].rows[sight] = int(column)
            tracks[row].boxes[sight] = boxes[column]
        new = [column for column in range(len(boxes)) if column not in columns]
        tracks += [Track({sight: column}, {sight: boxes[column]}) for column in new]
    return tracks
