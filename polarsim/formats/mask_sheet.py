"""Contact sheet of class masks in colour: the grey values 0, 43, 86 and 128 of the masks hardly differ in a viewer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import png
from polarsim.photo import COLOURS, GREY_VALUES

CLASS_COLOURS = {"background": (40, 40, 46), "ground": (150, 146, 138)} | COLOURS
TILE_WIDTH, COLUMNS = 400, 4  # px, and tiles in a row
MAX_TILES = 80
_TITLE_PX, _GAP = 24, 6
_INK = (32, 33, 36)


def colour_of_mask(grey: np.ndarray) -> np.ndarray:
    """Return the class colours (h, w, 3) uint8 of a class mask (h, w) uint8; other grey values are not changed."""
    palette = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    for kind, value in GREY_VALUES.items():
        palette[value] = CLASS_COLOURS[kind]
    return palette.take(grey, axis=0)


def tile_of_mask(grey: np.ndarray) -> np.ndarray:
    """Return a class mask (h, w) uint8 in colour, `TILE_WIDTH` wide."""
    from PIL import Image

    size = (TILE_WIDTH, round(TILE_WIDTH * grey.shape[0] / grey.shape[1]))
    return np.asarray(Image.fromarray(colour_of_mask(grey)).resize(size, Image.Resampling.BOX))


def write_mask_sheet(path: Path, tiles: Mapping[str, np.ndarray]) -> None:
    """Write a PNG with the tiles of `tile_of_mask`, their names and a legend of the classes.

    If there are more than `MAX_TILES` tiles, evenly spaced ones are shown.
    """
    from PIL import Image, ImageDraw, ImageFont

    chosen = [list(tiles)[at] for at in np.linspace(0, len(tiles) - 1, min(len(tiles), MAX_TILES)).round().astype(int)]
    high = max((tiles[name].shape[0] for name in chosen), default=0) + _TITLE_PX + _GAP
    columns = min(COLUMNS, max(2, len(chosen)))
    size = (columns * (TILE_WIDTH + _GAP) + _GAP, _TITLE_PX + 2 * _GAP + -(-len(chosen) // columns) * high)
    sheet = Image.new("RGB", size, (255, 255, 255))
    pen, letters = ImageDraw.Draw(sheet), ImageFont.load_default(16)
    _write_legend(pen, letters, f"{len(chosen)} of {len(tiles)} different masks" if chosen else "no masks")
    for number, name in enumerate(chosen):
        row, column = divmod(number, columns)
        x, y = _GAP + column * (TILE_WIDTH + _GAP), _TITLE_PX + 2 * _GAP + row * high
        pen.text((x, y), name, fill=_INK, font=letters)
        sheet.paste(Image.fromarray(tiles[name]), (x, y + _TITLE_PX))
    png.write_png(path, np.asarray(sheet))


def _write_legend(pen: Any, letters: Any, title: str) -> None:
    pen.text((_GAP, _GAP), title, fill=_INK, font=letters)
    x = _GAP + pen.textlength(title, font=letters) + 30
    for kind, colour in CLASS_COLOURS.items():
        pen.rectangle([x, _GAP + 2, x + 16, _GAP + 16], fill=colour, outline=_INK)
        text = f"{kind} ({GREY_VALUES[kind]})"
        pen.text((x + 22, _GAP), text, fill=_INK, font=letters)
        x += 22 + pen.textlength(text, font=letters) + 24
