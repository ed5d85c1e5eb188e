"""Tables of detectors of cover photos and of their twins, next to the paper's tables 1 and 2.

CSV and Parquet contain a row per training seed, Markdown and LaTeX the mean over seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.intervals import bootstrap_interval
from polarsim.photo import ROCK, PhotoKey, terrain_text
from polarsim.randomness import generator
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
from polarsim.report.layout import value_and_interval, write_blocks, write_table
from polarsim.report.training_seeds import SEED, seed_means
from polarsim.schemas import detect
from polarsim.schemas.covers import PHOTO_IPD
from polarsim.scoring.appearance import compare_appearance

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
APPEARANCE_CAPTION = "Appearance of the twins of the same photos: median over photos [95 %], and IPD over all rocks."
PHOTOS_NOTE = (
    "Difference: photo minus twin, positive if the twin is harder. Control: twins with invented relief. The CSV and "
    "Parquet files also contain shadows."
)
APPEARANCE_NOTE = (
    "Appearance: PSNR, SSIM and correlation of photo and twin at a quarter of the size after the best increasing tone "
    "curve. Photos are 8-bit images; drawn annotations are not compared. IoU of boxes: mean IoU of human and rendered "
    "boxes of rocks, the performance in photos of a detector that predicts the rendered boxes."
)
_SIDES = ("kind", "split", "trained", "evaluated")
_PAIRS = ("kind", "split", "trained", "first", "second")
_PHOTOS = ("kind", "trained", "key", "twin")
_PHOTO_MEASURES = ("iou_photo", "iou_twin", "difference", "ipd_abs")
_LIKENESS = ("psnr_db", "ssim", "correlation")


def tabulate_real_tables(
    *,
    detection: Path,
    ipd: Path,
    differences: Path,
    photos: Path,
    pictures: Path,
    drawn: Path,
    twins: Mapping[str, Path],
    tables: Path,
    origin: dict[str, str],
) -> None:
    """Write real_detection, real_ipd, real_differences and real_photos, each as {csv,md,tex,parquet}.

    Parameters
    ----------
    photos : Path
        Table of the IPD of each photo, written by `compare_domains`.
    pictures, drawn : Path
        Folders of cover photos, `KEY.png`, and of masks of the lines drawn into them, which are not compared.
    twins : mapping of str to Path
        Folder above `TerrainTT/KEY.png` of each domain of twins.
    """
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

    likeness = appearance_of_twins(pictures, drawn, twins)
    by_photo = tidy_photos(read_parquet(photos, PHOTO_IPD.columns), likeness)
    blocks = {
        APPEARANCE_CAPTION: format_appearance(likeness, pairs, by_photo),
        PHOTOS_CAPTION: format_photos(seed_means(by_photo, _PHOTOS, _PHOTO_MEASURES)),
    }
    notes = [PHOTOS_NOTE, APPEARANCE_NOTE, LABELS_NOTE, *common]
    write_blocks(tables / "real_photos", by_photo, blocks, notes, origin)


def appearance_of_twins(pictures: Path, drawn: Path, twins: Mapping[str, Path]) -> pd.DataFrame:
    """Return a row per photo and domain of twins: key, twin, psnr_db, ssim, correlation."""
    rows = []
    for path in sorted(pictures.glob("*.png")):
        photo, lines = png.read_png(path), png.read_png(drawn / path.name) > 0
        terrain = PhotoKey.parse(path.stem).terrain
        for twin, folder in twins.items():
            compared = compare_appearance(
                photo, png.read_png(folder / f"Terrain{terrain_text(terrain)}" / path.name), lines
            )
            rows.append((path.stem, twin, *(getattr(compared, name) for name in _LIKENESS)))
    return pd.DataFrame(rows, columns=["key", "twin", *_LIKENESS])


def format_appearance(likeness: pd.DataFrame, ipd: pd.DataFrame, photos: pd.DataFrame) -> pd.DataFrame:
    """Return a row per domain of twins: medians over photos with intervals, and the IPD to photos of each detector."""
    rows = []
    boxes = photos[photos["kind"] == ROCK].drop_duplicates(["key", "twin"])
    rocks = ipd[(ipd["kind"] == ROCK) & (ipd["first"] == paper.REAL)]
    for twin, part in likeness.groupby("twin", sort=False):
        row = {"twins": paper.domain_title(str(twin)), "photos": str(len(part))}
        for name, title, decimals in zip(_LIKENESS, ("PSNR, dB", "SSIM", "correlation"), (1, 3, 3), strict=True):
            values = part[name].to_numpy(float)
            random = generator(0, "report", "appearance", name)
            low, high = bootstrap_interval(np.split(values, len(values)), lambda some: float(np.median(some)), random)
            row[title] = value_and_interval(float(np.median(values)), low, high, f".{decimals}f")
        of_twin = boxes[boxes["twin"] == twin]
        row["IoU of boxes"] = f"{np.average(of_twin['label_iou'], weights=of_twin['pairs']):.3f}"
        for trained, found in rocks[rocks["second"] == twin].groupby("trained", sort=False):
            means = found[["ipd", "ipd_abs"]].mean()
            row[f"IPD / IPD_abs, T: {paper.domain_title(str(trained))}"] = f"{means.iloc[0]:.3f} / {means.iloc[1]:.3f}"
        rows.append(row)
    return pd.DataFrame(rows)


def tidy_photos(photos: pd.DataFrame, likeness: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with the appearance of the twin, in the order of kinds and of the paper's domains."""
    photos = photos.merge(likeness, on=["key", "twin"], how="left", validate="many_to_one")
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
