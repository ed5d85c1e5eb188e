"""Figure that compares a photo with the twins: images with labels, and brightness differences."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import HEIGHT, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, SERIES, note, page, show_image
from polarsim.report.figures.cover_photos import cover_key, near_red
from polarsim.report.figures.difference import (
    STOPS,
    TONES,
    TONES_MEANING,
    difference_bar,
    difference_of_cover,
    difference_of_photo,
    log2_over_photo,
)
from polarsim.run_files.pictures import cover_photo, pictures_at
from polarsim.tone import display_white_level, to_8bit

GAP = 130  # height of a title and a colour bar, px


def draw_comparison(
    *,
    key: PhotoKey,
    photos: Path,
    inventory: Path,
    twins: Mapping[str, Path],
    labels: Path,
    rendered: Path | None,
    figure: Path,
    width: int = FIGURE_WIDTH,
) -> None:
    """Write the figure: photo, cover photo and twins with boxes and rock ids, and the differences of the twins.

    Each twin is followed by the image of the difference with a colour bar; the photo is followed by a histogram of the
    differences in stops. Twins and photo have the same white level, so that their brightness can be compared; without a
    photo, the twins share a white level. If the inventory names a cover photo, labels are added from the photo of the
    same position whose boxes match the red boxes in the cover photo. Missing images are skipped. Without `rendered`,
    the label table of the twins, twins have the labels of the photo.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    of_photo = rows_of(table, key)
    of_twins = of_photo if rendered is None else rows_of(read_parquet(rendered, LABEL_COLUMNS), key)
    width //= 2  # two columns of panels
    panels: list[Panel] = []
    differences: dict[str, Panel] = {}
    stops: dict[str, np.ndarray] = {}
    pictured = _read(twins, key)
    photo, printed = pictures_at(photos).get(key), cover_photo(inventory, key.position)
    white = None
    if photo is not None and photo.exists():
        pixels = png.read_png(photo)
        white = display_white_level(pixels)
        panels.append(Panel(f"Photo {key}", draw_labels(to_8bit(pixels, white), of_photo, width)))
        stops = {model: log2_over_photo(pixels, twin) for model, twin in pictured.items()}
        differences = {
            model: Panel(f"Twin / photo, {model}", _small(difference_of_photo(pixels, twin), width), STOPS)
            for model, twin in pictured.items()
        }
    if printed is not None and printed.exists():
        cover = to_8bit(png.read_png(printed))
        shown = _shown_on(cover, table, key)
        panels.append(_cover_panel(cover, table, shown, width))
        differences |= _cover_differences(cover, shown, _read(twins, shown), width) if shown else {}
    if panels and stops:
        panels.append(Panel("Brightness difference of the twins", stops=stops))
    for model, pixels in pictured.items():
        white = display_white_level(pixels) if white is None else white
        panels.append(Panel(f"Twin, {model}", draw_labels(to_8bit(pixels, white), of_twins, width)))
        panels += [differences[model]] if model in differences else []
    _draw(figure, panels, width, f"{key}: no photo and no twin")


@dataclass(frozen=True)
class Panel:
    """An image, or a histogram of `stops` (n,) by model."""

    title: str
    pixels: np.ndarray | None = None
    full: float = 0.0  # value of the saturated colour of a difference image; 0: not a difference image
    stops: Mapping[str, np.ndarray] | None = None


def _shown_on(cover: np.ndarray, table: pd.DataFrame, key: PhotoKey) -> PhotoKey | None:
    """Return the key of the photo shown in a cover photo of the position of `key`, identified by the red boxes."""
    keys = [PhotoKey.parse(str(name)) for name in sorted(set(table["key"]))]
    similar = [
        k for k in keys if k.station == key.station and k.exposure_ms == key.exposure_ms and k.light == key.light
    ]
    return cover_key(cover, table, sorted(similar, key=lambda k: (k.azimuth != key.azimuth, k)))


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


def _cover_panel(cover: np.ndarray, table: pd.DataFrame, shown: PhotoKey | None, width: int) -> Panel:
    if shown is None:
        return Panel("Published photo\nwith ids of the authors", draw_labels(cover, table[:0], width))
    rocks = draw_labels(
        cover, rows_of(table, shown), width, OverlayStyle((ROCK,))
    )  # no shadows: the azimuth is not known
    return Panel(f"Published photo, red: ids of the authors\nyellow: rocks of {shown}", rocks)


def _draw(path: Path, panels: list[Panel], width: int, empty: str) -> None:
    rows = max(1, (len(panels) + 1) // 2)
    height = round(width * HEIGHT / WIDTH) + GAP * (1 + any("\n" in panel.title for panel in panels))
    with page(path, 2 * width, rows * height) as figure:
        if not panels:
            note(figure, empty)
            return
        grid = figure.subplots(rows, 2 if len(panels) > 1 else 1, squeeze=False)
        for axes in grid.ravel()[len(panels) :]:
            axes.set_axis_off()
        for axes, panel in zip(grid.ravel(), panels, strict=False):
            if panel.pixels is not None:
                show_image(axes, panel.pixels, panel.title)
                if panel.full == STOPS:
                    difference_bar(figure, [axes])
                elif panel.full:
                    difference_bar(figure, [axes], panel.full, TONES_MEANING)
            elif panel.stops is not None:
                axes.set_title(panel.title)
                _draw_stops(axes, panel.stops)


def _draw_stops(axes: Any, stops: Mapping[str, np.ndarray]) -> None:
    """Draw a histogram of the compared pixels over stops for each model."""
    bins = np.linspace(-2 * STOPS, 2 * STOPS, 81)
    for number, (model, values) in enumerate(stops.items()):
        label = f"{model}: no pixel compared"
        if len(values):
            share = np.histogram(values.clip(bins[0], bins[-1]), bins)[0] / len(values)
            label = f"{model}: median {np.median(values):+.2f}, median of |x| {np.median(np.abs(values)):.2f}"
            axes.stairs(100 * share, bins, color=SERIES[number % len(SERIES)], linewidth=2, label=label)
        else:
            axes.plot([], [], label=label)
    axes.axvline(0, color=FAINT, linewidth=0.8)
    axes.set(xlabel="x = log2(twin / photo), stops", ylabel="share of compared pixels, %", ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small")
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
