"""Boxes of tables by photo, with one sort for all photos, and the bootstrap units of photos.

Photos of a view show the same rocks from the same position under different light. They are not independent, so
intervals over photos are too narrow. Views of a terrain also share rocks. Because few terrains are tested, intervals
are valid for these terrains only and do not extend to new terrains.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.errors import DetectError, LabelError
from polarsim.photo import BOX_CLASSES, PhotoKey

BOX_COLUMNS = ("x0", "y0", "x1", "y1")
DETECTION = (*BOX_COLUMNS, "confidence", "kind")  # a detector's output, kind as index in BOX_CLASSES
ClassBoxes = tuple[np.ndarray, np.ndarray]  # class indices (n,) and boxes (n, 4) of a picture
Unit = Literal["view", "photo"]


def units_of(keys: Sequence[str], unit: Unit) -> np.ndarray:
    """Return the index (n,) of the view of each photo in the sorted views; or of each photo."""
    if unit == "photo":
        return np.unique(np.array(keys, str), return_inverse=True)[1]
    try:
        views = [PhotoKey.parse(key).view for key in keys]
    except LabelError as error:
        raise DetectError(f"{error}, so the view is unknown: use photos as bootstrap units") from error
    number = {view: n for n, view in enumerate(sorted(set(views)))}
    return np.array([number[view] for view in views], int)


def rows_by(table: pd.DataFrame, by: Sequence[str]) -> dict[Hashable, np.ndarray]:
    """Return the row indices (n,) of each group of equal values, by value or by tuple of values."""
    if not len(table):
        return {}
    groups = table.groupby(list(by) if len(by) > 1 else by[0], sort=True)
    number = groups.ngroup().to_numpy()
    order = np.argsort(number, kind="stable")
    starts = np.flatnonzero(np.diff(number[order], prepend=-1))
    names = table[list(by)].iloc[order[starts]].itertuples(index=False, name=None)
    parts = np.split(order, starts[1:])
    return {name if len(by) > 1 else name[0]: part for name, part in zip(names, parts, strict=True)}


def values_by(table: pd.DataFrame, by: Sequence[str], columns: Sequence[str]) -> dict[Hashable, np.ndarray]:
    """Return the values (n, columns) of each group of `rows_by`."""
    values = table[list(columns)].to_numpy(float)
    return {name: values[rows] for name, rows in rows_by(table, by).items()}


def detections_by_photo(predictions: pd.DataFrame, keys: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the `DETECTION` (n, 6) of each photo of a prediction table; n is 0 for photos without predictions."""
    return dict(zip(keys, _by_photo(predictions, keys, DETECTION), strict=True))


def detection_rows(key: object, boxes: np.ndarray) -> list[tuple[object, ...]]:
    """Return rows of a prediction table (key, kind, confidence, corners) of `DETECTION` (n, 6)."""
    return [(key, BOX_CLASSES[int(box[5])], box[4], *box[:4]) for box in boxes]


def labels_by_photo(labels: pd.DataFrame, keys: Sequence[str]) -> list[ClassBoxes]:
    """Return the labels of each photo in the order of the keys, without kinds that are not in `BOX_CLASSES`."""
    rows = _by_photo(labels[labels["kind"].isin(BOX_CLASSES)], keys, ("kind", *BOX_COLUMNS))
    return [(boxes[:, 0].astype(int), boxes[:, 1:]) for boxes in rows]


def _by_photo(table: pd.DataFrame, keys: Sequence[str], columns: Sequence[str]) -> list[np.ndarray]:
    """Return the values (n, columns) of each photo, kind as index in `BOX_CLASSES`."""
    by_key = values_by(table.assign(kind=table["kind"].map(BOX_CLASSES.index)), ["key"], columns)
    return [by_key.get(key, np.zeros((0, len(columns)))) for key in keys]
