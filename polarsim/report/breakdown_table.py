"""Detection by what photos and labels are like: size of the label, exposure, azimuth, rover light, terrain."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_of_detectors
from polarsim.report.layout import MISSING, origin_note, with_origin, write_blocks
from polarsim.report.seeds import by_splits, seed_notes, shown

COLUMNS = (
    "trained", "evaluated", "by", "group", "kind", "images", "units", "labels",
    "map50", "map50_low", "map50_high", "map50_95", "map50_95_low", "map50_95_high",
    "iou_mean", "iou_mean_low", "iou_mean_high",
)  # fmt: skip
CAPTIONS = {
    "all": "Detection in all photos: mAP@0.5 [95 %], higher is better (T: trained on, E: evaluated on).",
    "size": "Detection by size of the label's box: mAP@0.5 [95 %].",
    "exposure": "Detection by exposure, ms: mAP@0.5 [95 %].",
    "azimuth": "Detection by the Sun lamp's azimuth, degrees (no: lamp off): mAP@0.5 [95 %].",
    "light": "Detection by rover light: mAP@0.5 [95 %].",
    "terrain": "Detection by terrain: mAP@0.5 [95 %].",
}
SIZES = ("small", "medium", "large")
NOTES = (
    "Sizes are COCO's, of the label's box in a photo of full size: small below 32 x 32 px, medium up to 96 x 96 px, "
    "large above. Predictions on labels of another size are neither right nor wrong.",
    "Average precision: mean over 101 recalls of the highest precision there or beyond. Intervals: bootstrap of views "
    "(terrain, position, camera) or of photos, as the run's option `detect.comparison.resampled` says; none for a "
    "single one.",
)


def tabulate_breakdown(*, breakdown: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/detection_breakdown.{csv,md,tex,parquet} from detect/breakdown.parquet, detectors by `detection`."""
    table = tidy_breakdown(read_parquet(breakdown, COLUMNS), origin["source"])
    notes = [*NOTES, *seed_notes(table), *notes_of_detectors(detection), origin_note(origin)]
    if paper.ANALOG in {*table["trained"], *table["evaluated"]}:
        notes.insert(0, paper.ANALOG_PICTURES_NOTE)
    blocks = {CAPTIONS.get(by, by): format_breakdown(table[table["by"] == by]) for by in dict.fromkeys(table["by"])}
    write_blocks(stem, with_origin(table, origin), blocks or {CAPTIONS["all"]: table}, notes)


def tidy_breakdown(breakdown: pd.DataFrame, source: str) -> pd.DataFrame:
    """Domains by their names in our tables, rows in the paper's order of them."""
    table = paper.with_own_names(breakdown, ("trained", "evaluated"), source)
    ranks = pd.DataFrame({name: table[name].map(paper.rank) for name in ("trained", "evaluated")})
    ranks["by"], ranks["kind"] = table["by"].map(list(CAPTIONS).index), table["kind"].map(KINDS.index)
    ranks["group"] = [SIZES.index(name) if name in SIZES else len(SIZES) for name in table["group"]]
    ranks["name"] = table["group"].astype(str)
    places = ranks.sort_values(["by", "kind", "trained", "evaluated", "group", "name"], kind="stable").index
    return table.loc[places].reset_index(drop=True)


def format_breakdown(table: pd.DataFrame) -> pd.DataFrame:
    """A row a kind, detector and domain, a column a group, of tidy rows of one `by`."""
    groups = list(dict.fromkeys(table["group"]))
    names = ["kind", "trained", "evaluated"]
    rows = []
    for split, matched in by_splits(table):
        for (kind, trained, evaluated), part in matched.groupby(names, sort=False):
            row = split | {"labels": kind, "T": paper.title(str(trained)), "E": paper.title(str(evaluated))}
            for group in groups:
                found = part[part["group"] == group]
                row[str(group)] = shown(found, "map50") if len(found) else MISSING
            rows.append(row)
    return pd.DataFrame(rows)
