"""All exposure brackets of a station on one sheet, labels drawn in: people look through it to find wrong labels."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.annotate.overlay import INK, LINK, PAPER, Marks, draw_labels, font
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.files import writing
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import AZIMUTHS, BOX_CLASSES, CAMERAS, COLOURS, HEIGHT, LIGHTS, ROCK, SHADOW, WIDTH, PhotoKey
from polarsim.run_files.pictures import pictures_at
from polarsim.tone import to_8bit

ALWAYS_DOUBTFUL = 0.5  # confidence below which a label is marked, however sure the others are
DOUBTFUL_SHARE = 0.1  # of a terrain's labels: the least sure ones are marked too
MAX_BYTES = 1_500_000  # of a sheet: a report holds many
GREYS, SHADES = (96, 48, 24), 16  # of the palette: greys, the first number that fits, and steps of each colour to black
BLANK = 90  # grey of a tile without photo and twin
SHEET_WIDTH = 2400  # px: ids of four tiles in a row can be read
_GAP = 6  # pixels between tiles
_CODE = np.array([1 << 16, 1 << 8, 1])  # a colour as one number


@dataclass(frozen=True)
class Tile:
    """One exposure bracket: the exposure that stands for it, its labels, and what it is drawn on."""

    key: PhotoKey
    labels: pd.DataFrame
    picture: Path | None

    def title(self, doubtful_below: float) -> str:
        kinds = self.labels["kind"]
        counts = ", ".join(f"{int((kinds == kind).sum())} {kind}s" for kind in BOX_CLASSES)
        doubtful = int((self.labels["confidence"] < doubtful_below).sum())
        sun = "no Sun" if self.key.azimuth == "no" else f"Sun {self.key.azimuth}"
        light = f"{sun}, light {self.key.light}, {self.key.camera}, {self.key.exposure_ms} ms"
        return f"{light}: {counts}" + (f", {doubtful} dashed" if doubtful else "")


def draw_contact(
    *, keys: Iterable[PhotoKey], labels: Path, pictures: Iterable[Path], figure: Path, width: int = SHEET_WIDTH
) -> None:
    """Write the sheet: a row a Sun azimuth, columns for both cameras with the rover light off and on.

    Of each exposure bracket stands the exposure with the most labels, of these the nearest to 256 ms. Dashed are
    labels of a confidence below 0.5 or among the lowest tenth of the terrain's.

    Parameters
    ----------
    keys
        The photos of one station.
    labels
        Label table of the terrain.
    pictures
        Tables of photos and folders of twins; the first that has a key's picture gives it, else it is grey.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    found = [pictures_at(folder) for folder in pictures]
    doubtful_below = doubtful_confidence(table["confidence"])
    by_set = groupby(sorted(keys, key=lambda key: (key.bracket, key)), key=lambda key: key.bracket)
    shown = [most_labelled(list(exposures), table) for _, exposures in by_set]
    tiles = [Tile(key, rows_of(table, key), _picture(found, key)) for key in shown]
    _write(figure, _sheet(tiles, doubtful_below, width))


def _picture(found: Iterable[Mapping[PhotoKey, Path]], key: PhotoKey) -> Path | None:
    return next((paths[key] for paths in found if key in paths and paths[key].exists()), None)


def most_labelled(exposures: Sequence[PhotoKey], labels: pd.DataFrame) -> PhotoKey:
    """Of the exposures of an exposure bracket the one with the most labels; of several the nearest to 256 ms."""
    counts = labels["key"].value_counts()
    return min(exposures, key=lambda key: (-int(counts.get(str(key), 0)), key.stops_off_usual, key))


def doubtful_confidence(confidences: pd.Series) -> float:
    """Labels with a lower confidence are to be looked at first."""
    lowest = float(confidences.quantile(DOUBTFUL_SHARE)) if len(confidences) else 0.0
    return max(lowest, ALWAYS_DOUBTFUL)


