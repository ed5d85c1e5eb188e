"""Figure of the ablation: change of IPD and of false positives per replaced component of the twin."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.photo import ROCK
from polarsim.report import gap_table, paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, INK, SERIES, figure_title, note, page
from polarsim.report.training_seeds import seed_means, split_panels, title_suffix
from polarsim.schemas.detect import ABLATION

PANELS = {
    "ipd": "change of IPD\n|mean difference|",
    "ipd_abs": "change of IPD\nmean |difference|",
    "false_positives": "change of false positives\nper image",
}
_THICK = 0.8  # total thickness of the bars of one component


def draw_gap(*, ablation: Path, figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Write bars of rocks with 95 % intervals: a group per component, a colour per detector, a row per split.

    Several seeds are averaged; the whiskers then range from the minimum to the maximum of all intervals.
    """
    table = gap_table.tidy_gap(read_parquet(ablation, ABLATION.columns), origin["source"])
    rocks = table[(table["kind"] == ROCK) & table["ipd"].notna()]
    splits = split_panels(rocks)
    components = list(dict.fromkeys(rocks["component"]))
    height = round(width * (0.16 + 0.035 * max(4, len(components))))
    with page(figure, width, height * len(splits)) as sheet:
        if not len(rocks):
            note(sheet, "no rock is labelled in photos and in twins")
            return
        model = paper.domain_title(str(rocks["model"].iloc[0]))
        title = f"source {origin['source']}{title_suffix(rocks)}; whiskers: 95 % intervals"
        figure_title(sheet, f"Effect of replacing a component of the {model} twin, rocks, {title}")
        grid = sheet.subplots(len(splits), len(PANELS), sharey=True, squeeze=False)
        for row, (split, rows) in zip(grid, splits, strict=True):
            means = seed_means(rows, ("component", "trained"), [f"{name}_change" for name in PANELS])
            for axes, (name, text) in zip(row, PANELS.items(), strict=True):
                _draw_panel(axes, means, components, name)
                axes.set_xlabel(text)
            if len(splits) > 1:
                row[0].set_ylabel(f"split by {split}")
        grid[0, 0].set_yticks(range(len(components)), components)
        grid[0, 0].invert_yaxis()
        handles, labels = grid[0, 0].get_legend_handles_labels()
        sheet.legend(handles, labels, ncols=len(labels), loc="outside lower right")


def _draw_panel(axes: Any, rocks: pd.DataFrame, components: list[str], name: str) -> None:
    detectors = paper.sorted_domains(set(rocks["trained"]))
    for number, trained in enumerate(detectors):
        rows = rocks[rocks["trained"] == trained].set_index("component").reindex(components)
        value = rows[f"{name}_change"].to_numpy(float)
        bounds = rows[[f"{name}_change_low", f"{name}_change_high"]].to_numpy(float).T
        errors = np.nan_to_num(np.abs(bounds - value))
        y = np.arange(len(components)) + _THICK * ((number + 0.5) / len(detectors) - 0.5)
        gap = rows[f"{name}_twin"].iloc[0] if name != "false_positives" else np.nan
        text = f"detector trained on {paper.domain_title(trained)}" + (
            "" if np.isnan(gap) else f" (IPD of the unchanged twin {gap:.3f})"
        )
        thickness = 0.9 * _THICK / len(detectors)
        axes.barh(y, value, thickness, xerr=errors, color=SERIES[number], ecolor=INK, capsize=3, label=text)
    axes.axvline(0, color=INK, linewidth=1)
    axes.grid(visible=True, axis="x")
    axes.tick_params(axis="y", length=0)
