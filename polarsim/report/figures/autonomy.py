"""Figure of the metrics of autonomous drives by mode, for a printed column in greys."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.autonomy_table import with_pose
from polarsim.report.figures.canvas import COLUMN_IN, FAINT, INK, LINE, legend_line, page
from polarsim.run_files.picture_sets import exposure_order, exposure_title, sun_title
from polarsim.schemas.rover import ALL, ANY, AUTONOMY, MODES

PRINTED_PX = 1400
SHOWN = {  # titles of the panels by metric
    "collisions": "Rocks above 10 cm hit per drive",
    "success": "Share of successful drives",
    "both maps": "Map points, of 600",
    "energy over the blind one's": "Energy relative to the blind drive",
}
INSTEAD = {"energy over the blind one's": ("energy", "Energy, J")}  # without blind drives
SUN_MARKERS = {"1": "o", "2": "s", "3": "^", "4": "D", "night": "v", ANY: "_"}
_NAMES_PER_COLUMN = 8  # kinds of drive per printed column
_KEYS_PER_COLUMN = 4  # legend entries per printed column
_MIN_KIND_WIDTH = 10  # of the axis, in mark positions; leaves room for the name of the kind
_FROM_ZERO = {SHOWN["collisions"], SHOWN["success"]}
_MARK = {"linestyle": "", "markersize": 3.2, "markeredgewidth": 0.6}


@dataclass(frozen=True)
class MarkerStyles:
    """Marker shapes of the Suns and greys of the exposures, from white to black."""

    suns: list[str]
    exposures: list[str]

    def of(self, sun: str, exposure: str) -> dict[str, Any]:
        grey = self.exposures.index(exposure) / max(len(self.exposures) - 1, 1) if exposure in self.exposures else 1.0
        return {"marker": SUN_MARKERS[sun], "markerfacecolor": str(1 - grey), "markeredgecolor": INK}


def draw_autonomy(*, together: Path, figure: Path, origin: dict[str, str]) -> None:
    """Draw the metrics by mode, see `draw_modes`."""
    draw_modes(read_parquet(together, AUTONOMY.columns), figure, origin)


def draw_modes(table: pd.DataFrame, figure: Path, origin: dict[str, str], width: int = PRINTED_PX) -> None:
    """Draw a panel per metric, with a mark and an interval over seeds per kind of drive, Sun and exposure.

    The figure has the `width` of a printed column, or of two columns if there are many kinds.
    """
    rows = drive_kinds(table)
    with_sun = rows[rows["sun"] != ANY]
    styles = MarkerStyles(sorted(set(with_sun["sun"])), sorted(set(with_sun["exposure"]), key=exposure_order))
    x, edges, labels = mark_positions(rows)
    rows = rows.assign(x=x)
    columns = 1 if len(labels) <= _NAMES_PER_COLUMN else 2
    with page(figure, columns * width, round(width * 1.45), columns * COLUMN_IN) as sheet:
        axes = sheet.subplots(len(SHOWN), 1, sharex=True)
        for axis, (metric, title) in zip(axes, SHOWN.items(), strict=True):
            part = rows[rows["metric"] == metric]
            if not len(part) and metric in INSTEAD:
                metric, title = INSTEAD[metric]
                part = rows[rows["metric"] == metric]
            _draw_panel(axis, part, styles, title in _FROM_ZERO)
            axis.set_title(title)
            for edge in edges[1:-1]:
                axis.axvline(edge, color=LINE, linewidth=0.6, zorder=0)
        axes[-1].set_xticks([(low + high) / 2 for low, high in pairwise(edges)], labels, fontsize="small")
        axes[-1].set_xlim(edges[0], edges[-1])
        axes[-1].set_xlabel(
            f"source of the hazard map; bars: 95 % intervals over seeds\n({_facts(rows, styles, origin)})"
        )
        _draw_legend(sheet, styles, columns)


def mark_positions(kinds: pd.DataFrame) -> tuple[pd.Series, list[float], list[str]]:
    """Return the x coordinate of each row, the edges between the kinds of drive, and the labels of the kinds.

    Each pair of Sun and exposure of a kind has a position; a gap of one position separates the Suns.
    """
    x, edges, labels = pd.Series(np.nan, kinds.index), [0.0], []
    for kind, part in kinds.groupby("kind", sort=False):
        pairs = set(zip(part["sun"], part["exposure"], strict=True))
        ordered = sorted(pairs, key=lambda pair: (pair[0], exposure_order(pair[1])))
        suns = sorted({sun for sun, _ in ordered})
        position = {key: number + suns.index(key[0]) for number, key in enumerate(ordered)}
        used = max(position.values()) + 1
        width = max(used + 2, _MIN_KIND_WIDTH)
        for key, rows in part.groupby(["sun", "exposure"]):
            x[rows.index] = edges[-1] + width / 2 + position[key] - (used - 1) / 2  # type: ignore[index]
        edges.append(edges[-1] + width)
        labels.append(str(kind).replace(", ", "\n"))
    return x, edges, labels


def drive_kinds(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of single Suns and exposures with column `kind`: mode, and lights and model if they vary."""
    rows = table[(table["sun"] != ALL) & (table["detector"] == table["mode"].map(compared_detectors(table)))]
    levels = rows[["lights", "model"]].replace(ANY, None)
    lights, models = (levels[axis].groupby(rows["mode"]).transform("nunique") for axis in levels)
    kind = pd.Series(map(with_pose, rows["mode"], rows["pose"]), rows.index, dtype=object)
    kind = kind.mask((lights > 1) & (rows["lights"] == "on"), kind + ", lit")
    kind = kind.mask((models > 1) & (rows["model"] != ANY), kind + ", " + rows["model"])
    order = kind.map(lambda name: (MODES.index(name.split(",")[0]), name))
    return rows.assign(kind=kind).loc[order.sort_values(kind="stable").index]