def _sheet(tiles: Sequence[Tile], doubtful_below: float, width: int) -> Any:
    """The tiles in rows and columns, a title above each, and what the marks mean at the foot."""
    from PIL import Image, ImageDraw

    rows = [azimuth for azimuth in AZIMUTHS if any(tile.key.azimuth == azimuth for tile in tiles)]
    columns = [
        (light, camera)
        for light in LIGHTS
        for camera in CAMERAS
        if any((tile.key.light, tile.key.camera) == (light, camera) for tile in tiles)
    ]
    wide = (width - _GAP) // max(len(columns), 1) - _GAP
    letters = font(max(10, wide // 36))
    strip = round(1.6 * letters.size)
    high = round(wide * HEIGHT / WIDTH) + strip + _GAP
    sheet = Image.new("RGB", (width, _GAP + len(rows) * high + strip), PAPER)
    pen = ImageDraw.Draw(sheet)
    for tile in tiles:
        x = _GAP + columns.index((tile.key.light, tile.key.camera)) * (wide + _GAP)
        y = _GAP + rows.index(tile.key.azimuth) * high
        pen.text((x, y + strip // 2), tile.title(doubtful_below), fill=INK, font=letters, anchor="lm")
        sheet.paste(Image.fromarray(_drawn(tile, wide, doubtful_below)), (x, y + strip))
    foot = _legend(tiles, doubtful_below)
    pen.text((_GAP, sheet.height - strip // 2), foot, fill=INK, font=letters, anchor="lm")
    return sheet


def _legend(tiles: Sequence[Tile], doubtful_below: float) -> str:
    stations = sorted({tile.key.station for tile in tiles})
    name = ", ".join(f"Terrain {terrain:02d}, position {position}" for terrain, position in stations)
    marks = "yellow: rocks with their ids; blue: shadows, a line to their rock"
    return f"{name}. {marks}; dashed: confidence below {doubtful_below:.2f}"


def _drawn(tile: Tile, width: int, doubtful_below: float) -> np.ndarray:
    if tile.picture is not None and tile.picture.exists():
        pixels = to_8bit(png.read(tile.picture))
    else:
        pixels = np.full((HEIGHT, WIDTH, 3), BLANK, np.uint8)
    marks = Marks(links=True, confidences=False, doubtful_below=doubtful_below, letter_px=max(10, round(width / 42)))
    return draw_labels(pixels, tile.labels, width, marks)


def _write(path: Path, sheet: Any) -> None:
    """An 8-bit PNG of greys and the labels' colours: a third of the size of a coloured one."""
    pixels = np.asarray(sheet, np.int32)
    codes, indices = np.unique(pixels @ _CODE, return_inverse=True)  # of whole numbers, five times as fast as of rows
    colours = codes[:, None] // _CODE % 256
    for greys in GREYS:
        content = _coded(colours, indices.reshape(pixels.shape[:2]), _palette(greys))
        if len(content) <= MAX_BYTES:
            break
    with writing(path) as temporary:
        temporary.write_bytes(content)


def _coded(colours: np.ndarray, indices: np.ndarray, palette: np.ndarray) -> bytes:
    """PNG of a picture, each of its colours (n, 3) replaced by the nearest of a palette; `indices` (h, w) say which."""
    from PIL import Image

    _, nearest = cKDTree(palette).query(colours)
    picture, content = Image.fromarray(np.asarray(nearest, np.uint8)[indices]), BytesIO()
    picture.putpalette(palette.ravel().tolist())
    picture.save(content, "PNG", optimize=True)
    return content.getvalue()


def _palette(count: int) -> np.ndarray:
    """(n, 3) int: greys, and each colour of the labels in steps from black, with which the rims of letters mix."""
    greys = np.repeat(np.linspace(0, 255, count)[:, None], 3, axis=1)
    steps = np.linspace(0, 1, SHADES + 1)[1:, None]
    return np.round(
        np.concatenate([greys, *(steps * colour for colour in (COLOURS[ROCK], COLOURS[SHADOW], LINK))])
    ).astype(int)
