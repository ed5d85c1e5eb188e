"""Annotation strokes (boxes and digits) in grey photos: detection, removal, and augmentation of training images.

Published cover photos are grey with red or blue annotations. Pixels with different channels are therefore strokes. At
the antialiased edges of a line, the grey value of the photo is recovered from the mixture of both colours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage

_PURE = 190  # minimum difference between the brightest and darkest channel of a pixel fully covered by a stroke
_MAX_GRAIN = 3  # maximum grain over the median grain in a square of _MEDIAN_PX
_MEDIAN_PX = 21
_MAX_COVER = 0.5  # maximum share of the stroke colour at which the grey value is recovered
_UNTOUCHED = 0.5  # share of images without strokes, because removing strokes takes longer than rendering a lamp
_GROWN = np.ones((3, 3), bool)
_REACH = 4  # radius of inpainting, px
_MIN_SIDE, _MIN_FILL = 12, 0.9  # inside of a drawn box: minimum side in px, minimum share of the bounding box
Colour = tuple[int, int, int]
COLOURS: tuple[Colour, ...] = ((255, 0, 0), (237, 28, 36), (0, 0, 255))  # of the published covers, RGB


def find_strokes(image: np.ndarray) -> np.ndarray:
    """Return the pixels (h, w) bool of an image (h, w, 3) uint8 with different channels."""
    return np.asarray(image.max(axis=-1) != image.min(axis=-1))


def erase_strokes(image: np.ndarray) -> np.ndarray:
    """Return the photo (h, w) uint8 without strokes.

    At antialiased edges the grey value of the photo is recovered. The remaining pixels are inpainted (Telea, J.
    Graphics Tools 9 (2004) 23), with the grain of the surrounding photo added, so that no smooth stripes remain.
    """
    import cv2

    strokes = find_strokes(image)
    grey, cover = _unmixed(image, strokes)
    hole = strokes & (cover > _MAX_COVER)
    photo = np.where(strokes & ~hole, grey, image[..., 1]).astype(np.uint8)
    if not hole.any():
        return photo
    filled = cv2.inpaint(photo, hole.astype(np.uint8), _REACH, cv2.INPAINT_TELEA)
    return np.where(hole, _with_grain(filled, photo, strokes), photo).astype(np.uint8)


def _unmixed(image: np.ndarray, strokes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the grey value (h, w) under the strokes, and the share (h, w) of the stroke colour in each pixel.

    A mixture is c s + (1 - c) g in every channel, with the colour s of the nearest pixel fully covered by a stroke.
    Therefore the chroma (maximum minus minimum channel) of the mixture is c times the chroma of the stroke.
    """
    darkest, brightest = (extreme(axis=-1).astype(np.float32) for extreme in (image.min, image.max))
    chroma = brightest - darkest
    core = strokes & (chroma > _PURE)
    if not core.any():
        return darkest, strokes.astype(np.float32)
    _, (row, column) = ndimage.distance_transform_edt(~core, return_indices=True)
    cover = np.clip(chroma / chroma[row, column], 0, 1)
    grey = (darkest - cover * darkest[row, column]) / np.maximum(1 - cover, 1e-3)
    return np.clip(np.rint(grey), 0, 255), cover


def _with_grain(filled: np.ndarray, photo: np.ndarray, strokes: np.ndarray) -> np.ndarray:
    """Return the inpainted image with the grain of the photo, mirrored at the edge of the strokes."""
    import cv2

    smooth = cv2.GaussianBlur(np.where(strokes, filled, photo).astype(np.float32), (0, 0), 1)
    untouched = ~ndimage.binary_dilation(strokes, _GROWN, 2)
    grain = np.where(untouched, photo - smooth, 0)
    # Clip the grain, because mirrored edges of rocks would be visible as specks.
    usual = cv2.medianBlur(np.clip(np.rint(10 * np.abs(grain)), 0, 255).astype(np.uint8), _MEDIAN_PX) / 10
    grain = np.clip(grain, -_MAX_GRAIN * usual, _MAX_GRAIN * usual)
    _, (row, column) = ndimage.distance_transform_edt(~untouched, return_indices=True)
    here = np.indices(strokes.shape)
    row = np.clip(2 * row - here[0], 0, strokes.shape[0] - 1)
    column = np.clip(2 * column - here[1], 0, strokes.shape[1] - 1)
    return np.clip(np.rint(filled + grain[row, column]), 0, 255)


def find_drawn_boxes(strokes: np.ndarray) -> np.ndarray:
    """Return the insides (n, 4) of drawn boxes, x0 y0 x1 y1: areas enclosed by strokes (h, w) that fill a rectangle.

    Boxes that touch a digit from inside or overlap may be missed.
    """
    enclosed, _ = ndimage.label(~strokes)
    boxes = []
    for number, window in enumerate(ndimage.find_objects(enclosed), 1):
        rows, columns = window
        high, wide = rows.stop - rows.start, columns.stop - columns.start
        filled = ndimage.binary_fill_holes(enclosed[window] == number).mean()
        touches_border = min(rows.start, columns.start) == 0 and high * wide > strokes.size / 4
        if min(high, wide) >= _MIN_SIDE and filled >= _MIN_FILL and not touches_border:
            boxes.append([columns.start, rows.start, columns.stop, rows.stop])
    return np.array(boxes, float).reshape(-1, 4)


def draw_strokes(
    photo: np.ndarray, boxes: np.ndarray, numbers: Sequence[int], colour: Colour, width: int, digits: float
) -> np.ndarray:
    """Draw boxes (n, 4) with line `width`, px, and numbers above the boxes into a grey photo (h, w).

    `digits`: height of the numbers, px. Returns an image (h, w, 3) uint8.
    """
    import cv2

    image = np.repeat(photo[..., None], 3, axis=-1)
    font = cv2.FONT_HERSHEY_SIMPLEX
    scale = digits / cv2.getTextSize("0", font, 1, 1)[0][1]
    for (x0, y0, x1, y1), number in zip(np.rint(boxes).astype(int).tolist(), numbers, strict=True):
        cv2.rectangle(image, (x0, y0), (x1, y1), colour, width)
        cv2.putText(image, str(number), (x0 + 4, y0 - 4), font, scale, colour, max(1, width - 1), cv2.LINE_AA)
    return image


def augment_with_annotations(
    photo: np.ndarray, max_boxes: int, random: np.random.Generator, size_px: float
) -> np.ndarray:
    """Draw boxes and digits at random positions into a grey photo (h, w) uint8 and erase them again.

    Positions and sizes are independent of the labels, so that remaining traces contain no information on rocks. The
    sides of boxes follow the published labels: log-uniform from 25 to 200 px in a full-size photo.

    `size_px`: width of a full-size photo, px; lines and boxes are scaled by the ratio of the widths.
    """
    if not max_boxes or random.random() < _UNTOUCHED:
        return photo
    count = int(random.integers(1, max_boxes + 1))
    high, wide = photo.shape
    scale = wide / size_px
    sides = np.exp(random.uniform(np.log(25), np.log(200), (count, 1))) * random.uniform(0.7, 1.4, (count, 2)) * scale
    corner = random.uniform(0, 1, (count, 2)) * [wide, high] - sides / 2
    boxes = np.concatenate([corner, corner + sides], axis=1)
    line = max(1, round(float(random.uniform(3, 4.5)) * scale))
    colour = COLOURS[random.integers(len(COLOURS))]
    numbers = random.integers(1, 30, count).tolist()
    return erase_strokes(draw_strokes(photo, boxes, numbers, colour, line, 26 * scale))
