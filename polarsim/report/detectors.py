"""Tables of a run's detectors, from the tables of the detect stage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report import paper
from polarsim.report.detection_table import KINDS, notes_below, tabulate_detection
from polarsim.report.ipd_table import tabulate_ipd, tabulate_ipd_rocks
from polarsim.report.layout import MISSING, write_blocks, write_table
from polarsim.report.training_seeds import SEED, by_splits, metric_cell, over_seeds
from polarsim.schemas.detect import BREAKDOWN, DIFFERENCES, FALSE_POSITIVES

FALSE_POSITIVE_CAPTION = (
    "False positives: predicted rocks without a rock label, lower is better (T: trained on, E: evaluated on)."
)
FALSE_POSITIVE_NOTES = (
    "A predicted rock is a false positive if its overlap with every rock label is below 10 % of the smaller box. "
    "Minimum confidence: `detect.comparison.iou_confidence`.",
    "Rock-free tiles: tiles of a photo (8 x 4) that no rock label overlaps; rates are scaled to the area of a photo. "
    "Unlabelled rocks count as false positives. In brackets: 95 % bootstrap intervals.",
)
BREAKDOWN_CAPTIONS = {
    "all": "Detection in all photos: mAP@0.5 [95 %], higher is better (T: trained on, E: evaluated on).",
    "size": "Detection by size of the label's box: mAP@0.5 [95 %].",
    "exposure": "Detection by exposure, ms: mAP@0.5 [95 %].",
    "azimuth": "Detection by the Sun lamp's azimuth, degrees (no: lamp off): mAP@0.5 [95 %].",
    "light": "Detection by rover light: mAP@0.5 [95 %].",
    "terrain": "Detection by terrain: mAP@0.5 [95 %].",
}
SIZES = ("small", "medium", "large")
BREAKDOWN_NOTES = (
    "Sizes are COCO's, for label boxes in photos of full size: small below 32 x 32 px, medium up to 96 x 96 px, large "
    "above. Predictions matched to labels of other sizes are ignored.",
    "Average precision: 101-point interpolation. Intervals: bootstrap over views (terrain, position, camera) or "
    "photos, see option `detect.comparison.resampled`; no interval for a single view or photo.",
)
DOMAINS = ("trained", "evaluated", "other_trained", "other_evaluated")
METRIC_TITLES = {"map50": "mAP@0.5", "ipd": "IPD"}
DIFFERENCE_CAPTION = "Paired differences: metric of the first minus metric of the second, with 95 % interval."
DIFFERENCE_NOTE = (
    "Both metrics are computed on the same bootstrap replicates. An interval without 0 shows a significant difference, "
    "even if the intervals of the two metrics overlap. IPD: lower is better."
)


def tabulate_detectors(
    *,
    detection: Path,
    differences: Path,
    breakdown: Path,
    false_positives: Path,
    ipd: Path,
    rocks: Path,
    others: Path | None,
    tables: Path,
    origin: dict[str, str],
) -> None:
    """Write detection, differences, detection_breakdown, false_positives, ipd, ipd_rocks, each as {csv,md,tex,parquet}.

    Notes on the detectors follow each table, see `detection_table.detector_notes`. `others` is the table `detection` of
    detectors of further models.
    """
    common: dict[str, Any] = {"detection": detection, "origin": origin}
    tabulate_detection(**common, others=others, stem=tables / "detection")
    tabulate_differences(**common, differences=differences, stem=tables / "differences")
    tabulate_breakdown(**common, breakdown=breakdown, stem=tables / "detection_breakdown")
    tabulate_false_positives(**common, false_positives=false_positives, stem=tables / "false_positives")
    tabulate_ipd(**common, ipd=ipd, stem=tables / "ipd")
    tabulate_ipd_rocks(**common, rocks=rocks, stem=tables / "ipd_rocks")


def tabulate_false_positives(
    *, false_positives: Path, stem: Path, origin: dict[str, str], detection: Path | None = None
) -> None:
    """Write tables/false_positives.{csv,md,tex,parquet} from detect/false_positives.parquet."""
    table = read_parquet(false_positives, FALSE_POSITIVES.columns)
    table = paper.with_display_names(table, ("trained", "evaluated"), origin["source"])
    table = paper.sorted_rows(
        table, table["region"], *(table[name].map(paper.domain_rank) for name in ("trained", "evaluated"))
    )
    notes = notes_below(table, FALSE_POSITIVE_NOTES, detection)
    shown_table = format_false_positives(table)
    write_table(stem, table, FALSE_POSITIVE_CAPTION, layout=shown_table, notes=notes, origin=origin)


def format_false_positives(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per region, detector and domain."""
    columns = ["where", "T", "E", "terrains", "photos", "per photo", "share of area, %"]
    rows = []
    for split, matched in by_splits(table):
        for (region, trained, evaluated), part in matched.groupby(["region", "trained", "evaluated"], sort=False):
            shares = ["area_share", "area_share_low", "area_share_high"]
            percent = part.assign(**{name: 100 * part[name] for name in shares})
            values = (
                region,
                paper.domain_title(str(trained)),
                paper.domain_title(str(evaluated)),
                str(part["terrains"].iloc[0]),
                int(part["images"].iloc[0]),
                metric_cell(part, "per_photo"),
                metric_cell(percent, "area_share"),
            )
            rows.append(split | dict(zip(columns, values, strict=True)))
    return pd.DataFrame(rows, columns=None if rows else columns)


