"""The table of labels: how good they are by task, kind, terrain, position, azimuth and size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import AZIMUTHS, BOX_CLASSES
from polarsim.report.layout import MISSING, grid, origin_note, with_origin, write_blocks, write_table
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.schemas.report import LABELS
from polarsim.scoring.labels import ALL, ANNOTATED, TASKS
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.scoring.reliability import reliability_table

COLUMNS = {name: LABELS.dtypes[name] for name in LABELS.without("seeds")}
KINDS = (*BOX_CLASSES, ANNOTATED)
GROUPS = ("all", "terrain", "position", "azimuth", "size")
SIZE_EDGES_PX = (25, 35, 50, 80, 120)
SIZES = ("<25", "25-35", "35-50", "50-80", "80-120", ">120")  # square root of a box's area, px

RELIABILITY_CAPTION = (
    "How often labels are right, by their confidence: bins of equal numbers of labels, 95 % intervals. "
    "Copies of a label on the exposures of its exposure bracket count as one."
)
NOTE = (
    "Photos that were seeds are left out. F1 counts pairs with IoU of 0.5 and more; mIoU is over true boxes, without "
    "threshold. Precision and confidence by size go by the label's size, recall and mIoU by the true box's, F1 by both."
)
_USED = ["kind", "task", *GROUPS[1:4], "hit", "iou_best", "truth_px", "label_px", "confidence"]
_CELL = ["kind", "task", "value"]


def tabulate_labels(
    *, pairs: Sequence[Path], table: Path, reliability: Path, seeds: str, origin: Mapping[str, str]
) -> None:
    """Write the tables of labels and of their confidence from the terrains' pairs.

    `table` and `reliability` are stems: four forms each. `seeds` says which drawn labels the run started from.
    """
    whole = pd.concat([read_parquet(path, LABEL_PAIRS.columns) for path in pairs], ignore_index=True)
    rows = label_scores(whole)
    compared = " and ".join(TRUTH_NAMES[name] for name in sorted(set(whole["against"]))) or "nothing"
    started = f"Seeds: {seeds}."
    notes = [f"{started} Against {compared}. {NOTE}", origin_note(origin)]
    write_blocks(table, with_origin(rows.assign(seeds=seeds), origin), format_labels(rows), notes)
    bins = reliability_table(whole)
    shown = bins.assign(labels=bins["labels"].round().astype("int64"))
    marked = with_origin(bins.assign(seeds=seeds), origin)
    write_table(reliability, marked, RELIABILITY_CAPTION, layout=shown, notes=[started, origin_note(origin)])


def label_scores(pairs: pd.DataFrame) -> pd.DataFrame:
    """Rows with `COLUMNS` of every kind, task and group that has a box, out of rows of `label_pairs`.

    Groups go by the photo; `size` goes by the box: truth counts by its own size, labels by theirs.
    """
    pairs = pairs[[*_USED, "annotated"]]
    pairs = pd.concat([pairs, pairs[pairs["annotated"]].assign(kind=ANNOTATED)])
    pairs = pd.concat([pairs, pairs.assign(task=ALL)])
    truth, labels = pairs[pairs["truth_px"].notna()], pairs[pairs["label_px"].notna()]
    parts = []
    for group in GROUPS:
        of_truth = truth.assign(value=_values(truth, group, "truth_px")).groupby(_CELL)
        of_labels = labels.assign(value=_values(labels, group, "label_px")).groupby(_CELL)
        found = of_truth.agg(truth_boxes=("hit", "size"), found=("hit", "sum"), iou=("iou_best", "sum"))
        right = of_labels.agg(label_boxes=("hit", "size"), right=("hit", "sum"), confidences=("confidence", "sum"))
        parts.append(found.join(right, how="outer").fillna(0).reset_index().assign(group=group))
    return _in_order(_metrics(pd.concat(parts, ignore_index=True)))


def size_class(size_px: np.ndarray) -> np.ndarray:
    """(n,) names of the classes that sizes (n,) fall into; an edge belongs to the class above it."""
    return np.array(SIZES)[np.searchsorted(SIZE_EDGES_PX, size_px, side="right")]


def format_labels(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Tables to read by their captions: tasks by terrain for each kind, then kinds by the other groups."""
    by_terrain = rows[rows["group"].isin(["all", "terrain"])]
    blocks = {
        f"Labels, {kind}: F1 (mIoU) by task and terrain.": _task_block(by_terrain[by_terrain["kind"] == kind])
        for kind in KINDS
    }
    for group in GROUPS[2:]:
        chosen = rows[(rows["group"] == group) & (rows["task"] == ALL)]
        unit = ", px" if group == "size" else ""
        blocks[f"Labels, {ALL}: F1 (mIoU) by {group}{unit}."] = _cells(chosen, "kind")
    return blocks


def _values(boxes: pd.DataFrame, group: str, size: str) -> np.ndarray | pd.Series:
    if group == "all":
        return np.full(len(boxes), "all")
    if group == "size":
        return size_class(boxes[size].to_numpy(float))
    return boxes[group].map("{:02d}".format) if group == "terrain" else boxes[group]


def _metrics(sums: pd.DataFrame) -> pd.DataFrame:
    truth, labels = sums["truth_boxes"], sums["label_boxes"]
    return sums.assign(
        precision=sums["right"] / labels,  # 0 / 0 is NaN: it cannot be said
        recall=sums["found"] / truth,
        f1=(sums["found"] + sums["right"]) / (truth + labels),
        miou=sums["iou"] / truth,
        confidence=sums["confidences"] / labels,
    )


def _in_order(rows: pd.DataFrame) -> pd.DataFrame:
    order = {
        "kind": KINDS,
        "task": TASKS,
        "group": GROUPS,
        "value": ("all", *sorted(set(rows["value"]) - {*AZIMUTHS, *SIZES}), *AZIMUTHS, *SIZES),
    }
    ranks = [[values.index(one) for one in rows[name]] for name, values in reversed(order.items())]
    return rows.iloc[np.lexsort(ranks)].reset_index(drop=True).astype(COLUMNS)[list(COLUMNS)]


def _task_block(rows: pd.DataFrame) -> pd.DataFrame:
    """A row a task: number of true boxes, precision, recall, confidence of all, then a column a terrain."""
    pooled = rows[rows["group"] == "all"].set_index("task")
    shown = _cells(rows.assign(value=rows["value"].where(rows["group"] == "all", "T" + rows["value"])), "task")
    for number, name in enumerate(("truth_boxes", "precision", "recall", "confidence"), 1):
        shown.insert(number, name.replace("_", " "), [pooled[name].get(task) for task in shown["task"]])
    return shown


def _cells(rows: pd.DataFrame, side: str) -> pd.DataFrame:
    """A row a value of a column, a column a value of the group, cells "F1 (mIoU)"."""
    text = [f"{f1:.3f} ({miou:.3f})" for f1, miou in zip(rows["f1"], rows["miou"], strict=True)]
    return grid(rows, side, [cell.replace("nan", MISSING) for cell in text])
