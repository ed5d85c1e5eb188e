"""Labels derived from one annotation, computed by propagating with and without the annotation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import LabelError
from polarsim.formats.tables import write_parquet
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, labels_of_terrain
from polarsim.photo import PhotoKey
from polarsim.schemas.photos import UNDONE

COLUMNS = UNDONE.columns
MIN_SHIFT_PX = 0.5  # minimum shift of an edge that counts as a change

LabelsByPhoto = Mapping[PhotoKey, Sequence[Label]]


def derived_labels(
    *,
    drawing: PhotoKey,
    inputs: PropagationInputs,
    options: LabelsOptions,
    out: Path,
) -> pd.DataFrame:
    """Propagate the labels of a terrain with and without an annotation, and write the rows of `label_changes`.

    `options` must not exclude the annotation already.
    """
    if str(drawing) in options.excluded_annotations:
        raise LabelError(f"the annotation of {drawing} is already excluded (labels.excluded_annotations)")

    def labels(without: tuple[str, ...]) -> LabelsByPhoto:
        return labels_of_terrain(inputs, options.model_copy(update={"excluded_annotations": without}))

    excluded = options.excluded_annotations
    found = label_changes(labels(excluded), labels((*excluded, str(drawing))))
    write_parquet(out, found)
    return found


def label_changes(with_it: LabelsByPhoto, without: LabelsByPhoto) -> pd.DataFrame:
    """Return a row with `COLUMNS` for each label that changes without the annotation.

    `change` is `gone` (the label disappears), `moved` (an edge shifts by up to `moved_px`) or `new` (a label appears).
    """
    rows = [(str(key), kind, rock, change, moved) for key, kind, rock, change, moved, _ in changes(with_it, without)]
    types = {"key": str, "kind": str, "rock": np.int64, "change": str, "moved_px": float}
    return pd.DataFrame(rows, columns=list(COLUMNS)).astype(types)


def changes(
    former: LabelsByPhoto, present: LabelsByPhoto
) -> Iterator[tuple[PhotoKey, str, int, str, float, np.ndarray | None]]:
    """Yield photo, kind, rock, change and shift (px) of each changed label, and the former box (4,) if it existed."""
    for key in sorted({*former, *present}):
        boxes_before, boxes_after = _by_name(former.get(key, ())), _by_name(present.get(key, ()))
        for name in sorted({*boxes_before, *boxes_after}):
            before, after = boxes_before.get(name), boxes_after.get(name)
            change, moved = "gone" if after is None else "new", np.nan
            if before is not None and after is not None:
                change, moved = "moved", float(np.abs(before - after).max())
            if not moved <= MIN_SHIFT_PX:
                yield key, name[0], name[1], change, round(moved, 2), before


def _by_name(labels: Sequence[Label]) -> dict[tuple[str, int, int], np.ndarray]:
    """Return boxes (4,) by kind, rock and number; several boxes of a rock are numbered from left to right."""
    boxes: dict[tuple[str, int, int], np.ndarray] = {}
    for label in sorted(labels, key=lambda label: (label.kind, label.rock, *label.box.tolist())):
        number = sum(name[:2] == (label.kind, label.rock) for name in boxes)
        boxes[label.kind, label.rock, number] = label.box
    return boxes
