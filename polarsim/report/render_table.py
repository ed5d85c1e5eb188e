"""Table of the brightness of twins over that of photos and of rendered ground-truth boxes against true boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_csv, read_parquet
from polarsim.photo import Terrain, terrain_text
from polarsim.report.layout import MISSING, grid, write_blocks
from polarsim.schemas.evaluation import APPEARANCE_PAIRS
from polarsim.schemas.report import RENDER
from polarsim.scoring.metrics import COLUMNS as METRIC_COLUMNS
from polarsim.scoring.metrics import TRUTH_NAMES
from polarsim.scoring.twin_photos import subject_of

COLUMNS = RENDER.dtypes
GROUPS = ("all", "terrain", "position", "azimuth", "light", "camera")
BRIGHTNESS = ("log2_twin_over_photo", "log2_difference")
BOXES = ("f1", "miou")
_BOTH_CAMERAS = ": all"  # suffix of the subjects of box scores over both cameras

NOTE = "Medians over one photo per exposure bracket. A difference of 1 stop is a factor of 2."


def tabulate_render(
    *, pairs: Sequence[Path], evaluation: Sequence[Path], table: Path, origin: Mapping[str, str]
) -> None:
    """Write the table of twins from the terrains' pairs and metric files; `table` is a path without suffix."""
    likeness = pd.concat([read_parquet(path, APPEARANCE_PAIRS.columns) for path in pairs], ignore_index=True)
    scores = pd.concat([read_csv(path, METRIC_COLUMNS) for path in evaluation], ignore_index=True)
    boxes = box_rows(scores)
    rows = pd.concat([brightness_rows(likeness), boxes], ignore_index=True).astype(COLUMNS)
    against = " and ".join(TRUTH_NAMES[name] for name in TRUTH_NAMES if name in set(scores["against"]))
    notes = [NOTE, *([f"Boxes against {against}."] if len(boxes) else [])]
    write_blocks(table, rows, format_table(rows), notes, origin)


def brightness_rows(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return a table with `COLUMNS`: a row per model, relation to the fits and group of photos with lit pixels."""
    pairs = pairs[pairs["lit_px"] > 0]
    names = [subject_of(*pair) for pair in zip(pairs["model"], pairs["relation"], strict=True)]
    pairs = pairs.assign(subject=pd.Series(names, pairs.index, dtype="str"))
    parts = []
    for group in GROUPS:
        groups = pairs.assign(value=values_of_group(pairs, group)).groupby(["subject", "value"])
        medians = groups[list(BRIGHTNESS)].median().join(groups.size().rename("n")).reset_index()
        parts.append(medians.assign(group=group))
    return pd.concat(parts, ignore_index=True).reindex(columns=list(COLUMNS))


def box_rows(scores: pd.DataFrame) -> pd.DataFrame:
    """Return a table with `COLUMNS`: rendered ground-truth boxes by kind and terrain; n is the number of true boxes."""
    chosen = scores[scores["metric"].isin(BOXES) & scores["subject"].str.endswith(_BOTH_CAMERAS)]
    rows = [
        {
            "subject": str(subject).removesuffix(_BOTH_CAMERAS),
            "group": "terrain",
            "value": terrain_text(cast(Terrain, terrain)),
            "n": int(part["n"].max()),
            **dict(zip(part["metric"], part["value"], strict=True)),
        }
        for (subject, terrain), part in chosen.groupby(["subject", "terrain"])
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def format_table(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the blocks of the Markdown and LaTeX tables by caption: models by group, then boxes by terrain."""
    pictures, boxes = rows[rows["log2_difference"].notna()], rows[rows["f1"].notna()]
    blocks = {
        f"Twins by {group}: log2(twin / photo), stops / its absolute value.": _cells(
            pictures[pictures["group"].isin(["all", group])], BRIGHTNESS, ("{:+.2f}", "{:.2f}")
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


def values_of_group(pairs: pd.DataFrame, group: str) -> pd.Series:
    """Return the value of a group for each row: `all`, the text of the terrain, or a column of the key."""
    if group == "all":
        return pd.Series("all", pairs.index, dtype="str")
    return pairs["terrain"].map(terrain_text).astype("str") if group == "terrain" else pairs[group]
