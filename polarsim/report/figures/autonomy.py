"""Modes of a rover that finds its own way side by side, and its ways over the rocks that lay there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats.npz import read_arrays
from polarsim.formats.tables import read_parquet
from polarsim.report.figures.canvas import COLUMN_IN, FAINT, FIGURE_WIDTH, INK, LINE, SERIES, heading, legend_line, page
from polarsim.run_files.picture_sets import exposure_order, exposure_title, sun_title
from polarsim.schemas.rover import ALL, ANY, AUTONOMY, HIGH_M, MODES

PRINTED_PX = 1400
SHOWN = {  # the first that the table has, as a panel's title says it
    "collisions": "Rocks above 10 cm hit, a drive",
    "success": "Share of drives that succeed",
    "both maps": "Map points, of 600",
    "energy over the blind one's": "Energy over the blind drive's",
}
INSTEAD = {"energy over the blind one's": ("energy", "Energy, J")}  # where nothing drove blind
_SUNS = {"1": "o", "2": "s", "3": "^", "4": "D", "night": "v", ANY: "_"}
_IN_A_COLUMN = 8  # kinds whose names a column of print holds
_IN_A_ROW = 4  # keys of the legend that a column of print holds
_LEAST_ROOM = 10  # places: a name has room above
_FROM_ZERO = {"Rocks above 10 cm hit, a drive", "Share of drives that succeed"}
_MARK = {"linestyle": "", "markersize": 3.2, "markeredgewidth": 0.6}


@dataclass(frozen=True)
class Looks:
    """What Suns and exposures look like: shapes, and greys from white to black."""

    suns: list[str]
    exposures: list[str]

    def of(self, sun: str, exposure: str) -> dict[str, Any]:
        grey = self.exposures.index(exposure) / max(len(self.exposures) - 1, 1) if exposure in self.exposures else 1.0
        return {"marker": _SUNS[sun], "markerfacecolor": str(1 - grey), "markeredgecolor": INK}


def draw_autonomy(
    *,
    folders: Sequence[Path],
    together: Path,
    figure: Path,
    ways: Path,
    origin: dict[str, str],
    width: int = PRINTED_PX,
    ways_width: int = FIGURE_WIDTH,
) -> None:
    """Draw `figure`, modes side by side, for a column of print in greys, and `ways`, the drives of the first seed."""
    draw_modes(read_parquet(together, AUTONOMY.columns), figure, origin, width)
    draw_ways(folders, ways, origin, ways_width)


def draw_modes(table: pd.DataFrame, figure: Path, origin: dict[str, str], width: int = PRINTED_PX) -> None:
    """A panel a figure, in it a mark for every kind of drive, Sun and exposure, with its interval over seeds.

    For a column of print `width` wide, or two where there are many kinds.
    """
    own = kinds_of(table)
    seen = own[own["sun"] != ANY]
    looks = Looks(sorted(set(seen["sun"])), sorted(set(seen["exposure"]), key=exposure_order))
    places, edges, labels = placed(own)
    own = own.assign(x=places)
    columns = 1 if len(labels) <= _IN_A_COLUMN else 2
    with page(figure, columns * width, round(width * 1.45), columns * COLUMN_IN) as sheet:
        axes = sheet.subplots(len(SHOWN), 1, sharex=True)
        for axis, (metric, title) in zip(axes, SHOWN.items(), strict=True):
            part = own[own["metric"] == metric]
            if not len(part) and metric in INSTEAD:
                metric, title = INSTEAD[metric]
                part = own[own["metric"] == metric]
            _draw_panel(axis, part, looks, title in _FROM_ZERO)
            axis.set_title(title)
            for edge in edges[1:-1]:
                axis.axvline(edge, color=LINE, linewidth=0.6, zorder=0)
        axes[-1].set_xticks([(low + high) / 2 for low, high in pairwise(edges)], labels, fontsize="small")
        axes[-1].set_xlim(edges[0], edges[-1])
        axes[-1].set_xlabel(f"what the rover goes by\n({_told(own, looks, origin)})")
        _draw_legend(sheet, looks, columns)


def placed(kinds: pd.DataFrame) -> tuple[pd.Series, list[float], list[str]]:
    """Where each row lies along the axis, the edges of the kinds' rooms, and the kinds' names.

    A kind has a place a Sun and exposure, Suns a place apart; a kind without has room for its name.
    """
    x, edges, labels = pd.Series(np.nan, kinds.index), [0.0], []
    for kind, part in kinds.groupby("kind", sort=False):
        pairs = set(zip(part["sun"], part["exposure"], strict=True))
        own = sorted(pairs, key=lambda pair: (pair[0], exposure_order(pair[1])))
        suns = sorted({sun for sun, _ in own})
        place = {key: number + suns.index(key[0]) for number, key in enumerate(own)}
        wide = max(place.values()) + 1
        room = max(wide + 2, _LEAST_ROOM)
        for key, rows in part.groupby(["sun", "exposure"]):
            x[rows.index] = edges[-1] + room / 2 + place[key] - (wide - 1) / 2  # type: ignore[index]
        edges.append(edges[-1] + room)
        labels.append(str(kind).replace(", ", "\n"))
    return x, edges, labels


def kinds_of(table: pd.DataFrame) -> pd.DataFrame:
    """Rows of single Suns and exposures with their `kind`: mode, lights and model where there are several of these."""
    own = table[(table["sun"] != ALL) & (table["detector"] == table["mode"].map(compared_detectors(table)))]
    both, models = (own.groupby("mode")[axis].transform("nunique") > 1 for axis in ("lights", "model"))
    kind = own["mode"].where(~both | (own["lights"] == "off"), own["mode"] + ", lit")
    kind = kind.where(~models, kind + ", " + own["model"])
    order = kind.map(lambda name: (MODES.index(name.split(",")[0]), name))
    return own.assign(kind=kind).loc[order.sort_values(kind="stable").index]


def compared_detectors(table: pd.DataFrame) -> dict[str, str]:
    """Of each mode the detector whose drives are shown, so that kinds compare: `all` of several, if these drove alike.

    Where one drove in light, by lights or in a model in which others did not, it is the first that drove in all.
    """
    found = {}
    for mode, own in table[table["detector"] != ALL].groupby("mode"):
        names = own.groupby(["sun", "exposure", "lights", "model"])["detector"].agg(set)
        every, common = set.union(*names), set.intersection(*names)
        found[str(mode)] = ALL if len(every) > 1 and common in (every, set()) else min(common)
    return found


def _draw_panel(axis: Any, part: pd.DataFrame, looks: Looks, from_zero: bool) -> None:
    for row in part.to_dict("records"):
        if np.isfinite(row["low"]):
            axis.plot([row["x"]] * 2, [row["low"], row["high"]], color=FAINT, linewidth=0.7, zorder=1)
        axis.plot(row["x"], row["value"], **looks.of(row["sun"], row["exposure"]), **_MARK)
    axis.tick_params(axis="x", length=0)
    low, high = axis.get_ylim()
    if from_zero:
        axis.set_ylim(-0.05 * max(1.0, high), 1.05 * max(1.0, high))  # room for the marks at the ends
    elif high - low < 0.1 * abs(high):
        axis.set_ylim(
            low - 0.05 * abs(high), high + 0.05 * abs(high)
        )  # what hardly differs shall not look as if it did


def _told(own: pd.DataFrame, looks: Looks, origin: dict[str, str]) -> str:
    """Where the drives come from, the detector where only some are shown, and the exposure of all, if it is one."""
    names = sorted(set(own["detector"]) - {ANY, ALL})
    exposure = [exposure_title(one) for one in looks.exposures if len(looks.exposures) == 1]
    return ", ".join([f"source {origin['source']}", *(f"detector {name}" for name in names), *exposure])


def _draw_legend(sheet: Any, looks: Looks, columns: int) -> None:
    """Suns by their shapes, exposures, where there are several, by their greys."""
    from matplotlib.patches import Patch

    white = {"markerfacecolor": "white"}
    keys = [legend_line(**looks.of(sun, "") | white, **_MARK, label=sun_title(sun)) for sun in looks.suns]
    for exposure in looks.exposures if len(looks.exposures) > 1 else []:
        grey = looks.of(ANY, exposure)["markerfacecolor"]
        keys.append(Patch(facecolor=grey, edgecolor=INK, linewidth=0.6, label=exposure_title(exposure)))
    if keys:
        rows = math.ceil(len(keys) / (columns * _IN_A_ROW))
        sheet.legend(
            handles=keys,
            loc="outside lower center",
            ncols=math.ceil(len(keys) / rows),  # filled column by column: of as many rows each
            columnspacing=1,
            handletextpad=0.4,
            handlelength=1,
        )


def draw_ways(folders: Sequence[Path], figure: Path, origin: dict[str, str], width: int = FIGURE_WIDTH) -> None:
    """Ways of the first seed's drives, rocks above 10 cm filled."""
    seed = folders[0].name.rpartition("_")[2]
    own = [folder for folder in folders if folder.name.endswith(f"_{seed}")]
    modes = [mode for mode in MODES if any(folder.name.split("_")[0] == mode for folder in own)]
    colours = dict(zip(modes, SERIES, strict=False))
    with page(figure, width, round(width * 0.4)) as sheet:
        heading(sheet, f"The rover finds its way, {seed.replace('seed', 'seed ')}; source {origin['source']}")
        axis = sheet.subplots()
        _draw_rocks(axis, own[0] / "world")
        for folder in own:
            way = read_parquet(folder / "trace.parquet", ("x_m", "y_m"))
            axis.plot(way["x_m"], way["y_m"], color=colours[folder.name.split("_")[0]], linewidth=1, alpha=0.8)
        for mode in modes:
            axis.plot([], [], color=colours[mode], label=mode)
        axis.set_aspect("equal")
        axis.set_xlabel("east, m")
        axis.set_ylabel("north, m")
        axis.legend(ncols=len(modes), loc="lower right")


def _draw_rocks(axis: Any, world: Path) -> None:
    from matplotlib.patches import Circle

    ground = read_arrays(world / "ground.npz", ("x0_m", "y0_m", "cell_m", "level_m"))
    rows, columns = ground["level_m"].shape
    x0, y0, cell = (float(ground[name]) for name in ("x0_m", "y0_m", "cell_m"))
    east, north = x0 + cell * (columns - 1), y0 + cell * (rows - 1)
    half = cell / 2  # levels are those of nodes, at the pixels' centres
    extent = (x0 - half, east + half, y0 - half, north + half)
    axis.imshow(ground["level_m"], extent=extent, origin="lower", cmap="gray", alpha=0.4)
    axis.set_xlim(x0, east)
    axis.set_ylim(y0, north)  # rocks may lie beyond
    for rock in read_parquet(world / "rocks.parquet", ("x_m", "y_m", "width_m", "height_m")).to_dict("records"):
        high = rock["height_m"] > HIGH_M
        axis.add_patch(Circle((rock["x_m"], rock["y_m"]), rock["width_m"] / 2, fill=high, color=INK if high else FAINT))
