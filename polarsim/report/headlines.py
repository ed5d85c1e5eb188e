"""The five most important metrics of a run with intervals, for the top of the results page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_csv
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.schemas.evaluation import IN_PLACE
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.wording import counted, enumerated

MAX_HEADLINES = 5
Tables = Mapping[str, Path]


@dataclass(frozen=True)
class Headline:
    """A metric with interval and explanation, as text."""

    title: str
    value: str
    interval: str
    meaning: str
    table: str  # table with details


def headlines(tables: Tables, photo_domain: str, source: str) -> list[Headline]:
    """Return the first `MAX_HEADLINES` metrics that a run has.

    `tables` are CSV files by name; `photo_domain` is empty if the run has no photos.
    """
    of_detectors = [*_detection(tables, photo_domain, source), *_ipd(tables, photo_domain, source)]
    return [*of_detectors, *_evaluation(tables)][:MAX_HEADLINES]


def _detection(tables: Tables, photo_domain: str, source: str) -> Iterator[Headline]:
    """Yield mAP@0.5 of rocks in photos, of the detector trained on photos and the best detector trained on twins."""
    if "detection" not in tables:
        return
    rows = read_csv(tables["detection"])
    rows = rows[(rows["kind"] == ROCK) & (rows["evaluated"] == photo_domain) & rows["map50"].notna()]
    first = (
        rows[(rows["split"] == rows["split"].iloc[0]) & (rows["seed"] == rows["seed"].iloc[0])] if len(rows) else rows
    )
    on_photos, on_twins = first[first["trained"] == photo_domain], first[first["trained"] != photo_domain]
    chosen = [(on_photos.iloc[0], "")] if len(on_photos) else []
    if len(on_twins):
        best = on_twins.sort_values("map50", kind="stable").iloc[-1]
        chosen.append((best, _selection("best", len(on_twins), "detectors")))
    for row, selection in chosen:
        trained = paper.domain_title(paper.display_name(str(row["trained"]), source))
        yield Headline(
            f"Rock detection in photos, trained on {trained}", f"{row['map50']:.2f}", _interval(row, "map50", 2),
            f"mAP@0.5, 95 % interval over {row['units']} {row['unit']}s; split by {row['split']}{selection}",
            "detection",
        )  # fmt: skip


def _ipd(tables: Tables, photo_domain: str, source: str) -> Iterator[Headline]:
    """Yield the IPD between photos and the twins with the smallest IPD, of the detector trained on photos."""
    if "ipd" not in tables:
        return
    rows = read_csv(tables["ipd"])
    of_photos = (rows["first"] == photo_domain) | (rows["second"] == photo_domain)
    rows = rows[(rows["kind"] == ROCK) & (rows["trained"] == photo_domain) & of_photos & rows["ipd"].notna()]
    if len(rows):
        row = rows.sort_values("ipd", kind="stable").iloc[0]
        twin = next(str(row[name]) for name in ("first", "second") if row[name] != photo_domain)
        yield Headline(
            f"IPD, photos and {paper.domain_title(paper.display_name(twin, source))} twins", f"{row['ipd']:.3f}",
            _interval(row, "ipd", 3),
            f"difference of mean IoU of rocks (0: no gap), 95 % interval over {row['units']} {row['unit']}s"
            f"{_selection('smallest', len(rows), 'values')}", "ipd",
        )  # fmt: skip


def _selection(which: str, count: int, what: str) -> str:
    """Return a note that a metric is the extreme of several, or an empty text."""
    return f"; {which} of {count} {what}" if count > 1 else ""


# stage, beginning of the subject, metric, title, factor, decimals, unit, explanation
_STAGE_METRICS = (
    ("labels", "rock: all but seeds", "f1", "Propagated rock labels, F1", 1, 3, "", "boxes other than seeds, IoU 0.5"),
    ("rocks", "paired rocks", "surface_distance_median", "Error of rock surfaces", 1, 2, " mm", "median distance"),
    ("cameras", "worst position", "position_error_aligned", "Camera position error", 1, 2, " mm", "worst position"),
    ("cameras", "", "median_off_px", "Offset of photos from meshes", 1, 2, " px", "median over image windows"),
    ("render", "hapke", "log2_difference", "Brightness error of twins", 1, 2, " stops", "median, twin against photo"),
    ("consistency", "left and right", "across_rows", "Vertical stereo offset", 1, 2, " px", "left and right photos"),
    ("consistency", "shadow edges of walls", "edge_mm_median", "Shadow edges of walls", 1, 0, " mm", "on sand"),
    ("consistency", "", "iou_lost", "IoU lost between boxes and meshes", 1, 3, "", "left to right camera"),
    ("rocks", "rock meshes", "watertight_share", "Watertight rock meshes", 100, 0, " %", "share of the meshes"),
)  # fmt: skip


def _evaluation(tables: Tables) -> Iterator[Headline]:
    """Yield the metrics of the stages: median and range over terrains and positions."""
    if "evaluation" not in tables:
        return
    rows = read_csv(tables["evaluation"])
    for stage, subject, metric, title, factor, decimals, unit, meaning in _STAGE_METRICS:
        matching = rows[(rows["stage"] == stage) & (rows["metric"] == metric) & rows["value"].notna()]
        subjects = matching["subject"].astype(str)
        matching = matching[subjects.str.startswith(subject) & ~subjects.str.endswith(f", {IN_PLACE}")]
        if len(matching):
            values = factor * matching["value"].astype(float)
            low, middle, high = (f"{value:.{decimals}f}" for value in (values.min(), values.median(), values.max()))
            names = sorted({*matching["against"].astype(str)} - {"own"})  # own: values of the run itself
            against = f"; against {enumerated(TRUTH_NAMES.get(name, name) for name in names)}" if names else ""
            yield Headline(
                title, f"{middle}{unit}", f"{low} to {high}",
                f"{meaning}; median and range over {_counts(matching)}{against}", "evaluation",
            )  # fmt: skip


def _counts(rows: pd.DataFrame) -> str:
    terrains = rows["terrain"].nunique()
    counts = f"{len(rows)} values, " if len(rows) > terrains else ""
    return f"{counts}{counted(terrains, 'terrain')}"


def _interval(row: pd.Series, name: str, decimals: int) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return "no interval: single unit" if pd.isna(low) else f"{low:.{decimals}f} to {high:.{decimals}f}"
