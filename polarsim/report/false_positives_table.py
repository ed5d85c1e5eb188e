"""The table of false positives: rocks that detectors see where no rock is labelled."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report import paper
from polarsim.report.detection_table import notes_of_detectors
from polarsim.report.layout import origin_note, with_origin, write_table
from polarsim.report.seeds import by_splits, seed_notes, shown

COLUMNS = (
    "trained", "evaluated", "place", "terrains", "images", "units", "photo_areas", "false_positives",
    "per_photo", "per_photo_low", "per_photo_high", "area_share", "area_share_low", "area_share_high",
)  # fmt: skip
CAPTION = "False positives: rocks seen where no rock is labelled, lower is better (T: trained on, E: evaluated on)."
NOTES = (
    "A predicted rock is a false positive if it covers less than a tenth of the smaller one of it "
    "and each rock label; `detect.comparison.iou_confidence` is its least confidence.",
    "Rock-free tiles: of 8 x 4 tiles of each photo those that no rock label reaches into; rates are per whole photo's "
    "area. Rocks that nobody labelled count as false. In brackets 95 % intervals, bootstrapped.",
)


def tabulate_false_positives(
    *, false_positives: Path, stem: Path, origin: dict[str, str], detection: Path | None = None
) -> None:
    """Write tables/false_positives.{csv,md,tex,parquet} from detect/false_positives.parquet, detectors by
    `detection`.
    """
    table = paper.with_own_names(read_parquet(false_positives, COLUMNS), ("trained", "evaluated"), origin["source"])
    table = table.sort_values(
        ["place", "trained", "evaluated"],
        key=lambda column: column if column.name == "place" else column.map(paper.rank),
        kind="stable",
        ignore_index=True,
    )
    notes = [*NOTES, *seed_notes(table), *notes_of_detectors(detection), origin_note(origin)]
    if paper.ANALOG in {*table["trained"], *table["evaluated"]}:
        notes.insert(0, paper.ANALOG_PICTURES_NOTE)
    write_table(stem, with_origin(table, origin), CAPTION, layout=format_false_positives(table), notes=notes)


def format_false_positives(table: pd.DataFrame) -> pd.DataFrame:
    """A row a place, detector and domain."""
    columns = ["where", "T", "E", "terrains", "photos", "per photo", "share of area, %"]
    rows = []
    for split, matched in by_splits(table):
        for (place, trained, evaluated), part in matched.groupby(["place", "trained", "evaluated"], sort=False):
            shares = ["area_share", "area_share_low", "area_share_high"]
            percent = part.assign(**{name: 100 * part[name] for name in shares})
            values = (
                place,
                paper.title(str(trained)),
                paper.title(str(evaluated)),
                str(part["terrains"].iloc[0]),
                int(part["images"].iloc[0]),
                shown(part, "per_photo"),
                shown(percent, "area_share"),
            )
            rows.append(split | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)
