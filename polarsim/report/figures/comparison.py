"""Figure that compares a photo with the twins: images with labels, and brightness differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import ROCK, PhotoKey
from polarsim.report.figures.canvas import FAINT, SERIES, note, page, show_image
from polarsim.report.figures.cover_photos import cover_key, near_red
from polarsim.report.figures.difference import (
    STOPS,
    STOPS_MEANING,
    TONES,
    TONES_MEANING,
    difference_bar,
    difference_of_cover,
    difference_of_photo,
    log2_over_photo,
)
from polarsim.run_files.pictures import cover_photo, pictures_at
from polarsim.tone import display_white_level, to_8bit

COMPARISON_WIDTH = 2000  # px; up to four panels per row
_LETTERS = 42  # of the rock ids in the width of a panel
_LEGEND_LINE = 0.1  # height of a line of the legend above the histogram, relative to the height of the panel
TITLE, BAR = 0.1, 0.24  # height of the lines of a title, and of a colour bar, relative to the width of a panel


def draw_comparison(
    *,
    key: PhotoKey,
    photos: Path,
    inventory: Path,
    twins: Mapping[str, Path],
    labels: Path,
    rendered: Path | None,
    figure: Path,
    size: tuple[int, int],
    width: int = COMPARISON_WIDTH,
) -> None:
    """Write the figure: photo, cover photo and twins with boxes and rock ids, and the differences of the twins.

    A column per image: below each twin is the image of the difference, below the photo a histogram of the differences
    in stops. Twins and photo have the same white level, so that their brightness can be compared; without a photo, the
    twins share a white level. If the inventory names a cover photo, labels are added from the photo of the same
    position whose boxes match the red boxes in the cover photo. Missing images are skipped. Without `rendered`, the
    label table of the twins, twins have the labels of the photo. `size`: width and height of the photos, px.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    of_photo = rows_of(table, key)
    of_twins = of_photo if rendered is None else rows_of(read_parquet(rendered, LABEL_COLUMNS), key)
    pictured = _read(twins, key)
    photo, printed = pictures_at(photos).get(key), cover_photo(inventory, key.position)
    has_photo, has_cover = (path is not None and path.exists() for path in (photo, printed))
    columns: list[list[Panel]] = []
    differences: dict[str, Panel] = {}
    column = width // max(2, has_photo + has_cover + len(pictured))
    marks = OverlayStyle(stated_below=0, letter_px=max(10, round(column / _LETTERS)))
    white = None
    if photo is not None and has_photo:
        pixels = png.read_png(photo)
        white = display_white_level(pixels)
        stops = {model: log2_over_photo(pixels, twin) for model, twin in pictured.items()}
        shown = Panel(f"Photo {key}", draw_labels(to_8bit(pixels, white), of_photo, column, marks))
        columns.append([shown, *([Panel("Brightness of the twins", stops=stops)] if stops else [])])
        differences = {
            model: Panel(f"Twin / photo, {model}", _small(difference_of_photo(pixels, twin), column), STOPS)
            for model, twin in pictured.items()
        }
    if printed is not None and has_cover:
        cover = to_8bit(png.read_png(printed))
        of_cover = _shown_on(cover, table, key, size)
        columns.append([_cover_panel(cover, table, of_cover, column, marks, size)])
        differences |= _cover_differences(cover, of_cover, _read(twins, of_cover), column) if of_cover else {}
    for model, pixels in pictured.items():
        white = display_white_level(pixels) if white is None else white
        twin = Panel(f"Twin, {model}", draw_labels(to_8bit(pixels, white), of_twins, column, marks))
        columns.append([twin, *([differences[model]] if model in differences else [])])
    _draw(figure, columns, column, width, size, f"{key}: no photo and no twin")


@dataclass(frozen=True)
class Panel:
    """An image, or a histogram of `stops` (n,) by model."""

    title: str
    pixels: np.ndarray | None = None
    full: float = 0.0  # value of the saturated colour of a difference image; 0: not a difference image
    stops: Mapping[str, np.ndarray] | None = None


def _shown_on(cover: np.ndarray, table: pd.DataFrame, key: PhotoKey, size: tuple[int, int]) -> PhotoKey | None:
    """Return the key of the photo shown in a cover photo of the position of `key`, identified by the red boxes."""
    keys = [PhotoKey.parse(str(name)) for name in sorted(set(table["key"]))]
    similar = [
        k for k in keys if k.station == key.station and k.exposure_ms == key.exposure_ms and k.light == key.light
    ]
    return cover_key(cover, table, sorted(similar, key=lambda k: (k.azimuth != key.azimuth, k)), size)


