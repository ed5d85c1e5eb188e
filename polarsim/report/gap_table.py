"""Table of the ablation: effect of replacing single components of the twin, largest reduction of the gap first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import paper
from polarsim.report.layout import MISSING, value_and_interval, write_blocks
from polarsim.report.training_seeds import by_splits, over_seeds, seed_notes
from polarsim.schemas.detect import ABLATION
from polarsim.schemas.report import GAP
from polarsim.wording import counted

CAPTION = (
    "Ablation, {kind}s: one component of the {model} twin is replaced at a time (T: detector trained on). "
    "Changes are relative to the unchanged twin, with 95 % intervals; a negative change of IPD reduces the gap."
)
NOTES = (
    "IPD between photos and twins: ipd is the absolute value of the mean difference of IoU, ipd_abs the mean of the "
    "absolute differences, both over the rocks or shadows (pairs) common to photo, twin and changed twin. Both IPDs "
    "of a row use the same bootstrap replicates.",
    "The detectors of the run are not retrained: the ablation measures their response to a component, not the benefit "
    "of training on better twins. Components interact, so changes do not add up.",
    "False positives: rocks predicted in the rock-free area, scaled to the area of a photo.",
)


def tabulate_gap(*, ablation: Path, stem: Path, origin: dict[str, str]) -> None:
    """Write tables/gap.{csv,md,tex,parquet} from gap/ablation.parquet."""
    table = tidy_gap(read_parquet(ablation, ABLATION.columns), origin["source"])
    model = paper.domain_title(str(table["model"].iloc[0]))
    blocks = {
        CAPTION.format(kind=kind, model=model): format_gap(rows) for kind, rows in table.groupby("kind", sort=False)
    }
    blocks["Replaced components."] = table[["component", "replaced"]].drop_duplicates().reset_index(drop=True)
    analog = [paper.ANALOG_PICTURES_NOTE] if origin["source"] == paper.ANALOG else []
    notes = [*analog, *NOTES, *ablation_notes(table), *seed_notes(table)]
    write_blocks(stem, table, blocks, notes, origin)


def tidy_gap(ablation: pd.DataFrame, source: str) -> pd.DataFrame:
    """Return the rows sorted by kind (rocks first), split and the components' mean change of the rocks' `ipd`."""
    table = paper.with_display_names(ablation[list(GAP.columns)], ("trained",), source)
    rocks = table[table["kind"] == ROCK]
    effect = rocks.groupby(["split", "component"])["ipd_change"].mean()
    mean_change = np.array([effect.get(key, 0.0) for key in zip(table["split"], table["component"], strict=True)])
    split, component = (pd.factorize(table[name])[0] for name in ("split", "component"))
    # Components of equal effect keep the order of the configuration.
    keys = (
        table["kind"] != ROCK,
        split,
        mean_change,
        component,
        table["trained"].map(paper.domain_rank),
        table["seed"],
    )
    return paper.sorted_rows(table, *keys)


def format_gap(table: pd.DataFrame) -> pd.DataFrame:
    """Return a row per component and detector, from the rows of one class."""
    rows = []
    for split, split_rows in by_splits(table):
        for (component, trained), part in split_rows.groupby(["component", "trained"], sort=False):
            row = {
                **split,
                "component": str(component),
                "T": paper.domain_title(str(trained)),
                "pairs": over_seeds(part["pairs"], 0),
                "ipd": f"{over_seeds(part['ipd_twin'])} → {over_seeds(part['ipd'])}",
                "change of ipd": change_text(part, "ipd"),
                "change of ipd_abs": change_text(part, "ipd_abs"),
                "change of mAP@0.5": change_text(part, "map50"),
            }
            if (part["kind"] == ROCK).all():
                row["false positives: photos, twin"] = " ".join(
                    over_seeds(part[name], 2) for name in ("false_positives_photo", "false_positives_twin")
                )
                row["change of false positives"] = change_text(part, "false_positives", 2)
                row["change of their area, %"] = change_text(part, "false_positive_area", 2, 100)
            rows.append(row)
    return pd.DataFrame(rows, columns=None if rows else ["component", "T"])


def change_text(part: pd.DataFrame, name: str, decimals: int = 3, factor: float = 1) -> str:
    """Return the change of a metric as text with sign and interval, or with the spread over seeds."""
    values = factor * part[f"{name}_change"]
    if values.isna().all():
        return MISSING
    if len(part) > 1:
        return over_seeds(values, decimals)
    value, low, high = (factor * float(part[f"{name}_change{end}"].iloc[0]) for end in ("", "_low", "_high"))
    return value_and_interval(value, low, high, f"+.{decimals}f")


def ablation_notes(table: pd.DataFrame) -> list[str]:
    """Return a note per detector with split and number of test photos."""
    facts = table[["detector", "epochs", "imgsz", "split", "images", "units", "unit"]].drop_duplicates()
    return [
        f"Detector {detector}, {counted(epochs, 'epoch')} at {imgsz} px; split by {split}; {images} test photos in "
        f"{units} {unit}s."
        for detector, epochs, imgsz, split, images, units, unit in facts.itertuples(index=False)
    ]
