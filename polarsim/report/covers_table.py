"""The table of detectors on real cover photos of terrains that they have not seen."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import with_interval
from polarsim.schemas.covers import COVER_SCORES, FINE_TUNED, MEAN, MERGED, ONE, RENDERED

CAPTION = "Detectors trained on strewn scenes, on real cover photos of terrains left out. Each cell: value [95 %]."
NOTES = (
    "mAP@0.5, and IOU_mean, the mean over labels of the largest IoU with any prediction. Rows of a terrain: of the "
    "detector that has not seen its rocks; all: all photos pooled, each with its own terrain's detector.",
    "Calibration error: expected calibration error of confidences from 0.05 on (how often a box is right, IoU 0.5), "
    "each fold's boxes calibrated by those of all other folds.",
    "Intervals: bootstrap over photos. They hold neither for other trainings nor for other machines.",
)
SEVERAL = (
    "Mean: of the figures of all seeds. Merged: of every fold's detectors of all seeds as one detector, by weighted "
    "boxes fusion: boxes that overlap become one, and one that only one of n detectors finds has an n-th of its "
    "confidence."
)
PHOTOS_TOO = (
    "Scenes, photos: after that {epochs} epochs of {pictures} pictures, windows of the labelled cover photos of all "
    "terrains but those of the tested photo's fold, which show the same sandbox and walls, and of scenes."
)
TRAINED_ON = {RENDERED: "scenes", FINE_TUNED: "scenes, photos"}


def tabulate_covers(*, scores: list[Path], stem: Path, origin: dict[str, str]) -> None:
    """Write tables/covers.{csv,md,tex,parquet} from the scores of the covers stage, a file a way of training."""
    table = pd.concat([read_parquet(path, COVER_SCORES.columns) for path in scores], ignore_index=True)
    first = table.iloc[0]
    trained = (
        f"Detector {first['detector']} from {first['start']}, {first['epochs']} epochs of {first['pictures']} pictures "
        f"of scenes, {first['folds']} folds."
    )
    notes = [*NOTES, trained]
    for photos_too in table[table["trained"] == FINE_TUNED].head(1).to_dict("records"):
        notes.append(PHOTOS_TOO.format_map(photos_too))
    notes += [*([SEVERAL] if _are_several(table) else []), origin_note(origin)]
    write_table(stem, with_origin(table, origin), CAPTION, layout=tidy_covers(table), notes=notes)


def tidy_covers(table: pd.DataFrame) -> pd.DataFrame:
    """A row for all cover photos and one a terrain, for each way of training.

    Of several seeds one for each, their mean and all merged.
    """
    rows = [
        _row(part, several=_are_several(table), fine_tuned=_are_fine_tuned(table))
        for _, of_terrain in table.groupby("terrain", sort=False)
        for _, part in of_terrain.groupby(["trained", "detectors", "seed"], sort=False)
    ]
    return pd.DataFrame(rows)


def _row(part: pd.DataFrame, several: bool, fine_tuned: bool) -> dict[str, object]:
    first = part.iloc[0]
    row: dict[str, object] = {"terrain": first["terrain"]}
    if fine_tuned:
        row["trained on"] = TRAINED_ON[first["trained"]]
    if several:
        row["detectors"] = {ONE: f"seed {first['seed']}", MEAN: "mean", MERGED: "merged"}[first["detectors"]]
    row["photos"] = int(first["images"])
    for kind in BOX_CLASSES:
        own = part[part["kind"] == kind]
        row[f"{kind}s"] = int(own["labels"].iloc[0]) if len(own) else 0
        row[f"{kind}s, mAP@0.5"] = with_interval(own.iloc[0], "map50") if len(own) else ""
    rocks = part[part["kind"] == BOX_CLASSES[0]]
    row["rocks, IOU_mean"] = float(rocks["iou_mean"].mean())
    row["rocks, calibration error"] = float(rocks["calibration_error"].mean())
    return row


def _are_several(table: pd.DataFrame) -> bool:
    return bool((table["detectors"] != ONE).any())


def _are_fine_tuned(table: pd.DataFrame) -> bool:
    return bool((table["trained"] == FINE_TUNED).any())
