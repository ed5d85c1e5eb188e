"""Tables of detectors of cover photos and of their twins, next to the paper's tables 1 and 2.

CSV and Parquet contain a row per training seed, Markdown and LaTeX the mean over seeds.
"""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.detection_table import (
    CAPTION as DETECTION_CAPTION,
)
from polarsim.report.detection_table import (
    INTERVAL_CAPTION,
    KINDS,
    MEASURES,
    detector_notes,
    format_detection,
    format_intervals,
    tidy_detection,
)
from polarsim.report.detectors import tabulate_differences
from polarsim.report.ipd_table import CAPTION as IPD_CAPTION
from polarsim.report.ipd_table import FORMULA_NOTE, format_ipd, tidy_ipd
from polarsim.report.layout import write_blocks, write_table
from polarsim.report.training_seeds import SEED, seed_means
from polarsim.schemas import detect
from polarsim.schemas.covers import PHOTO_IPD

LABELS_NOTE = (
    "Photos have human boxes, twins have rendered boxes. IPD compares the rocks with both; rocks without a mesh are "
    "missing in twins and in the IPD. Part of every IPD between photos and twins is the difference of the boxes."
)
PAPER_NOTE = (
    "Paper: YOLOv5 from pre-trained weights, 200 epochs, 1,730 test photos of a random split, rocks only. Here: photos "
    "of terrains excluded from training."
)
PHOTOS_CAPTION = (
    "IPD of each photo: mean IoU of rocks in the photo, and for each domain of twins the mean IoU / mean difference / "
    "mean absolute difference (T: trained on)."
)
PHOTOS_NOTE = (
    "Difference: photo minus twin, positive if the twin is harder. The CSV and Parquet files also contain shadows."
)
_SIDES = ("kind", "split", "trained", "evaluated")
_PAIRS = ("kind", "split", "trained", "first", "second")
_PHOTOS = ("kind", "trained", "key", "twin")
_PHOTO_MEASURES = ("iou_photo", "iou_twin", "difference", "ipd_abs")


def tabulate_real_tables(
    *, detection: Path, ipd: Path, differences: Path, photos: Path, tables: Path, origin: dict[str, str]
) -> None:
    """Write real_detection, real_ipd, real_differences and real_photos, each as {csv,md,tex,parquet}."""
    scores = tidy_detection(read_parquet(detection, detect.DETECTION.columns), origin["source"])
    common = [*detector_notes(scores), *_seed_notes(scores)]
    shown = seed_means(scores, _SIDES, MEASURES)
    unit = str(scores["unit"].iloc[0])
    blocks = {DETECTION_CAPTION: format_detection(shown), INTERVAL_CAPTION.format(unit): format_intervals(shown)}
    write_blocks(tables / "real_detection", scores, blocks, [PAPER_NOTE, *common], origin)

    pairs = tidy_ipd(read_parquet(ipd, detect.IPD.columns), origin["source"])
    shown = format_ipd(seed_means(pairs, _PAIRS, ("ipd", "ipd_abs")))
    notes = [FORMULA_NOTE, LABELS_NOTE, PAPER_NOTE, *common]
    write_table(tables / "real_ipd", pairs, IPD_CAPTION, layout=shown, notes=notes, origin=origin)

    stem = tables / "real_differences"
    tabulate_differences(differences=differences, detection=detection, stem=stem, origin=origin)

    by_photo = tidy_photos(read_parquet(photos, PHOTO_IPD.columns))
    shown = format_photos(seed_means(by_photo, _PHOTOS, _PHOTO_MEASURES))
    notes = [PHOTOS_NOTE, LABELS_NOTE, *common]
    write_table(tables / "real_photos", by_photo, PHOTOS_CAPTION, layout=shown, notes=notes, origin=origin)


def tidy_photos(photos: pd.DataFrame) -> pd.DataFrame:
    """Return the rows in the order of kinds and of the paper's domains."""
    domains = (photos[name].map(paper.domain_rank) for name in ("trained", "twin"))
    return paper.sorted_rows(photos, photos["kind"].map(KINDS.index), *domains, photos["key"], photos[SEED])


def format_photos(photos: pd.DataFrame) -> pd.DataFrame:
    """Return a row per detector and photo and a column per domain of twins, for rocks."""
    rows = []
    of_rocks = photos[photos["kind"] == ROCK]
    for (trained, key), part in of_rocks.groupby(["trained", "key"], sort=False):
        row: dict[str, object] = {"T": paper.domain_title(str(trained)), "photo": str(key)}
        row |= {"rocks": int(part["pairs"].max()), "in the photo": float(part["iou_photo"].iloc[0])}
        for twin, iou, difference, ipd_abs in part[["twin", *_PHOTO_MEASURES[1:]]].itertuples(index=False):
            row[paper.domain_title(str(twin))] = f"{iou:.3f} / {difference:+.3f} / {ipd_abs:.3f}"
        rows.append(row)
    return pd.DataFrame(rows)


def _seed_notes(scores: pd.DataFrame) -> list[str]:
    seeds = sorted(scores[SEED].unique())
    if len(seeds) < 2:
        return []
    return [
        f"Mean over n = {len(seeds)} trainings with seeds {', '.join(map(str, seeds))}; intervals: minimum and maximum "
        "over the 95 % intervals of all trainings. The CSV and Parquet files contain each training."
    ]
