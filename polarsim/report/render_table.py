"""Table of the similarity of twins to photos and of rendered ground-truth boxes to true boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_csv, read_parquet
from polarsim.report.layout import MISSING, grid, write_blocks
from polarsim.schemas.evaluation import TWIN_PAIRS
from polarsim.schemas.report import RENDER
from polarsim.scoring.metrics import COLUMNS as METRIC_COLUMNS
from polarsim.scoring.metrics import TRUTH_NAMES

COLUMNS = RENDER.dtypes
GROUPS = ("all", "terrain", "position", "azimuth", "light", "camera")
SIMILARITY = ("log2_twin_over_photo", "log2_difference", "ssim")
BOXES = ("f1", "miou")
_BOTH_CAMERAS = ": all"  # suffix of the subjects of box scores over both cameras

NOTE = "Medians over one photo per exposure bracket. A difference of 1 stop is a factor of 2."


def tabulate_render(
    *, pairs: Sequence[Path], evaluation: Sequence[Path], table: Path, origin: Mapping[str, str]
) -> None:
    """Write the table of twins from the terrains' pairs and metric files; `table` is a path without suffix."""
    likeness = pd.concat([read_parquet(path, TWIN_PAIRS.columns) for path in pairs], ignore_index=True)
    scores = pd.concat([read_csv(path, METRIC_COLUMNS) for path in evaluation], ignore_index=True)
    boxes = box_rows(scores)
    rows = pd.concat([similarity_rows(likeness), boxes], ignore_index=True).astype(COLUMNS)
    against = " and ".join(TRUTH_NAMES[name] for name in TRUTH_NAMES if name in set(scores["against"]))
    notes = [NOTE, *([f"Boxes against {against}."] if len(boxes) else [])]
    write_blocks(table, rows, format_table(rows), notes, origin)


def similarity_rows(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return a table with `COLUMNS`: a row per model and group of photos."""
    parts = []
    for group in GROUPS:
        groups = pairs.assign(value="all" if group == "all" else _names(pairs, group)).groupby(["model", "value"])
        medians = groups[list(SIMILARITY)].median().join(groups.size().rename("n")).reset_index()
        parts.append(medians.rename(columns={"model": "subject"}).assign(group=group))
    return pd.concat(parts, ignore_index=True).reindex(columns=list(COLUMNS))


def box_rows(scores: pd.DataFrame) -> pd.DataFrame:
    """Return a table with `COLUMNS`: rendered ground-truth boxes by kind and terrain; n is the number of true boxes."""
    chosen = scores[scores["metric"].isin(BOXES) & scores["subject"].str.endswith(_BOTH_CAMERAS)]
    rows = [
        {
            "subject": str(subject).removesuffix(_BOTH_CAMERAS),
            "group": "terrain",
            "value": f"{terrain:02d}",
            "n": int(part["n"].max()),
            **dict(zip(part["metric"], part["value"], strict=True)),
        }
        for (subject, terrain), part in chosen.groupby(["subject", "terrain"])
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def format_table(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the blocks of the Markdown and LaTeX tables by caption: models by group, then boxes by terrain."""
    pictures, boxes = rows[rows["ssim"].notna()], rows[rows["f1"].notna()]
    blocks = {
        f"Twins by {group}: log2(twin / photo), stops / its absolute value / SSIM.": _cells(
            pictures[pictures["group"].isin(["all", group])], SIMILARITY, ("{:+.2f}", "{:.2f}", "{:.3f}")
        )
        for group in GROUPS[1:]
        if len(pictures)
    }
    if len(boxes):
        blocks["Boxes of twins by terrain: F1 / mIoU."] = _cells(boxes, BOXES, ("{:.3f}", "{:.3f}"))
    return blocks or {"Twins: no photos and no true boxes for a comparison.": rows}


def _cells(rows: pd.DataFrame, metrics: Sequence[str], forms: Sequence[str]) -> pd.DataFrame:
    """Return a row per subject and a column per value of the group."""
    text = [
        " / ".join(MISSING if np.isnan(value) else form.format(value) for value, form in zip(row, forms, strict=True))
        for row in rows[list(metrics)].to_numpy()
    ]
    return grid(rows, "subject", text).rename(columns={"subject": ""})


def _names(pairs: pd.DataFrame, group: str) -> pd.Series:
    return pairs["terrain"].map("{:02d}".format) if group == "terrain" else pairs[group]
