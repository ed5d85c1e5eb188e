"""One rock's boxes in the drawings of a position, and how they weigh beside the box of its projected mesh.

The rig stands still, so boxes that overlap are the same rock.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.boxes import area, iou, match
from polarsim.labels.seeds import DrawingKey
from polarsim.photo import Azimuth

SAME_ROCK_IOU = 0.3  # boxes of two azimuths that overlap this much are the same rock
CAUCHY = 2.385  # standard deviations at which an edge's weight is half: 95 % as efficient as least squares

# Standard deviation of an edge of one annotated box, by sqrt(area): 2.7 px at 20 px to 6.3 px at 150 px, measured as
# the robust spread of 3,324 boxes of the published labels about those of the same rocks at other azimuths.
EDGE_PX, EDGE_SHARE = 2.2, 0.027


@dataclass(frozen=True)
class Track:
    """A rock in the drawings of a position: the number of its box in each, and its boxes (4,) in one common view."""

    rows: dict[DrawingKey, int]
    boxes: dict[DrawingKey, np.ndarray]

    @property
    def mean(self) -> np.ndarray:
        """(4,) mean of every edge: errors of edges are nearly independent, and the mean beats the median."""
        return np.mean(list(self.boxes.values()), axis=0)

    @property
    def azimuths(self) -> set[Azimuth]:
        return {azimuth for _, azimuth in self.rows}


def find_tracks(annotated: Mapping[DrawingKey, np.ndarray], same_rock_iou: float = SAME_ROCK_IOU) -> list[Track]:
    """Group rock boxes (n, 4) of several drawings, all moved into one view; one box a drawing at most.

    Drawings join in the order of their number of boxes, most first, so that the fullest one sets the pattern.
    """
    tracks: list[Track] = []
    for drawing in sorted(annotated, key=lambda name: (-len(annotated[name]), name)):
        boxes = annotated[drawing]
        means = np.array([track.mean for track in tracks]).reshape(-1, 4)
        rows, columns = match(iou(means, boxes), same_rock_iou)
        for row, column in zip(rows, columns, strict=True):
            tracks[row].rows[drawing] = int(column)
            tracks[row].boxes[drawing] = boxes[column]
        new = [column for column in range(len(boxes)) if column not in columns]
        tracks += [Track({drawing: column}, {drawing: boxes[column]}) for column in new]
    return tracks


def edge_sd_px(boxes: np.ndarray) -> np.ndarray:
    """(n, 1) standard deviation of the edges of annotated boxes (n, 4)."""
    return np.asarray(EDGE_PX + EDGE_SHARE * np.sqrt(area(boxes)))[:, None]


def mesh_weights(annotated: np.ndarray, count: np.ndarray, mesh: np.ndarray, weight: float) -> np.ndarray:
    """(n, 4) weights of the edges of projected boxes `mesh` (n, 4) beside drawings, of which each has weight 1.

    A mesh edge is as good as `weight` drawings until it lies farther off than the errors of both explain: scans miss
    parts of rocks, and take sand for rock. Then it counts less, by Cauchy's weight (Holland and Welsch, Commun. Stat. A
    6 (1977) 813). Edges without drawings are the mesh's: weight 1.

    Parameters
    ----------
    annotated, count : (n, 4) float
        Mean of the annotated edges, and of how many drawings; what `annotated` says without a drawing does not matter.
    """
    alone = count == 0
    known = np.where(alone, mesh, annotated)
    off = (mesh - known) / (CAUCHY * edge_sd_px(known))
    # The variance of mesh minus mean is 1 / count + 1 / weight of that of one drawing.
    share = np.divide(count * weight, count + weight, out=np.zeros_like(known), where=~alone)
    return np.where(alone, 1.0, weight / (1 + off**2 * share))