def tabulate_breakdown(*, breakdown: Path, stem: Path, origin: dict[str, str], detection: Path | None = None) -> None:
    """Write tables/detection_breakdown.{csv,md,tex,parquet} from detect/breakdown.parquet."""
    table = tidy_breakdown(read_parquet(breakdown, BREAKDOWN.columns), origin["source"])
    notes = notes_below(table, BREAKDOWN_NOTES, detection)
    blocks = {BREAKDOWN_CAPTIONS[str(by)]: format_breakdown(part) for by, part in table.groupby("by", sort=False)}
    write_blocks(stem, table, blocks or {BREAKDOWN_CAPTIONS["all"]: table}, notes, origin)


def tidy_breakdown(breakdown: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the rows with the domain names of the tables, in the paper's order of domains."""
    table = paper.with_display_names(breakdown, ("trained", "evaluated"), source)
    domains = (table[name].map(paper.domain_rank) for name in ("trained", "evaluated"))
    sizes = table["group"].map(lambda name: SIZES.index(name) if name in SIZES else len(SIZES))
    order = table["by"].map(list(BREAKDOWN_CAPTIONS).index), table["kind"].map(KINDS.index)
    return paper.sorted_rows(table, *order, *domains, sizes, table["group"].astype(str))


def format_breakdown(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per kind, detector and domain and a column per group, from rows with a single `by`."""
    groups = list(dict.fromkeys(table["group"]))
    names = ["kind", "trained", "evaluated"]
    rows = []
    for split, matched in by_splits(table):
        for (kind, trained, evaluated), part in matched.groupby(names, sort=False):
            row = split | {
                "labels": kind,
                "T": paper.domain_title(str(trained)),
                "E": paper.domain_title(str(evaluated)),
            }
            for group in groups:
                scores = part[part["group"] == group]
                row[str(group)] = metric_cell(scores, "map50") if len(scores) else MISSING
            rows.append(row)
    return pd.DataFrame(rows)


def tabulate_differences(*, differences: Path, detection: Path | None, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/differences.{csv,md,tex,parquet} from detect/differences.parquet."""
    table = tidy_differences(read_parquet(differences, DIFFERENCES.columns), origin["source"])
    resampled = [f"Resampled: {unit}s." for unit in sorted(set(table["unit"].astype(str)))]
    notes = notes_below(table, [DIFFERENCE_NOTE, *resampled], detection, domains=())
    shown_table = format_differences(table)
    write_table(stem, table, DIFFERENCE_CAPTION, layout=shown_table, notes=notes, origin=origin)


def tidy_differences(differences: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the rows sorted by kind (rocks first), metric (mAP first) and the paper's order of domains."""
    table = paper.with_display_names(differences, [*DOMAINS, "against"], source)
    kind, metric = table["kind"].map(KINDS.index), table["metric"].map(list(METRIC_TITLES).index)
    ranks = [table[name].map(paper.domain_rank) for name in ("trained", "against", "evaluated", *DOMAINS[2:])]
    return paper.sorted_rows(table, kind, table["split"], metric, *ranks, table[SEED])


def format_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per comparison: both detectors, both values, the difference with interval."""
    rows = []
    several = len(set(table["split"])) > 1
    for key, part in table.groupby(["kind", "split", "metric", "against", *DOMAINS], sort=False):
        kind, split, metric, against, *sides = map(str, key)
        row = {"labels": kind} | ({"split by": split} if several else {}) | {"metric": METRIC_TITLES[metric]}
        row |= {"first": _side(against, *sides[:2]), "second": _side(against, *sides[2:])}
        row |= {"of the first": over_seeds(part["value"]), "of the second": over_seeds(part["other_value"])}
        rows.append(row | {"difference": metric_cell(part, "difference")})
    return pd.DataFrame(rows)


def _side(against: str, trained: str, evaluated: str) -> str:
    """Return a text such as "Real on Hapke", or "Real on Analog and Hapke" for an IPD of two domains."""
    domains = (
        f"{paper.domain_title(against)} and {paper.domain_title(evaluated)}"
        if against
        else paper.domain_title(evaluated)
    )
    return f"{paper.domain_title(trained)} on {domains}"
