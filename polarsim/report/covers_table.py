"""The table of detectors on real cover photos of terrains that they have not seen."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.schemas import COVER_SCORES
from polarsim.formats.tables import read_parquet
from polarsim.photo import BOX_CLASSES
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import seed_notes, shown

CAPTION = (
    "Detectors trained on strewn scenes alone, on real cover photos of terrains left out. Each cell: value [95 %]."
)
NOTES = (
    "mAP@0.5, and IOU_mean, the mean over labels of the largest IoU with any prediction. Rows of a terrain: of the "
    "detector that has not seen its rocks; all: all photos pooled, each with its own terrain's detector.",
    "Calibration error: expected calibration error of confidences from 0.05 on (how often a box is right, IoU 0.5), "
    "each fold's boxes calibrated by those of all other folds.",
    "Intervals: bootstrap over photos. They hold neither for other trainings nor for other machines.",
)


def tabulate_covers(*, scores: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/covers.{csv,md,tex,parquet} from the scores of the covers stage."""
    table = read_parquet(scores, COVER_SCORES.columns)
    first = table.iloc[0]
    trained = (
        f"Detector {first['detector']} from {first['start']}, {first['epochs']} epochs of {first['pictures']} pictures "
        f"of scenes, {first['folds']} folds."
    )
    notes = [*NOTES, trained, *seed_notes(table), origin_note(origin)]
    write_table(stem, with_origin(table, origin), CAPTION, layout=tidy_covers(table), notes=notes)


def tidy_covers(table: pd.DataFrame) -> pd.DataFrame:
    """A row for all cover photos and one a terrain; over seeds mean and deviation, of one seed its intervals."""
    rows = []
    for terrain, part in table.groupby("terrain", sort=False):
        row: dict[str, object] = {"terrain": terrain, "photos": int(part["images"].iloc[0])}
        for kind in BOX_CLASSES:
            own = part[part["kind"] == kind]
            row[f"{kind}s"] = int(own["labels"].iloc[0]) if len(own) else 0
            row[f"{kind}s, mAP@0.5"] = shown(own, "map50") if len(own) else ""
        rocks = part[part["kind"] == BOX_CLASSES[0]]
        row["rocks, IOU_mean"] = float(rocks["iou_mean"].mean())
        row["rocks, calibration error"] = float(rocks["calibration_error"].mean())
        rows.append(row)
    return pd.DataFrame(rows)
