"""A photo beside its twins, each with its labels, and how they differ."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import Marks, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import HEIGHT, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, SERIES, note, page, picture
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
from polarsim.tone import to_8bit, white_of

GAP = 130  # pixels of a title and a colour bar


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
    """Write the picture: photo, cover photo, twins, with boxes and rock ids drawn in, and how twins differ.

    Each twin has its difference beside it, with a bar that says what its colours mean. Beside the photo stands how
    often a twin is how many stops too bright or too dark.

    Twins are shown with the photo's white, so brightness can be compared; among themselves where there is no photo.

    Parameters
    ----------
    photos
        Table of the terrain's photos, which may lack this one.
    inventory
        Inventory of the terrain, which names the release's photo with ids drawn in where there is one: ours are added
        from the photo of the key's position whose boxes fit the red ones, if any does.
    twins
        Folder of the terrain's twins by model; missing twins are left out.
    labels
        Label table with the photo's labels.
    rendered
        Label table of the twins; None draws the photo's labels there too.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    own = rows_of(table, key)
    of_twins = own if rendered is None else rows_of(read_parquet(rendered, LABEL_COLUMNS), key)
    width //= 2  # two panels stand side by side
    panels: list[Panel] = []
    differences: dict[str, Panel] = {}
    stops: dict[str, np.ndarray] = {}
    pictured = _read(twins, key)
    photo, printed = pictures_at(photos).get(key), cover_photo(inventory, key.position)
    white = None
    if photo is not None and photo.exists():
        pixels = png.read(photo)
        white = white_of(pixels)
        panels.append(Panel(f"Photo {key}", draw_labels(to_8bit(pixels, white), own, width)))
        stops = {model: log2_over_photo(pixels, twin) for model, twin in pictured.items()}
        differences = {
            model: Panel(f"Twin over photo, {model}", _small(difference_of_photo(pixels, twin), width), STOPS)
            for model, twin in pictured.items()
        }
    if printed is not None and printed.exists():
        cover = to_8bit(png.read(printed))
        shown = _shown_on(cover, table, key)
        panels.append(_cover_panel(cover, table, shown, width))
        differences |= _cover_differences(cover, shown, _read(twins, shown), width) if shown else {}
    if panels and stops:
        panels.append(Panel("How far twins are off", stops=stops))
    for model, pixels in pictured.items():
        white = white_of(pixels) if white is None else white
        panels.append(Panel(f"Twin, {model}", draw_labels(to_8bit(pixels, white), of_twins, width)))
        panels += [differences[model]] if model in differences else []
    _draw(figure, panels, width, f"{key}: neither photo nor twin")


@dataclass(frozen=True)
class Panel:
    """A picture, or a histogram of `stops` (n,) by model."""

    title: str
    pixels: np.ndarray | None = None
    full: float = 0.0  # value of full colour in a difference; 0: no difference
    stops: Mapping[str, np.ndarray] | None = None


def _shown_on(cover: np.ndarray, table: pd.DataFrame, key: PhotoKey) -> PhotoKey | None:
    """The photo that a cover photo of a key's position shows, told by its red boxes."""
    keys = [PhotoKey.parse(str(name)) for name in sorted(set(table["key"]))]
    alike = [k for k in keys if k.station == key.station and k.exposure_ms == key.exposure_ms and k.light == key.light]
    return cover_key(cover, table, sorted(alike, key=lambda other: (other.azimuth != key.azimuth, other)))


def _cover_differences(
    cover: np.ndarray, shown: PhotoKey, twins: Mapping[str, np.ndarray], width: int
) -> dict[str, Panel]:
    red = near_red(cover)
    return {
        model: Panel(
            f"Twin less published photo, {model}\n{shown}, tones matched",
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
    return {model: png.read(path) for model, path in paths.items() if path.exists()}


def _cover_panel(cover: np.ndarray, table: pd.DataFrame, shown: PhotoKey | None, width: int) -> Panel:
    if shown is None:
        return Panel("Published photo\nids drawn by its authors", draw_labels(cover, table[:0], width))
    rocks = draw_labels(cover, rows_of(table, shown), width, Marks((ROCK,)))  # its azimuth is not known: no shadows
    return Panel(f"Published photo, red: its authors\nyellow: our rocks of {shown}", rocks)


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
                picture(axes, panel.pixels, panel.title)
                if panel.full == STOPS:
                    difference_bar(figure, [axes])
                elif panel.full:
                    difference_bar(figure, [axes], panel.full, TONES_MEANING)
            elif panel.stops is not None:
                axes.set_title(panel.title)
                _draw_stops(axes, panel.stops)


def _draw_stops(axes: Any, stops: Mapping[str, np.ndarray]) -> None:
    """A line a model: share of the compared pixels by stops."""
    bins = np.linspace(-2 * STOPS, 2 * STOPS, 81)
    for number, (model, values) in enumerate(stops.items()):
        label = f"{model}: none compared"
        if len(values):
            share = np.histogram(values.clip(bins[0], bins[-1]), bins)[0] / len(values)
            label = f"{model}: median {np.median(values):+.2f}, off by {np.median(np.abs(values)):.2f} (median)"
            axes.stairs(100 * share, bins, color=SERIES[number % len(SERIES)], linewidth=2, label=label)
        else:
            axes.plot([], [], label=label)
    axes.axvline(0, color=FAINT, linewidth=0.8)
    axes.set(xlabel="log2 of twin over photo, stops", ylabel="share of compared pixels, %", ylim=(0, None))
    axes.legend(loc="upper left", fontsize="small")
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
