"""Labels that a person put right: they win for their own photo, and start propagation anew for all others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.coco import read_coco
from polarsim.formats.release import read_annotated
from polarsim.geometry.boxes import iou, match
from polarsim.labels.label import Label, label_of
from polarsim.labels.seeds import Annotated
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, PhotoKey

SAME_LABEL = 0.1  # least IoU of a person's box with a propagated one whose rock it takes over


def read_corrections(folder: Path | None, terrain: int) -> dict[PhotoKey, Annotated]:
    """What people drew in photos of a terrain, as `KEY.txt` or as COCO files (`*.json`); nothing without a folder.

    Raises
    ------
    FormatError
        No such folder, a broken file in it, or a photo that is corrected twice.
    """
    if folder is None:
        return {}
    found = read_annotated(folder)
    for path in sorted(Path(folder).rglob("*.json")):
        for key, annotated in read_coco(path).items():
            if key in found:
                raise FormatError(f"{key} is corrected in another file of {folder} too", path=path)
            classes = np.array([BOX_CLASSES.index(one.kind) for one in annotated], int)
            found[key] = classes, np.array([one.box for one in annotated]).reshape(-1, 4)
    return {key: Annotated.of(*found[key]) for key in sorted(found) if key.terrain == terrain}


def as_annotated(annotated: Annotated, labels: Sequence[Label]) -> list[Label]:
    """The boxes of a person, with the rocks of the propagated labels of the same exposure bracket that they lie on."""
    found = []
    for kind, boxes in ((ROCK, annotated.rocks), (SHADOW, annotated.shadows)):
        if boxes is None:
            continue
        near = [label for label in labels if label.kind == kind]
        rows, columns = match(iou(boxes, np.array([label.box for label in near]).reshape(-1, 4)), SAME_LABEL)
        rocks = np.full(len(boxes), NO_ROCK)
        rocks[rows] = [near[column].rock for column in columns]
        found += [label_of(kind, rock, "seed", box) for rock, box in zip(rocks, boxes, strict=True)]
    return found
