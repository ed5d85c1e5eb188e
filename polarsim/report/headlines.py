"""The five metrics that a reader wants first, each with an interval."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_csv
from polarsim.photo import ROCK
from polarsim.report import paper

MOST = 5
Tables = Mapping[str, Path]


@dataclass(frozen=True)
class Headline:
    """A metric, the ends of its interval, and what both are."""

    title: str
    value: str
    interval: str
    meaning: str
    table: str  # that has more of it


def headlines(tables: Tables, photo_domain: str, source: str) -> list[Headline]:
    """The first five of those that a run has measured.

    Parameters
    ----------
    tables
        CSV forms of the run's tables by name.
    photo_domain
        Domain of the run's photos; empty where it has none.
    """
    of_detectors = [*_detection(tables, photo_domain, source), *_ipd(tables, photo_domain, source)]
    return [*of_detectors, *_evaluation(tables)][:MOST]


def _detection(tables: Tables, photo_domain: str, source: str) -> Iterator[Headline]:
    """mAP@0.5 of rocks in photos: detectors trained on photos, and on the twins that do best there."""
    if "detection" not in tables:
        return
    rows = read_csv(tables["detection"])
    rows = rows[(rows["kind"] == ROCK) & (rows["evaluated"] == photo_domain) & rows["map50"].notna()]
    first = (
        rows[(rows["split"] == rows["split"].iloc[0]) & (rows["seed"] == rows["seed"].iloc[0])] if len(rows) else rows
    )
    own, others = first[first["trained"] == photo_domain], first[first["trained"] != photo_domain]
    chosen = [own.iloc[0]] if len(own) else []
    chosen += [others.sort_values("map50", kind="stable").iloc[-1]] if len(others) else []
    for row in chosen:
        trained = paper.title(paper.own_name(str(row["trained"]), source))
        yield Headline(
            f"Rocks found in photos, trained on {trained}", f"{row['map50']:.2f}", _between(row, "map50", 2),
            f"mAP@0.5, 95 % interval over {row['units']} {row['unit']}s; split by {row['split']}", "detection",
        )  # fmt: skip


def _ipd(tables: Tables, photo_domain: str, source: str) -> Iterator[Headline]:
    """How differently the photos' detector sees photos and their nearest twins."""
    if "ipd" not in tables:
        return
    rows = read_csv(tables["ipd"])
    of_photos = (rows["first"] == photo_domain) | (rows["second"] == photo_domain)
    rows = rows[(rows["kind"] == ROCK) & (rows["trained"] == photo_domain) & of_photos & rows["ipd"].notna()]
    if len(rows):
        row = rows.sort_values("ipd", kind="stable").iloc[0]
        twin = next(str(row[name]) for name in ("first", "second") if row[name] != photo_domain)
        yield Headline(
            f"IPD, photos and {paper.title(paper.own_name(twin, source))} twins", f"{row['ipd']:.3f}",
            _between(row, "ipd", 3),
            f"difference of rocks' mean IoU (0: seen alike), 95 % interval over {row['units']} {row['unit']}s", "ipd",
        )  # fmt: skip


# stage, beginning of the subject, metric, title, factor, decimals, unit, what it is
_OF_STAGES = (
    ("labels", "rock: all but seeds", "f1", "Propagated rock labels, F1", 1, 3, "", "boxes that nobody drew, IoU 0.5"),
    ("rocks", "paired rocks", "surface_distance_median", "Surface of rock meshes", 1, 2, " mm", "median distance"),
    ("cameras", "worst position", "position_error_aligned", "Cameras' places", 1, 2, " mm", "of the worst position"),
    ("cameras", "", "median_off_px", "Photos against shaded meshes", 1, 2, " px", "median distance of windows"),
    ("render", "hapke", "log2_difference", "Twins' brightness", 1, 2, " stops", "median difference from the photo"),
    ("consistency", "left and right", "across_rows", "Left against right photos", 1, 2, " px", "across the rows"),
    ("consistency", "", "iou_lost", "Boxes against meshes, IoU lost", 1, 3, "", "left to right"),
    ("rocks", "rock meshes", "watertight_share", "Watertight rock meshes", 100, 0, " %", "share of the meshes"),
)  # fmt: skip


def _evaluation(tables: Tables) -> Iterator[Headline]:
    """Medians over terrains and positions, with the lowest and highest."""
    if "evaluation" not in tables:
        return
    rows = read_csv(tables["evaluation"])
    for stage, subject, metric, title, factor, decimals, unit, meaning in _OF_STAGES:
        ours = rows[(rows["stage"] == stage) & (rows["metric"] == metric) & rows["value"].notna()]
        ours = ours[ours["subject"].astype(str).str.startswith(subject)]
        if len(ours):
            values = factor * ours["value"].astype(float)
            low, middle, high = (f"{value:.{decimals}f}" for value in (values.min(), values.median(), values.max()))
            against = sorted(set(ours["against"].astype(str)))
            yield Headline(
                title, f"{middle}{unit}", f"{low} to {high}",
                f"{meaning}; median and range over {_counted(ours)}; against {', '.join(against)}", "evaluation",
            )  # fmt: skip


def _counted(rows: pd.DataFrame) -> str:
    terrains = rows["terrain"].nunique()
    counts = f"{len(rows)} values, " if len(rows) > terrains else ""
    return f"{counts}{terrains} terrain{'s' if terrains > 1 else ''}"


def _between(row: pd.Series, name: str, decimals: int) -> str:
    low, high = row[f"{name}_low"], row[f"{name}_high"]
    return "no interval: one unit" if pd.isna(low) else f"{low:.{decimals}f} to {high:.{decimals}f}"
