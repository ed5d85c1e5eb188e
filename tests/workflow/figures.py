"""Measures of a figure's pixels: where a picture is in it, and the share of it that is a picture."""

from pathlib import Path

import cv2
import numpy as np

from polarsim.formats import png
from polarsim.formats.tone import to_8bit

REDUCED = 8  # pixels of a figure to one that is compared
NARROWEST = 0.15  # of the width of a figure: a picture in it
BLOCK = 16  # px
GREYS = 24  # distinct greys in a block of a picture; lines, letters and areas of one colour have fewer


def find_picture(figure: Path, picture: Path) -> tuple[float, np.ndarray]:
    """Return the highest correlation of a picture of any size with a part of a figure, and where that part is.

    Returns
    -------
    correlation
        From -1 to 1; labels that are drawn on a picture take some hundredths.
    position
        (2,) float: x and y of the part's centre, as shares of the figure's width.
    """
    sheet, photo = grey(png.read(figure)), grey(to_8bit(png.read(picture)))
    sheet = resized(sheet, sheet.shape[1] // REDUCED)
    best, position = -1.0, np.zeros(2)
    for width in range(round(NARROWEST * sheet.shape[1]), sheet.shape[1] + 1):
        part = resized(photo, width)
        if part.shape[0] > sheet.shape[0]:
            break
        scores = np.nan_to_num(cv2.matchTemplate(sheet, part, cv2.TM_CCOEFF_NORMED))
        if scores.max() > best:
            y, x = np.unravel_index(scores.argmax(), scores.shape)
            best, position = float(scores.max()), (np.array([x, y]) + np.array(part.shape[::-1]) / 2) / sheet.shape[1]
    return best, position


def pictured_share(figure: Path) -> float:
    """Return the share of a figure's blocks with as many greys as photos and renderings have."""
    pixels = np.round(grey(png.read(figure))).astype(int)
    rows, columns = (size // BLOCK for size in pixels.shape)
    blocks = pixels[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK).swapaxes(1, 2)
    steps = np.diff(np.sort(blocks.reshape(rows * columns, -1), axis=1), axis=1) > 0
    return float((steps.sum(axis=1) + 1 >= GREYS).mean())


def grey(pixels: np.ndarray) -> np.ndarray:
    """(h, w) float32 from 0 to 255."""
    return (pixels if pixels.ndim == 2 else pixels[..., :3].mean(axis=-1)).astype(np.float32)


def resized(pixels: np.ndarray, width: int) -> np.ndarray:
    return cv2.resize(pixels, (width, round(width * pixels.shape[0] / pixels.shape[1])), interpolation=cv2.INTER_AREA)