def compared_detectors(table: pd.DataFrame) -> dict[str, str]:
    """Return the detector shown for each mode: `all` if all detectors have drives in the same conditions.

    Otherwise the kinds would be means over different detectors; then the first detector with drives in all conditions
    (Sun, exposure, lights, model, pose) is shown.
    """
    detectors = {}
    for mode, rows in table[table["detector"] != ALL].groupby("mode"):
        names = rows.groupby(["sun", "exposure", "lights", "model", "pose"])["detector"].agg(set)
        every, common = set.union(*names), set.intersection(*names)
        detectors[str(mode)] = ALL if len(every) > 1 and common in (every, set()) else min(common)
    return detectors


def _draw_panel(axis: Any, part: pd.DataFrame, styles: MarkerStyles, from_zero: bool) -> None:
    for row in part.to_dict("records"):
        if np.isfinite(row["low"]):
            axis.plot([row["x"]] * 2, [row["low"], row["high"]], color=FAINT, linewidth=0.7, zorder=1)
        axis.plot(row["x"], row["value"], **styles.of(row["sun"], row["exposure"]), **_MARK)
    axis.tick_params(axis="x", length=0)
    low, high = axis.get_ylim()
    if from_zero:
        axis.set_ylim(-0.05 * max(1.0, high), 1.05 * max(1.0, high))  # room for the marks at 0 and at the maximum
    elif high - low < 0.1 * abs(high):
        axis.set_ylim(low - 0.05 * abs(high), high + 0.05 * abs(high))  # do not magnify small differences


def _facts(rows: pd.DataFrame, styles: MarkerStyles, origin: dict[str, str]) -> str:
    """Return the source of the run, the names of selected detectors, and the exposure if all drives have the same."""
    names = sorted(set(rows["detector"]) - {ANY, ALL})
    exposure = [exposure_title(styles.exposures[0])] if len(styles.exposures) == 1 else []
    return ", ".join([f"source {origin['source']}", *(f"detector {name}" for name in names), *exposure])


def _draw_legend(sheet: Any, styles: MarkerStyles, columns: int) -> None:
    """Draw the legend: marker shapes of the Suns, and greys if there are several exposures."""
    from matplotlib.patches import Patch

    white = {"markerfacecolor": "white"}
    keys = [legend_line(**styles.of(sun, "") | white, **_MARK, label=sun_title(sun)) for sun in styles.suns]
    for exposure in styles.exposures if len(styles.exposures) > 1 else []:
        grey = styles.of(ANY, exposure)["markerfacecolor"]
        keys.append(Patch(facecolor=grey, edgecolor=INK, linewidth=0.6, label=exposure_title(exposure)))
    if keys:
        rows = math.ceil(len(keys) / (columns * _KEYS_PER_COLUMN))
        sheet.legend(
            handles=keys,
            loc="outside lower center",
            ncols=math.ceil(len(keys) / rows),  # Matplotlib fills column by column
            columnspacing=1,
            handletextpad=0.4,
            handlelength=1,
        )
