"""Comparison of the labels of two runs on the photos that both runs score, with intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.intervals import RESAMPLES, bootstrap_draws, percentile_interval, resampled_ratios
from polarsim.photo import BOX_CLASSES
from polarsim.report.layout import interval_text, write_table
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.labels import ALL

COLUMNS = (
    "run",
    "kind",
    "task",
    "photos",
    "truth_boxes",
    "f1_first",
    "f1_first_low",
    "f1_first_high",
    "f1",
    "f1_low",
    "f1_high",
    "difference",
    "difference_low",
    "difference_high",
)
CAPTION = "F1 of labels on the photos that both runs score; in brackets 95 % intervals."
NOTE = (
    "{first} is compared with each further run. Photos of seeds of either run are excluded. A task is that of the "
    "further run, for photos with another task in {first}. Intervals: bootstrap over terrain, position and azimuth; "
    "the intervals of differences resample both runs together."
)
_UNIT = ["terrain", "position", "azimuth"]  # labels of a lamp and position are not independent


def compare_labels(runs: Sequence[Path], stem: Path) -> pd.DataFrame:
    """Write stem.{csv,md,tex,parquet} with `COLUMNS`: F1 on common photos of the first run and of each further run.

    Without label scores of a terrain in common, nothing is written and the table is empty.
    """
    first, *others = (_pairs(run) for run in runs)
    names = [run.name for run in runs]
    rows = [{"run": name} | row for name, pairs in zip(names[1:], others, strict=True) for row in _rows(first, pairs)]
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    if len(table):
        write_table(
            stem, table, CAPTION, layout=comparison_layout(table, names[0]), notes=[NOTE.format(first=names[0])]
        )
    return table


def _pairs(run: Path) -> pd.DataFrame:
    """Return by photo and kind: true boxes (`truth`), true boxes and labels (`boxes`), boxes in pairs (`hits`)."""
    parts = [
        read_parquet(path, LABEL_PAIRS.columns) for path in sorted((run / "evaluation").glob("label_pairs_*.parquet"))
    ]
    pairs = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(LABEL_PAIRS.columns))
    is_true, is_label = pairs["truth_px"].notna(), pairs["label_px"].notna()
    counts = pairs.assign(truth=is_true, boxes=is_true.astype(int) + is_label, hits=2 * pairs["hit"].astype(int))
    grouped = counts.groupby(["key", *_UNIT, "task", "kind"], sort=True)[["truth", "boxes", "hits"]].sum()
    return grouped.reset_index()


def _rows(first: pd.DataFrame, other: pd.DataFrame) -> list[dict[str, object]]:
    """Return the rows of two runs: each kind on all common photos, and on photos of each task that differs."""
    tasks = (
        first.groupby("key")["task"].first().to_frame("former").join(other.groupby("key")["task"].first(), how="inner")
    )
    changed = tasks.loc[tasks["former"] != tasks["task"], "task"]
    parts = {ALL: tasks.index, **{str(task): keys.index for task, keys in changed.groupby(changed)}}
    rows: list[dict[str, object]] = []
    for task, keys in parts.items():
        for kind in BOX_CLASSES:
            of_runs = [run[(run["kind"] == kind) & run["key"].isin(keys)] for run in (first, other)]
            if all(len(part) for part in of_runs):
                photos = len(set().union(*(part["key"] for part in of_runs)))
                boxes = int(of_runs[0]["truth"].sum())
                rows.append({"kind": kind, "task": task, "photos": photos, "truth_boxes": boxes} | _scores(of_runs))
    return rows


def _scores(of_runs: Sequence[pd.DataFrame]) -> dict[str, float]:
    """Return F1 = 2 TP / (true boxes + labels) of two runs and the difference, with intervals."""
    units = pd.MultiIndex.from_frame(pd.concat([part[_UNIT] for part in of_runs]).drop_duplicates().sort_values(_UNIT))
    drawn = bootstrap_draws(len(units), RESAMPLES, 0, "compare_labels", len(units))
    values, samples = [], []
    for part in of_runs:
        unit = units.get_indexer(pd.MultiIndex.from_frame(part[_UNIT]))
        hits, boxes = part["hits"].to_numpy(float), part["boxes"].to_numpy(float)
        values.append(hits.sum() / boxes.sum())
        samples.append(resampled_ratios(hits, boxes, unit, drawn))
    found = {
        "f1_first": (values[0], samples[0]),
        "f1": (values[1], samples[1]),
        "difference": (values[1] - values[0], samples[1] - samples[0]),
    }
    row = {}
    for name, (value, sample) in found.items():
        row[name] = float(value)
        row[f"{name}_low"], row[f"{name}_high"] = percentile_interval(np.asarray(sample), len(units))
    return row


def comparison_layout(table: pd.DataFrame, first: str) -> pd.DataFrame:
    """Return the rows of `compare_labels` as texts, values with intervals."""
    rows, others = table.to_dict("records"), list(dict.fromkeys(table["run"]))
    shown = pd.DataFrame({"labels": table["kind"] + ", " + table["task"]})
    if len(others) > 1:
        shown.insert(0, "run", table["run"])
    shown["photos"], shown["true boxes"] = table["photos"], table["truth_boxes"]
    shown[first] = [interval_text(row, "f1_first") for row in rows]
    shown[others[0] if len(others) == 1 else "value of the run"] = [interval_text(row, "f1") for row in rows]
    shown["difference"] = [interval_text(row, "difference", sign="+") for row in rows]
    return shown
