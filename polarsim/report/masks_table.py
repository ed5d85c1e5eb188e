"""Table of the IoU of class masks on real cover photos of held-out terrains."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.training_seeds import interval_text
from polarsim.run_files.class_masks import CLASSES
from polarsim.schemas.covers import MASK_SCORES

CAPTION = "IoU of class masks with annotated polygons, real cover photos of held-out terrains: value [95 % interval]."
NOTES = (
    "Region sand: pixels annotated as ground, rock or shadow. Region photo: all pixels; background counts as ground. "
    "Pixels of all photos are pooled. No value: the class is missing in masks and polygons.",
    "Annotators copy unlit rocks from other exposures and mark shade from relief and walls as ground.",
    "Intervals: bootstrap over photos. They do not include the variation between trainings or machines.",
)


def tabulate_masks(*, scores: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/masks.{csv,md,tex,parquet} from the scores of masks."""
    table = read_parquet(scores, MASK_SCORES.columns)
    write_table(
        stem, with_origin(table, origin), CAPTION, layout=tidy_masks(table), notes=[*NOTES, origin_note(origin)]
    )


def tidy_masks(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per region and photo, and a row per region for all photos."""
    rows = []
    for (region, key), part in table.groupby(["region", "key"], sort=False):
        row: dict[str, object] = {"region": region, "photo": key, "photos": int(part["photos"].iloc[0])}
        for kind in CLASSES:
            row[kind] = interval_text(part[part["kind"] == kind].iloc[0], "iou")
        rows.append(row)
    return pd.DataFrame(rows)
