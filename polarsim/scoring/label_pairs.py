"""Table of matches between true boxes and labels, with the unmatched boxes of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from polarsim.formats.tables import LABEL_COLUMNS, key_columns, typed
from polarsim.geometry.boxes import area, iou, match_by_iou, match_by_summed_iou
from polarsim.photo import BOX_CLASSES, NO_ROCK, SHADOW, PhotoKey
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.metrics import Against
from polarsim.scoring.score import MIN_IOU, PhotoLabels

EDGES = ("x0", "y0", "x1", "y1")
TRUE_EDGES = tuple(f"true_{edge}" for edge in EDGES)

_NONE = -1  # index of a missing box


@dataclass(frozen=True)
class PhotoPairs:
    """One-to-one matches of the boxes of a photo within each class: rows of true boxes, then of unmatched labels."""

    kind: np.ndarray  # (n,) class numbers
    label: np.ndarray  # (n,) indices of the labels, -1: unmatched true box
    iou: np.ndarray  # (n,) of the pair; NaN for an unmatched box
    iou_best: np.ndarray  # (n,) of a true box in the matching with the largest summed IoU; NaN for an unmatched label
    truth: np.ndarray  # (n, 4) true boxes; NaN for an unmatched label


def pair_photo(truth: PhotoLabels, labels: PhotoLabels) -> PhotoPairs:
    """Match labels with true boxes as in `score.count_boxes`."""
    parts = [_pair_kind(number, truth, labels) for number in range(len(BOX_CLASSES))]
    return PhotoPairs(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _pair_kind(number: int, truth: PhotoLabels, labels: PhotoLabels) -> tuple[np.ndarray, ...]:
    true, of_kind = truth.boxes[truth.classes == number], np.flatnonzero(labels.classes == number)
    overlap = iou(true, labels.boxes[of_kind])
    rows, columns = match_by_iou(overlap, MIN_IOU)
    best_rows, best_columns = match_by_summed_iou(overlap)
    unmatched = np.delete(of_kind, columns)
    label_of_true, no_iou = np.full(len(true), _NONE), np.full(len(unmatched), np.nan)
    pair, best = np.full(len(true), np.nan), np.zeros(len(true))
    label_of_true[rows], pair[rows] = of_kind[columns], overlap[rows, columns]
    best[best_rows] = overlap[best_rows, best_columns]
    return (
        np.full(len(true) + len(unmatched), number),
        np.concatenate([label_of_true, unmatched]),
        *(np.concatenate([values, no_iou]) for values in (pair, best)),
        np.concatenate([true, np.full((len(unmatched), 4), np.nan)]),
    )


def pair_labels(
    truth: Mapping[PhotoKey, PhotoLabels],
    table: pd.DataFrame,
    tasks: Mapping[PhotoKey, str | None],
    against: Against,
    usual_exposure_ms: int,
) -> pd.DataFrame:
    """Return a table with the columns of `LABEL_PAIRS` for all photos with a task.

    Photos without a row in the table of labels have no label; photos whose task (see `labels.task_of`) is None are
    excluded. A true box has edges, `truth_px` and `iou_best`; a label has `label_px` and the columns of the label
    table; a pair (`hit`) has all of them.
    """
    keys = [key for key in sorted(truth) if tasks[key] is not None]
    photos = pd.DataFrame([key_columns(key) for key in keys], columns=list(LABEL_COLUMNS[:7]))
    photos["task"] = [tasks[key] for key in keys]
    photos["annotated"] = [shadows_annotated(key, _shadows(truth[key]), against, usual_exposure_ms) for key in keys]
    photo, pairs, row = _pair_photos(keys, truth, table)
    rows = photos.iloc[photo].reset_index(drop=True)
    rows["kind"] = np.array(BOX_CLASSES)[pairs.kind]
    rows["annotated"] = rows["annotated"].astype(bool) & (rows["kind"] == SHADOW)
    rows["iou"], rows["iou_best"] = pairs.iou, pairs.iou_best
    rows[list(TRUE_EDGES)], rows["truth_px"] = pairs.truth, np.sqrt(area(pairs.truth))
    rows["hit"] = rows["iou"].notna()
    return typed(_with_labels(rows, table, row).assign(against=against), LABEL_PAIRS)


def shadows_annotated(key: PhotoKey, true_shadows: int, against: Against, usual_exposure_ms: int) -> bool:
    """Return whether shadows of a photo are annotated: there are true shadows and, in the analog, enough exposure.

    The main annotator of POLAR labelled no shadows below 128 ms, half the usual exposure; another one has no minimum.
    """
    return true_shadows > 0 and (against == "labels" or 2 * key.exposure_ms >= usual_exposure_ms)


def labels_of_photos(table: pd.DataFrame) -> dict[PhotoKey, PhotoLabels]:
    """Return the labels of every photo in a table, in the order of the rows."""
    classes = np.array([BOX_CLASSES.index(str(kind)) for kind in table["kind"]], int)
    boxes = table[list(EDGES)].to_numpy(float)
    return {
        PhotoKey.parse(str(key)): PhotoLabels(classes[rows], boxes[rows])
        for key, rows in table.groupby("key").indices.items()
    }


def _shadows(labels: PhotoLabels) -> int:
    return int((labels.classes == BOX_CLASSES.index(SHADOW)).sum())


def _pair_photos(
    keys: Sequence[PhotoKey], truth: Mapping[PhotoKey, PhotoLabels], table: pd.DataFrame
) -> tuple[np.ndarray, PhotoPairs, np.ndarray]:
    """Return the concatenated pairs of all photos: photos (n,), pairs, rows (n,) of the label table (-1: no label)."""
    labels_of, rows_of = labels_of_photos(table), table.groupby("key").indices
    none, no_rows = PhotoLabels.none(), np.zeros(0, int)
    cached: dict[tuple[bytes, ...], PhotoPairs] = {}  # most photos of an exposure bracket have equal labels
    photo, pairs, row = [no_rows], [pair_photo(none, none)], [no_rows]
    for number, key in enumerate(keys):
        true, labels = truth[key], labels_of.get(key, none)
        content = tuple(array.tobytes() for boxes in (true, labels) for array in (boxes.classes, boxes.boxes))
        if content not in cached:
            cached[content] = pair_photo(true, labels)
        pairs.append(cached[content])
        photo.append(np.full(len(pairs[-1].kind), number))
        row.append(np.append(rows_of.get(str(key), no_rows), _NONE)[pairs[-1].label])
    joined = (np.concatenate([getattr(part, field.name) for part in pairs]) for field in fields(PhotoPairs))
    return np.concatenate(photo), PhotoPairs(*joined), np.concatenate(row)


def _with_labels(pairs: pd.DataFrame, table: pd.DataFrame, row: np.ndarray) -> pd.DataFrame:
    """Append the columns of the given rows (n,) of the label table to the pairs; -1: no label."""
    columns = ["rock", "source", "confidence", *EDGES]
    labels = table[columns].reset_index(drop=True).reindex(row).reset_index(drop=True)
    labels["rock"] = labels["rock"].fillna(NO_ROCK)
    labels["source"] = labels["source"].fillna("")
    labels["label_px"] = np.sqrt(area(labels[list(EDGES)].to_numpy(float)))
    return pairs.join(labels)
