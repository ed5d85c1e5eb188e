"""The table of masks of real cover photos of terrains that their detectors have not seen."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import with_interval
from polarsim.run_files.class_masks import CLASSES
from polarsim.schemas.covers import MASK_SCORES

CAPTION = "Masks of real cover photos of terrains left out, against people's polygons: IoU. Each cell: value [95 %]."
NOTES = (
    "sand: pixels that people painted as ground, rock or shadow; photo: all, what they painted as background counts "
    "as ground. Pixels of all photos are pooled. A class that neither mask nor polygons have has no value.",
    "People copy rocks that lie in the dark from other exposures, and paint the shade of relief and walls as ground.",
    "Intervals: bootstrap over photos. They hold neither for other trainings nor for other machines.",
)


def tabulate_masks(*, scores: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/masks.{csv,md,tex,parquet} from the scores of masks."""
    table = read_parquet(scores, MASK_SCORES.columns)
    write_table(
        stem, with_origin(table, origin), CAPTION, layout=tidy_masks(table), notes=[*NOTES, origin_note(origin)]
    )


def tidy_masks(table: pd.DataFrame) -> pd.DataFrame:
    """A row a region and photo, and one for all photos."""
    rows = []
    for (region, key), part in table.groupby(["region", "key"], sort=False):
        row: dict[str, object] = {"region": region, "photo": key, "photos": int(part["photos"].iloc[0])}
        for kind in CLASSES:
            row[kind] = with_interval(part[part["kind"] == kind].iloc[0], "iou")
        rows.append(row)
    return pd.DataFrame(rows)
