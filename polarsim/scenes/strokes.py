"""Boxes and digits that people drew into grey photos: found, taken out, and drawn into training images.

Published cover photos are grey; what was drawn into them is red or blue. A pixel whose channels differ is thus a
stroke, and where a line's soft edge lets the photo through, the photo's grey value can be told from the mix.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

_PURE = 190  # brightest channel above the darkest one, from which a pixel is nothing but stroke
_MOST_GRAIN = 3  # times the usual size of grain, the median over a square of _USUAL_PX
_USUAL_PX = 21
_MOST_COVER = 0.5  # share of a stroke's colour up to which the grey value below it is recovered
_UNTOUCHED = 0.5  # share of the pictures that nobody draws into: taking strokes out takes longer than a lamp's light
_GROWN = np.ones((3, 3), bool)
_REACH = 4  # pixels from which inpainting takes its light
_LEAST_SIDE, _LEAST_FILL = 12, 0.9  # of the inside of a drawn box: side in px, share of its bounding box
Colour = tuple[int, int, int]
COLOURS: tuple[Colour, ...] = ((255, 0, 0), (237, 28, 36), (0, 0, 255))  # of the published covers, RGB


def find_strokes(picture: np.ndarray) -> np.ndarray:
    """(h, w) bool: pixels of a picture (h, w, 3) uint8 whose channels differ."""
    return np.asarray(picture.max(axis=-1) != picture.min(axis=-1))


def erase_strokes(picture: np.ndarray) -> np.ndarray:
    """(h, w) uint8 photo without its strokes.

    Soft edges keep the grey value that shows through; the rest is inpainted from the edges of the hole (Telea, J.
    Graphics Tools 9 (2004) 23) and given the grain of the photo around it, for a smooth stripe would be a trace.
    """
    import cv2

    strokes = find_strokes(picture)
    grey, cover = _unmixed(picture, strokes)
    hole = strokes & (cover > _MOST_COVER)
    photo = np.where(strokes & ~hole, grey, picture[..., 1]).astype(np.uint8)
    if not hole.any():
        return photo
    filled = cv2.inpaint(photo, hole.astype(np.uint8), _REACH, cv2.INPAINT_TELEA)
    return np.where(hole, _with_grain(filled, photo, strokes), photo).astype(np.uint8)


def _unmixed(picture: np.ndarray, strokes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grey value under the strokes (h, w), and the share (h, w) of the stroke's colour in each pixel.

    A mix is c s + (1 - c) g in every channel, with the colour s of the nearest pixel that is nothing but stroke; so the
    channels of a mix lie c times as far apart as those of its colour.
    """
    darkest, brightest = (extreme(axis=-1).astype(np.float32) for extreme in (picture.min, picture.max))
    chroma = brightest - darkest
    core = strokes & (chroma > _PURE)
    if not core.any():
        return darkest, strokes.astype(np.float32)
    _, (row, column) = ndimage.distance_transform_edt(~core, return_indices=True)
    cover = np.clip(chroma / chroma[row, column], 0, 1)
    grey = (darkest - cover * darkest[row, column]) / np.maximum(1 - cover, 1e-3)
    return np.clip(np.rint(grey), 0, 255), cover


def _with_grain(filled: np.ndarray, photo: np.ndarray, strokes: np.ndarray) -> np.ndarray:
    """The filled picture with the fine grain that the photo has on the other side of the stroke's edge."""
    import cv2

    smooth = cv2.GaussianBlur(np.where(strokes, filled, photo).astype(np.float32), (0, 0), 1)
    untouched = ~ndimage.binary_dilation(strokes, _GROWN, 2)
    grain = np.where(untouched, photo - smooth, 0)
    # Edges of rocks are no grain: mirrored into the hole they would be specks.
    usual = cv2.medianBlur(np.clip(np.rint(10 * np.abs(grain)), 0, 255).astype(np.uint8), _USUAL_PX) / 10
    grain = np.clip(grain, -_MOST_GRAIN * usual, _MOST_GRAIN * usual)
    _, (row, column) = ndimage.distance_transform_edt(~untouched, return_indices=True)
    here = np.indices(strokes.shape)
    row = np.clip(2 * row - here[0], 0, strokes.shape[0] - 1)
    column = np.clip(2 * column - here[1], 0, strokes.shape[1] - 1)
    return np.clip(np.rint(filled + grain[row, column]), 0, 255)


def drawn_boxes(strokes: np.ndarray) -> np.ndarray:
    """(n, 4) insides of the boxes that were drawn, x0 y0 x1 y1: what lines (h, w) fence off and fills its rectangle.

    Numbers that touch a box's line from within, and boxes that meet, may hide one.
    """
    fenced, _ = ndimage.label(~strokes)
    found = []
    for number, window in enumerate(ndimage.find_objects(fenced), 1):
        rows, columns = window
        high, wide = rows.stop - rows.start, columns.stop - columns.start
        filled = ndimage.binary_fill_holes(fenced[window] == number).mean()
        touches_border = min(rows.start, columns.start) == 0 and high * wide > strokes.size / 4
        if min(high, wide) >= _LEAST_SIDE and filled >= _LEAST_FILL and not touches_border:
            found.append([columns.start, rows.start, columns.stop, rows.stop])
    return np.array(found, float).reshape(-1, 4)


def draw_strokes(
    photo: np.ndarray, boxes: np.ndarray, numbers: Sequence[int], colour: Colour, width: int, digits: float
) -> np.ndarray:
    """(h, w, 3) uint8: a grey photo (h, w) with boxes (n, 4) of a line `width` in px, each with its number above it.

    `digits`: height of the numbers, px.
    """
    import cv2

    picture = np.repeat(photo[..., None], 3, axis=-1)
    font = cv2.FONT_HERSHEY_SIMPLEX
    scale = digits / cv2.getTextSize("0", font, 1, 1)[0][1]
    for (x0, y0, x1, y1), number in zip(np.rint(boxes).astype(int).tolist(), numbers, strict=True):
        cv2.rectangle(picture, (x0, y0), (x1, y1), colour, width)
        cv2.putText(picture, str(number), (x0 + 4, y0 - 4), font, scale, colour, max(1, width - 1), cv2.LINE_AA)
    return picture


def augment_with_annotations(
    photo: np.ndarray, most_boxes: int, random: np.random.Generator, size_px: float
) -> np.ndarray:
    """A grey photo (h, w) uint8 with boxes and digits drawn at random positions and taken out again.

    Positions and sizes know nothing of the photo's labels, so that traces, if any stay, say nothing about rocks.
    `size_px`: of a cover photo's lines 3 to 4 px wide here, from the ratio of the two widths; sides of boxes are those
    of the published labels, log-uniform from 25 to 200 px of a full photo.
    """
    if not most_boxes or random.random() < _UNTOUCHED:
        return photo
    count = int(random.integers(1, most_boxes + 1))
    high, wide = photo.shape
    scale = wide / size_px
    sides = np.exp(random.uniform(np.log(25), np.log(200), (count, 1))) * random.uniform(0.7, 1.4, (count, 2)) * scale
    corner = random.uniform(0, 1, (count, 2)) * [wide, high] - sides / 2
    boxes = np.concatenate([corner, corner + sides], axis=1)
    line = max(1, round(float(random.uniform(3, 4.5)) * scale))
    colour = COLOURS[random.integers(len(COLOURS))]
    numbers = random.integers(1, 30, count).tolist()
    return erase_strokes(draw_strokes(photo, boxes, numbers, colour, line, 26 * scale))
