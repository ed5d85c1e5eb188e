"""Every true box beside the label that was paired with it, and every label without partner: rows that add up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd

from polarsim.formats.tables import LABEL_COLUMNS, key_columns
from polarsim.geometry.boxes import area, iou, match, match_sum
from polarsim.photo import BOX_CLASSES, NO_ROCK, SHADOW, SHADOWS_ANNOTATED_FROM_MS, PhotoKey
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.metrics import Against
from polarsim.scoring.options import ScoringOptions
from polarsim.scoring.score import Labels

EDGES = ("x0", "y0", "x1", "y1")
TRUE_EDGES = tuple(f"true_{edge}" for edge in EDGES)

_NONE = -1  # in the place of a box that a row does not have


@dataclass(frozen=True)
class PhotoPairs:
    """The boxes of one photo, paired one to one within their kind: a row a true box, then one a label left over."""

    kind: np.ndarray  # (n,) class numbers
    label: np.ndarray  # (n,) indices of the labels, -1: a true box without partner
    iou: np.ndarray  # (n,) of the pair; NaN where there is none
    iou_best: np.ndarray  # (n,) of a true box in the pairing of the largest sum; NaN for a label left over
    truth: np.ndarray  # (n, 4) true boxes; NaN for a label left over


def pair_photo(truth: Labels, labels: Labels, threshold: float) -> PhotoPairs:
    """Pair labels with true boxes as `score.count_boxes` counts them."""
    parts = [_pair_kind(number, truth, labels, threshold) for number in range(len(BOX_CLASSES))]
    return PhotoPairs(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _pair_kind(number: int, truth: Labels, labels: Labels, threshold: float) -> tuple[np.ndarray, ...]:
    true, ours = truth.boxes[truth.classes == number], np.flatnonzero(labels.classes == number)
    overlap = iou(true, labels.boxes[ours])
    rows, columns = match(overlap, threshold)
    best_rows, best_columns = match_sum(overlap)
    left = np.delete(ours, columns)
    no_label, nothing = np.full(len(true), _NONE), np.full(len(left), np.nan)
    pair, best = np.full(len(true), np.nan), np.zeros(len(true))
    no_label[rows], pair[rows] = ours[columns], overlap[rows, columns]
    best[best_rows] = overlap[best_rows, best_columns]
    return (
        np.full(len(true) + len(left), number),
        np.concatenate([no_label, left]),
        *(np.concatenate([values, nothing]) for values in (pair, best)),
        np.concatenate([true, np.full((len(left), 4), np.nan)]),
    )


def pair_labels(
    wanted: Mapping[PhotoKey, Labels],
    table: pd.DataFrame,
    tasks: Mapping[PhotoKey, str | None],
    against: Against,
    options: ScoringOptions,
) -> pd.DataFrame:
    """Rows with the columns of `LABEL_PAIRS` of every photo that has a task.

    Parameters
    ----------
    wanted
        True labels of the photos that are compared.
    table
        Label rows; a photo without row has no label.
    tasks
        What it took to label a photo; None leaves it out.

    Returns
    -------
    DataFrame
        A true box has its edges, `truth_px` and `iou_best`, a label has `label_px` and what its row says, a pair
        (`hit`) has all.
    """
    keys = [key for key in sorted(wanted) if tasks[key] is not None]
    photos = pd.DataFrame([key_columns(key) for key in keys], columns=list(LABEL_COLUMNS[:7]))
    photos["task"] = [tasks[key] for key in keys]
    photos["annotated"] = [shadows_annotated(key, _shadows(wanted[key]), against) for key in keys]
    photo, pairs, row = _pair_photos(keys, wanted, table, options.iou_threshold)
    whole = photos.iloc[photo].reset_index(drop=True)
    whole["kind"] = np.array(BOX_CLASSES)[pairs.kind]
    whole["annotated"] = whole["annotated"].astype(bool) & (whole["kind"] == SHADOW)
    whole["iou"], whole["iou_best"] = pairs.iou, pairs.iou_best
    whole[list(TRUE_EDGES)], whole["truth_px"] = pairs.truth, np.sqrt(area(pairs.truth))
    whole["hit"] = whole["iou"].notna()
    return _with_labels(whole, table, row).assign(against=against).astype(LABEL_PAIRS.dtypes)[list(LABEL_PAIRS.columns)]


def shadows_annotated(key: PhotoKey, true_shadows: int, against: Against) -> bool:
    """Whether people draw shadows in a photo: its truth has some, the analog's from a stated exposure on."""
    return true_shadows > 0 and (against == "labels" or key.exposure_ms >= SHADOWS_ANNOTATED_FROM_MS)


def labels_by_photo(table: pd.DataFrame) -> dict[PhotoKey, Labels]:
    """The labels of every photo that has a row, in the order of the rows."""
    classes = np.array([BOX_CLASSES.index(str(kind)) for kind in table["kind"]], int)
    boxes = table[list(EDGES)].to_numpy(float)
    return {
        PhotoKey.parse(str(key)): Labels(classes[rows], boxes[rows])
        for key, rows in table.groupby("key").indices.items()
    }


def _shadows(labels: Labels) -> int:
    return int((labels.classes == BOX_CLASSES.index(SHADOW)).sum())


def _pair_photos(
    keys: Sequence[PhotoKey], wanted: Mapping[PhotoKey, Labels], table: pd.DataFrame, threshold: float
) -> tuple[np.ndarray, PhotoPairs, np.ndarray]:
    """The pairs of all photos one after another: (n,) photos, pairs, (n,) rows of the label table, -1: no label."""
    found, rows_of = labels_by_photo(table), table.groupby("key").indices
    none, no_rows = Labels.none(), np.zeros(0, int)
    known: dict[tuple[bytes, ...], PhotoPairs] = {}  # most photos of an exposure bracket are copies of one another
    photo, pairs, row = [no_rows], [pair_photo(none, none, threshold)], [no_rows]
    for number, key in enumerate(keys):
        truth, labels = wanted[key], found.get(key, none)
        content = tuple(part.tobytes() for one in (truth, labels) for part in (one.classes, one.boxes))
        if content not in known:
            known[content] = pair_photo(truth, labels, threshold)
        pairs.append(known[content])
        photo.append(np.full(len(pairs[-1].kind), number))
        row.append(np.append(rows_of.get(str(key), no_rows), _NONE)[pairs[-1].label])
    joined = (np.concatenate([getattr(part, field.name) for part in pairs]) for field in fields(PhotoPairs))
    return np.concatenate(photo), PhotoPairs(*joined), np.concatenate(row)


def _with_labels(pairs: pd.DataFrame, table: pd.DataFrame, row: np.ndarray) -> pd.DataFrame:
    """The pairs, and what the label table says in these rows (n,); -1: no label."""
    columns = ["rock", "source", "confidence", *EDGES]
    told = table[columns].reset_index(drop=True).reindex(row).reset_index(drop=True)
    told["rock"] = told["rock"].fillna(NO_ROCK)
    told["source"] = told["source"].fillna("")
    told["label_px"] = np.sqrt(area(told[list(EDGES)].to_numpy(float)))
    return pairs.join(told)
