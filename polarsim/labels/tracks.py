"""One rock's boxes under several lamps: the camera stands still, so boxes that overlap are the same rock."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import iou, match
from polarsim.photo import Azimuth


@dataclass(frozen=True)
class Track:
    """Boxes (4,) of one rock in one view, by azimuth."""

    boxes: dict[Azimuth, np.ndarray]

    @property
    def mean(self) -> np.ndarray:
        """(4,) mean of every edge: edges are drawn with nearly independent errors, and the mean beats the median."""
        return np.mean(list(self.boxes.values()), axis=0)


def find_tracks(drawn: dict[Azimuth, np.ndarray], same_rock_iou: float) -> list[Track]:
    """Group rock boxes (n, 4) of several azimuths, one box an azimuth at most.

    Azimuths join in the order of their number of boxes, most first, so that the fullest drawing sets the pattern.
    """
    tracks: list[dict[Azimuth, np.ndarray]] = []
    for azimuth in sorted(drawn, key=lambda name: (-len(drawn[name]), name)):
        boxes = drawn[azimuth]
        means = np.array([np.mean(list(track.values()), axis=0) for track in tracks]).reshape(-1, 4)
        rows, columns = match(iou(means, boxes), same_rock_iou)
        for row, column in zip(rows, columns, strict=True):
            tracks[row][azimuth] = boxes[column]
        tracks += [{azimuth: boxes[column]} for column in range(len(boxes)) if column not in columns]
    return [Track(track) for track in tracks]
