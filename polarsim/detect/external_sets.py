"""IPD of an external detector from two sets of labels and predictions (YOLO folders or Parquet tables)."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect.grouping import BOX_COLUMNS, Unit, rows_by
from polarsim.detect.ipd import IpdRules, MissingTreatment, instance_performance, instance_performance_difference
from polarsim.errors import DetectError, FormatError, LabelError
from polarsim.formats import class_lists, release, tables, yolo
from polarsim.geometry import boxes
from polarsim.photo import NO_ROCK, REFERENCE_SIZE_PX, PhotoKey

PAIR_IOU = 0.5


def compare_sets(
    labels: tuple[Path, Path],
    predictions: tuple[Path, Path],
    *,
    confidence: float = 0.25,
    undetected: MissingTreatment = "zero",
    unpaired: MissingTreatment = "left_out",
    missing: MissingTreatment = "left_out",
    unit: Unit | None = None,
    pair_iou: float = PAIR_IOU,
    resamples: int = 1000,
) -> dict[str, Any]:
    """Return IPD and IOU_mean of each class between two sets, and the rules that were applied.

    Parameters
    ----------
    labels, predictions
        Files of the first and the second domain. A folder with a YOLO file per image (predictions with a confidence as
        sixth field), or a Parquet table: key, kind, x0, y0, x1, y1; labels optionally rock, predictions confidence.
        Images are paired by name.
    undetected, unpaired
        See `IpdRules`.
    missing
        Treatment of labelled images without a prediction file or row: `left_out` excludes them from both domains,
        because the detector may not have been run on them; `zero` counts them as images without detections.
    unit
        Unit of the bootstrap; when None, views if all names are photo keys, else photos.
    pair_iou
        Minimum IoU of labels of the same object in both domains, if a set has no rock ids. Labels of a class are
        matched one to one, maximising the number of pairs.
    """
    for path in (*labels, *predictions):
        if not path.exists():
            raise FormatError("no such folder of YOLO files or table", path=path)
    sides = [read_external_labels(path) for path in labels]
    predicted = [read_predictions(path) for path in predictions]
    common = sorted(set(sides[0]["key"]) & set(sides[1]["key"]))
    if not common:
        raise DetectError(f"{labels[0]} and {labels[1]}: no image has labels in both")
    unpredicted = [sorted(set(common) - _predicted_keys(*pair)) for pair in zip(predictions, predicted, strict=True)]
    if missing == "left_out":
        common = sorted(set(common).difference(*unpredicted))
        if not common:
            raise DetectError(f"{predictions[0]} and {predictions[1]}: no labelled image has predictions in both")
        sides = [side[side["key"].isin(common)] for side in sides]
    by_id = all((side["rock"] != NO_ROCK).any() for side in sides)
    if not by_id:
        sides = list(identify(sides[0], sides[1], pair_iou))
    rules = IpdRules(undetected, unpaired, unit or ("view" if all(map(_is_key, common)) else "photo"))
    performances = [instance_performance(*pair, confidence) for pair in zip(sides, predicted, strict=True)]
    report: dict[str, Any] = {
        "pictures": len(common),
        "paired_by": "rock id" if by_id else f"overlap of labels, IoU {pair_iou:g} or more",
        "confidence": confidence,
        **asdict(rules),
        "missing": missing,
        "without_predictions_a": unpredicted[0],
        "without_predictions_b": unpredicted[1],
        "classes": {},
    }
    for kind in sorted(set(sides[0]["kind"]) | set(sides[1]["kind"])):
        of_kind = [performance[performance["kind"] == kind] for performance in performances]
        difference = instance_performance_difference(*of_kind, rules=rules, resamples=resamples)
        summary: dict[str, Any] = {key: value for key, value in asdict(difference).items() if key != "unit"}
        for name, performance in zip(("a", "b"), of_kind, strict=True):
            summary |= {f"labels_{name}": len(performance), f"iou_mean_{name}": float(performance["iou"].mean())}
        report["classes"][kind] = {
            key: None if isinstance(value, float) and np.isnan(value) else value for key, value in summary.items()
        }
    return report


def read_external_labels(path: Path) -> pd.DataFrame:
    """Read key, kind, rock (-1: unknown), x0, y0, x1, y1 from a YOLO folder or a table."""
    if path.is_dir():
        return _read_folder(path)[["key", "kind", *BOX_COLUMNS]].assign(rock=NO_ROCK)
    table = tables.read_parquet(path, ("key", "kind", *BOX_COLUMNS))
    return table if "rock" in table.columns else table.assign(rock=NO_ROCK)


def read_predictions(path: Path) -> pd.DataFrame:
    """Read key, kind, confidence, x0, y0, x1, y1 from a YOLO folder or a table."""
    if not path.is_dir():
        return tables.read_parquet(path, ("key", "kind", "confidence", *BOX_COLUMNS))
    table = _read_folder(path)
    if table["confidence"].isna().any():
        key = table.loc[table["confidence"].isna(), "key"].iloc[0]
        raise DetectError(
            "prediction without confidence, expected 6 fields: class x y width height confidence",
            path=release.box_folder(path) / f"{key}.txt",
        )
    return table


def _predicted_keys(path: Path, predictions: pd.DataFrame) -> set[str]:
    """Return images with predictions. An empty YOLO file counts as an image without detections."""
    return {file.stem for file in release.box_folder(path).glob("*.txt")} if path.is_dir() else set(predictions["key"])


def identify(first: pd.DataFrame, second: pd.DataFrame, pair_iou: float) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return both label tables with ids: matched labels have equal ids, unmatched labels have unique ids."""
    ids = [np.arange(1, len(first) + 1), np.arange(1, len(second) + 1) + len(first)]
    corners = [table[list(BOX_COLUMNS)].to_numpy(float) for table in (first, second)]
    groups = [rows_by(table, ["key", "kind"]) for table in (first, second)]
    for name in groups[0].keys() & groups[1].keys():  # any order, because groups are disjoint
        one, other = (rows[name] for rows in groups)
        rows, columns = boxes.match_by_iou(boxes.iou(corners[0][one], corners[1][other]), pair_iou)
        ids[1][other[columns]] = ids[0][one[rows]]
    return first.assign(rock=ids[0]), second.assign(rock=ids[1])


def _read_folder(folder: Path) -> pd.DataFrame:
    """Read all boxes of a folder. The boxes are in pixels of `REFERENCE_SIZE_PX`; IoU does not depend on the size."""
    folder = release.box_folder(folder)  # `polarsim detect` writes label files to `labels`
    names = class_lists.class_names(folder)
    parts = []
    for path in sorted(folder.glob("*.txt")):
        if path.name == class_lists.CLASS_FILE:
            continue
        numbers, corners, confidence = yolo.read_detections(path, REFERENCE_SIZE_PX)
        kinds = [names[number] if number < len(names) else f"class {number}" for number in numbers]
        columns = dict(zip(BOX_COLUMNS, corners.T, strict=True))
        parts.append(pd.DataFrame({"key": path.stem, "kind": kinds, "confidence": confidence} | columns))
    if not parts:
        raise DetectError("no YOLO file (*.txt)", path=folder)
    return pd.concat(parts, ignore_index=True).astype({"key": "str", "kind": "str"})


def _is_key(name: str) -> bool:
    try:
        PhotoKey.parse(name)
    except LabelError:
        return False
    return True
