"""Boxes of tables by photo, with one sort for all photos."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
import pandas as pd

from polarsim.photo import BOX_CLASSES

BOX_COLUMNS = ("x0", "y0", "x1", "y1")
DETECTION = (*BOX_COLUMNS, "confidence", "kind")  # a detector's output, kind as index in BOX_CLASSES
ClassBoxes = tuple[np.ndarray, np.ndarray]  # class indices (n,) and boxes (n, 4) of a picture


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


def boxes_by_photo(table: pd.DataFrame, keys: Sequence[str], columns: Sequence[str] = BOX_COLUMNS) -> list[np.ndarray]:
    """Return the values (n, columns) of each photo in the order of the keys; n is 0 for photos without rows."""
    by_key = values_by(table, ["key"], columns)
    return [by_key.get(key, np.zeros((0, len(columns)))) for key in keys]


def detections_by_photo(predictions: pd.DataFrame, keys: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the `DETECTION` (n, 6) of each photo of a prediction table."""
    numbered = predictions.assign(kind=predictions["kind"].map(BOX_CLASSES.index))
    return dict(zip(keys, boxes_by_photo(numbered, keys, DETECTION), strict=True))


def detection_rows(key: object, boxes: np.ndarray) -> list[tuple[object, ...]]:
    """Return rows of a prediction table (key, kind, confidence, corners) of `DETECTION` (n, 6)."""
    return [(key, BOX_CLASSES[int(box[5])], box[4], *box[:4]) for box in boxes]


def labels_by_photo(labels: pd.DataFrame, keys: Sequence[str]) -> list[ClassBoxes]:
    """Return the labels of each photo in the order of the keys, without kinds that are not in `BOX_CLASSES`."""
    boxes = labels[labels["kind"].isin(BOX_CLASSES)]
    numbered = boxes.assign(kind=boxes["kind"].map(BOX_CLASSES.index))
    rows = boxes_by_photo(numbered, keys, ("kind", *BOX_COLUMNS))
    return [(boxes[:, 0].astype(int), boxes[:, 1:]) for boxes in rows]
