"""A photo beside its twins, each with its labels, and how they differ."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import maximum_filter

from polarsim.annotate.overlay import Marks, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.run_files import cover_photo, pictures_at
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.formats.tone import to_8bit, white_of
from polarsim.photo import BLACK_LEVEL, HEIGHT, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FIGURE_WIDTH, note, page, picture
from polarsim.scoring.twins import FULL_DN, LIT_DN

GAP = 50  # pixels of a title
_SAME = 0.35  # share of our boxes' outlines on drawn red lines from which a cover photo is taken to show that photo
_ALIKE = 0.1  # difference of two such shares that says nothing
_REACH = 9  # pixels between our line and the red one
STOPS = 2.0  # of full colour
_TONES = 0.5  # of full colour, share of white, where tones were matched
_LEVELS = np.linspace(0, 1, 257)


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
    panels, differences = [], []
    pictured = _read(twins, key)
    photo, printed = pictures_at(photos).get(key), cover_photo(inventory, key.position)
    white = None
    if photo is not None and photo.exists():
        pixels = png.read(photo)
        white = white_of(pixels)
        panels.append((f"Photo {key}", draw_labels(to_8bit(pixels, white), own, width)))
        differences += [
            (f"log2 of twin over photo, {model}: ±{STOPS:g}", difference_of_photo(pixels, twin))
            for model, twin in pictured.items()
        ]
    if printed is not None and printed.exists():
        cover = to_8bit(png.read(printed))
        shown = _shown_on(cover, table, key)
        panels.append(_cover_panel(cover, table, shown, width))
        differences += _cover_differences(cover, shown, _read(twins, shown)) if shown else []
    for model, pixels in pictured.items():
        white = white_of(pixels) if white is None else white
        panels.append((f"Twin, {model}", draw_labels(to_8bit(pixels, white), of_twins, width)))
    nothing = table[:0]
    panels += [(title, draw_labels(pixels, nothing, width)) for title, pixels in differences]
    _draw(figure, panels, width, f"{key}: neither photo nor twin")


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
    cover: np.ndarray, shown: PhotoKey, twins: Mapping[str, np.ndarray]
) -> list[tuple[str, np.ndarray]]:
    red = maximum_filter(_red(cover), _REACH)
    return [
        (f"Published photo and twin {shown}, {model}, tones matched", difference_of_cover(cover, twin, red))
        for model, twin in twins.items()
        if twin.shape == red.shape
    ]


def _read(twins: Mapping[str, Path], key: PhotoKey) -> dict[str, np.ndarray]:
    paths = {model: folder / f"{key}.png" for model, folder in twins.items()}
    return {model: png.read(path) for model, path in paths.items() if path.exists()}


def _cover_panel(cover: np.ndarray, table: pd.DataFrame, shown: PhotoKey | None, width: int) -> tuple[str, np.ndarray]:
    if shown is None:
        return "Published photo, ids drawn by its authors", draw_labels(cover, table[:0], width)
    rocks = draw_labels(cover, rows_of(table, shown), width, Marks((ROCK,)))  # its azimuth is not known: no shadows
    return f"Published photo (red: its authors), rocks of {shown}", rocks


def _share_on(mask: np.ndarray, box: np.ndarray) -> float:
    """Share of a box's outline on a mask."""
    x0, y0, x1, y1 = box
    along = np.linspace(0, 1, 50)
    x, y = x0 + (x1 - x0) * along, y0 + (y1 - y0) * along
    columns = np.concatenate([x, x, np.full(50, x0), np.full(50, x1)]).clip(0, mask.shape[1] - 1).astype(int)
    rows = np.concatenate([np.full(50, y0), np.full(50, y1), y, y]).clip(0, mask.shape[0] - 1).astype(int)
    return float(mask[rows, columns].mean())


def _draw(path: Path, panels: list[tuple[str, np.ndarray]], width: int, empty: str) -> None:
    rows = max(1, (len(panels) + 1) // 2)
    height = round(width * HEIGHT / WIDTH) + GAP
    with page(path, 2 * width, rows * height) as figure:
        if not panels:
            note(figure, empty)
            return
        grid = figure.subplots(rows, 2 if len(panels) > 1 else 1, squeeze=False)
        for axes in grid.ravel()[len(panels) :]:
            axes.set_axis_off()
        for axes, (title, pixels) in zip(grid.ravel(), panels, strict=False):
            picture(axes, pixels, title)


def difference_of_photo(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 picture of log2(twin / photo) of 12-bit pictures (h, w); grey where either is dark or clipped."""
    signals = [picture.astype(np.float32) - BLACK_LEVEL for picture in (photo, twin)]
    good = np.logical_and.reduce([(signal > LIT_DN) & (signal < FULL_DN) for signal in signals])
    ratio = np.log2(np.divide(signals[1], signals[0], where=good, out=np.ones_like(signals[0])))
    return _coloured(ratio / STOPS, good)


def difference_of_cover(cover: np.ndarray, twin: np.ndarray, red: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8 picture of tones, twin less cover photo, once the twin has the distribution of its tones.

    Published covers are stretched in ways that nobody wrote down, so that brightness itself cannot be compared.

    Parameters
    ----------
    cover : (h, w, 3) uint8
    twin : (h, w) uint16
    red : (h, w) bool
        Where lines or digits were drawn into the cover: left grey.
    """
    tones = cover.astype(np.float32).mean(axis=-1) / 255
    wanted = np.quantile(tones[~red], _LEVELS)
    own, first = np.unique(np.quantile(twin[~red], _LEVELS), return_index=True)
    matched = np.interp(twin, own, wanted[first])
    return _coloured((matched - tones) / _TONES, ~red)


def _coloured(share: np.ndarray, good: np.ndarray) -> np.ndarray:
    """-1 is blue, 0 white, 1 red."""
    share = np.clip(share, -1, 1)
    fade = 1 - np.abs(share)
    channels = [np.where(share > 0, 1, fade), fade, np.where(share < 0, 1, fade)]
    return np.where(good[..., None], np.round(255 * np.stack(channels, axis=-1)), 128).astype(np.uint8)
