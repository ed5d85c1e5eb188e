"""Labels that a person put right: they win for their own photo, and start propagation anew for all others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.formats.annotated import read_annotated
from polarsim.geometry.boxes import iou, match
from polarsim.labels.label import Label, label_of
from polarsim.labels.seeds import Drawn
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, PhotoKey

SAME_LABEL = 0.1  # least IoU of a person's box with a propagated one whose rock it takes over
Corrections = dict[PhotoKey, Drawn]


def read_corrections(folder: Path | None, terrain: int) -> Corrections:
    """What people drew in photos of a terrain; nothing without a folder.

    Raises
    ------
    FormatError
        No such folder, or a broken file in it.
    """
    if folder is None:
        return {}
    found = {key: drawn for key, drawn in read_annotated(folder).items() if key.terrain == terrain}
    return {
        key: Drawn(boxes[classes == BOX_CLASSES.index(ROCK)], boxes[classes == BOX_CLASSES.index(SHADOW)])
        for key, (classes, boxes) in sorted(found.items())
    }


def corrected(drawn: Drawn, labels: Sequence[Label]) -> list[Label]:
    """The boxes of a person, with the rocks of the propagated labels of the same photo set that they lie on."""
    found = []
    for kind, boxes in ((ROCK, drawn.rocks), (SHADOW, drawn.shadows)):
        if boxes is None:
            continue
        near = [label for label in labels if label.kind == kind]
        rows, columns = match(iou(boxes, np.array([label.box for label in near]).reshape(-1, 4)), SAME_LABEL)
        rocks = np.full(len(boxes), NO_ROCK)
        rocks[rows] = [near[column].rock for column in columns]
        found += [label_of(kind, rock, "seed", box) for rock, box in zip(rocks, boxes, strict=True)]
    return found