def _cover_differences(
    cover: np.ndarray, shown: PhotoKey, twins: Mapping[str, np.ndarray], width: int
) -> dict[str, Panel]:
    red = near_red(cover)
    return {
        model: Panel(
            f"Twin minus published photo, {model}\n{shown}, tones matched",
            _small(difference_of_cover(cover, twin, red), width),
            TONES,
        )
        for model, twin in twins.items()
        if twin.shape == red.shape
    }


def _small(pixels: np.ndarray, width: int) -> np.ndarray:
    return draw_labels(pixels, pd.DataFrame(columns=list(LABEL_COLUMNS)), width)


def _read(twins: Mapping[str, Path], key: PhotoKey) -> dict[str, np.ndarray]:
    paths = {model: folder / f"{key}.png" for model, folder in twins.items()}
    return {model: png.read_png(path) for model, path in paths.items() if path.exists()}


def _cover_panel(
    cover: np.ndarray,
    table: pd.DataFrame,
    shown: PhotoKey | None,
    width: int,
    marks: OverlayStyle,
    size: tuple[int, int],
) -> Panel:
    if shown is None:
        return Panel("Published photo\nwith ids of the authors", draw_labels(cover, table[:0], width))
    only_rocks = replace(marks, kinds=(ROCK,))  # no shadows: the azimuth is not known
    rocks = draw_labels(cover, rows_of(table, shown), width, only_rocks, photo_width=size[0])
    return Panel(f"Published photo, red: ids of the authors\nyellow: rocks of {shown}", rocks)


def _draw(
    path: Path, columns: Sequence[Sequence[Panel]], column: int, width: int, size: tuple[int, int], empty: str
) -> None:
    """Write the figure: columns of at most two panels, with the colour bars below the differences."""
    shown = [panel for panels in columns for panel in panels]
    lines = 1 + any("\n" in panel.title for panel in shown)
    rows = max(map(len, columns), default=1)
    has_bar = any(panel.full for panel in shown)
    height = column * (rows * (size[1] / size[0] + lines * TITLE) + has_bar * BAR)
    with page(path, width, round(height)) as figure:
        if not shown:
            note(figure, empty)
            return
        grid = figure.subplots(rows, max(2, len(columns)), squeeze=False)
        for axes in grid.ravel():
            axes.set_axis_off()
        with_bar: dict[float, list[Any]] = {}
        for cells, panels in zip(grid.T, columns, strict=False):
            for axes, panel in zip(cells, panels, strict=False):
                _draw_panel(axes, panel)
                if panel.full:
                    with_bar.setdefault(panel.full, []).append(axes)
        for full, below in with_bar.items():
            difference_bar(figure, below, full, STOPS_MEANING if full == STOPS else TONES_MEANING)


def _draw_panel(axes: Any, panel: Panel) -> None:
    if panel.pixels is not None:
        show_image(axes, panel.pixels, panel.title)
    if panel.stops is not None:
        axes.set_axis_on()
        axes.set_title(panel.title)
        _draw_stops(axes, panel.stops)


def _draw_stops(axes: Any, stops: Mapping[str, np.ndarray]) -> None:
    """Draw a histogram of the compared pixels over stops for each model."""
    bins = np.linspace(-STOPS - 1, STOPS + 1, 81)
    for number, (model, values) in enumerate(stops.items()):
        label = f"{model}: no pixel compared"
        if len(values):
            share = np.histogram(values, bins)[0] / len(values)
            label = f"{model}: median {np.median(values):+.2f}, median of |x| {np.median(np.abs(values)):.2f}"
            axes.stairs(100 * share, bins, color=SERIES[number % len(SERIES)], linewidth=2, label=label)
        else:
            axes.plot([], [], label=label)
    axes.axvline(0, color=FAINT, linewidth=0.8)
    axes.set(xlabel="x = log2(twin / photo), stops", ylabel="share of compared pixels, %", ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small", frameon=True, framealpha=1, edgecolor="none")
    axes.set_ylim(0, axes.get_ylim()[1] / (0.92 - _LEGEND_LINE * len(stops)))
