"""A photo beside its twins, each with its labels, and how they differ."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter

from polarsim.annotate.overlay import Marks, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.run_files import cover_photo, pictures_at
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.formats.tone import to_8bit, white_of
from polarsim.photo import HEIGHT, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, SERIES, note, page, picture
from polarsim.report.figures.difference import (
    STOPS,
    TONES,
    TONES_MEANING,
    difference_bar,
    difference_of_cover,
    difference_of_photo,
    log2_over_photo,
)

GAP = 130  # pixels of a title and a colour bar
_SAME = 0.35  # share of our boxes' outlines on drawn red lines from which a cover photo is taken to show that photo
_ALIKE = 0.1  # difference of two such shares that says nothing
_REACH = 9  # pixels between our line and the red one


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


def cover_key(cover: np.ndarray, labels: pd.DataFrame, keys: Iterable[PhotoKey]) -> PhotoKey | None:
    """The photo, of some keys, whose rock boxes lie on the red boxes drawn into a cover photo (h, w, 3) uint8.

    None when no photo's boxes do: covers show either camera and any azimuth, and some have numbers only. Of photos that
    fit nearly alike the first one wins.
    """
    near_red = maximum_filter(_red(cover), _REACH)
    scale = np.array([cover.shape[1] / WIDTH, cover.shape[0] / HEIGHT] * 2)
    best, best_share = None, _SAME
    rocks = labels[labels["kind"] == ROCK]
    for key in keys:
        boxes = rocks.loc[rocks["key"] == str(key), ["x0", "y0", "x1", "y1"]].to_numpy(float) * scale
        share = float(np.mean([_share_on(near_red, box) for box in boxes])) if len(boxes) else 0.0
        if share > best_share + (_ALIKE if best else 0):
            best, best_share = key, share
    return best


def _red(cover: np.ndarray) -> np.ndarray:
    """(h, w) bool: the lines and digits that its authors drew into a cover photo."""
    return (cover[..., 0] > 150) & (cover[..., 1] < 90) & (cover[..., 2] < 90)


def _shown_on(cover: np.ndarray, table: pd.DataFrame, key: PhotoKey) -> PhotoKey | None:
    """The photo that a cover photo of a key's position shows, told by its red boxes."""
    keys = [PhotoKey.parse(str(name)) for name in sorted(set(table["key"]))]
    alike = [k for k in keys if k.station == key.station and k.exposure_ms == key.exposure_ms and k.light == key.light]
    return cover_key(cover, table, sorted(alike, key=lambda other: (other.azimuth != key.azimuth, other)))


def _cover_differences(
    cover: np.ndarray, shown: PhotoKey, twins: Mapping[str, np.ndarray], width: int
) -> dict[str, Panel]:
    red = maximum_filter(_red(cover), _REACH)
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


def _share_on(mask: np.ndarray, box: np.ndarray) -> float:
    """Share of a box's outline on a mask."""
    x0, y0, x1, y1 = box
    along = np.linspace(0, 1, 50)
    x, y = x0 + (x1 - x0) * along, y0 + (y1 - y0) * along
    columns = np.concatenate([x, x, np.full(50, x0), np.full(50, x1)]).clip(0, mask.shape[1] - 1).astype(int)
    rows = np.concatenate([np.full(50, y0), np.full(50, y1), y, y]).clip(0, mask.shape[0] - 1).astype(int)
    return float(mask[rows, columns].mean())


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
