"""Tables of the accuracy of labels by task, kind, terrain, position, azimuth and size, and of their reliability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES, terrain_text
from polarsim.report.layout import MISSING, grid, write_blocks, write_table
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.schemas.report import LABELS
from polarsim.scoring.labels import ALL, ANNOTATED, PROPAGATION_TASKS
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.scoring.reliability import reliability_table

COLUMNS = {name: LABELS.dtypes[name] for name in LABELS.without("seeds")}
KINDS = (*BOX_CLASSES, ANNOTATED)
GROUPS = ("all", "terrain", "position", "azimuth", "size")
SIZE_EDGES_PX = (25, 35, 50, 80, 120)
SIZES = ("<25", "25-35", "35-50", "50-80", "80-120", ">120")  # square root of a box's area, px

RELIABILITY_CAPTION = (
    "Reliability of the labels' confidence: share of correct labels per bin, bins of equal counts, 95 % intervals. "
    "The copies of a label in an exposure bracket count once."
)
NOTE = (
    "Seed photos are excluded. F1: pairs with IoU of at least 0.5; mIoU: mean over true boxes, without threshold. By "
    "size: precision and confidence use the size of the label, recall and mIoU that of the true box, F1 both."
)
_USED = ["kind", "task", *GROUPS[1:4], "hit", "iou_best", "truth_px", "label_px", "confidence"]
_CELL = ["kind", "task", "value"]


def tabulate_labels(
    *,
    azimuths: Sequence[str],
    pairs: Sequence[Path],
    table: Path,
    reliability: Path,
    seeds: str,
    origin: Mapping[str, str],
) -> None:
    """Write the tables of label accuracy and of reliability from the `label_pairs` of the terrains.

    `azimuths` are those of the site, in order. `table` and `reliability` are paths without suffix; `seeds` describes
    the annotations that the run started from.
    """
    all_pairs = pd.concat([read_parquet(path, LABEL_PAIRS.columns) for path in pairs], ignore_index=True)
    rows = label_scores(all_pairs, azimuths)
    compared = " and ".join(TRUTH_NAMES[name] for name in sorted(set(all_pairs["against"]))) or "no reference"
    started = f"Seeds: {seeds}."
    notes = [f"{started} Reference: {compared}. {NOTE}"]
    write_blocks(table, rows.assign(seeds=seeds), format_labels(rows), notes, origin)
    bins = reliability_table(all_pairs)
    shown = bins.assign(labels=bins["labels"].round().astype("int64"))
    bins = bins.assign(seeds=seeds)
    write_table(reliability, bins, RELIABILITY_CAPTION, layout=shown, notes=[started], origin=origin)


def label_scores(pairs: pd.DataFrame, azimuths: Sequence[str]) -> pd.DataFrame:
    """Return a table with `COLUMNS`: a row per kind, task and group that has a box.

    All groups except `size` are properties of the photo. For `size`, true boxes and labels are grouped by box size.
    """
    pairs = pairs[[*_USED, "annotated"]]
    pairs = pd.concat([pairs, pairs[pairs["annotated"]].assign(kind=ANNOTATED)])
    pairs = pd.concat([pairs, pairs.assign(task=ALL)])
    truth, labels = pairs[pairs["truth_px"].notna()], pairs[pairs["label_px"].notna()]
    parts = []
    for group in GROUPS:
        of_truth = truth.assign(value=_values(truth, group, "truth_px")).groupby(_CELL)
        of_labels = labels.assign(value=_values(labels, group, "label_px")).groupby(_CELL)
        true_sums = of_truth.agg(truth_boxes=("hit", "size"), found=("hit", "sum"), iou=("iou_best", "sum"))
        label_sums = of_labels.agg(label_boxes=("hit", "size"), right=("hit", "sum"), confidences=("confidence", "sum"))
        parts.append(true_sums.join(label_sums, how="outer").fillna(0).reset_index().assign(group=group))
    return _sorted(_metrics(pd.concat(parts, ignore_index=True)), azimuths)


def size_class(size_px: np.ndarray) -> np.ndarray:
    """Return the names of the size classes (n,); an edge belongs to the larger class."""
    return np.array(SIZES)[np.searchsorted(SIZE_EDGES_PX, size_px, side="right")]


def format_labels(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the blocks of the Markdown and LaTeX tables by caption: tasks by terrain for each kind, kinds by group."""
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
    return boxes[group].map(terrain_text) if group == "terrain" else boxes[group]


def _metrics(sums: pd.DataFrame) -> pd.DataFrame:
    truth, labels = sums["truth_boxes"], sums["label_boxes"]
    return sums.assign(
        precision=sums["right"] / labels,  # NaN for 0 / 0
        recall=sums["found"] / truth,
        f1=(sums["found"] + sums["right"]) / (truth + labels),
        miou=sums["iou"] / truth,
        confidence=sums["confidences"] / labels,
    )


def _sorted(rows: pd.DataFrame, azimuths: Sequence[str]) -> pd.DataFrame:
    order = {
        "kind": KINDS,
        "task": PROPAGATION_TASKS,
        "group": GROUPS,
        "value": ("all", *sorted(set(rows["value"]) - {*azimuths, *SIZES}), *azimuths, *SIZES),
    }
    ranks = [[values.index(value) for value in rows[name]] for name, values in reversed(order.items())]
    return rows.iloc[np.lexsort(ranks)].reset_index(drop=True).astype(COLUMNS)[list(COLUMNS)]


def _task_block(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row per task: pooled number of true boxes, precision, recall and confidence, then F1 per terrain."""
    pooled = rows[rows["group"] == "all"].set_index("task")
    shown = _cells(rows.assign(value=rows["value"].where(rows["group"] == "all", "T" + rows["value"])), "task")
    for number, name in enumerate(("truth_boxes", "precision", "recall", "confidence"), 1):
        shown.insert(number, name.replace("_", " "), [pooled[name].get(task) for task in shown["task"]])
    return shown


def _cells(rows: pd.DataFrame, side: str) -> pd.DataFrame:
    """Return a row per value of column `side` and a column per value of the group, with cells "F1 (mIoU)"."""
    text = [f"{f1:.3f} ({miou:.3f})" for f1, miou in zip(rows["f1"], rows["miou"], strict=True)]
    return grid(rows, side, [cell.replace("nan", MISSING) for cell in text])
