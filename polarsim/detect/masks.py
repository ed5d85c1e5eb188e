"""Masks of ground, rocks and shadows, by detectors that were trained with masks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.detect import detectors
from polarsim.detect.dataset import read_pictures
from polarsim.detect.frame import frame, read_picture
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import sizes_of
from polarsim.detect.split import TEST
from polarsim.errors import about
from polarsim.formats.files import writing_folder
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH
from polarsim.progress import track
from polarsim.run_files import class_masks

LoadedAt = tuple[detectors.LoadedMasks, tuple[int, ...]]  # what makes masks, and the widths that it looks at


def segment_pictures(
    *, weights: Sequence[Path], dataset: Path, masks: Path, options: PredictionOptions, threads: int
) -> None:
    """Write what a detector takes every pixel of the test part of a data set for: `KEY.png` as large as a photo.

    Parameters
    ----------
    weights
        A detector, or several whose probabilities are averaged.

    Raises
    ------
    PolarsimError
        Weights without a head for masks, a broken picture or data set.
    """
    loaded = []
    for path in weights:
        with about(path):
            detector = detectors.read_detector(path)
            loaded.append((detectors.load_masks(detector, options, threads), mask_widths(detector, options)))
    with writing_folder(masks) as folder:
        for key in track(read_pictures(dataset, TEST), "masks"):
            picture = read_picture(dataset / "images" / TEST / f"{key}.png")
            class_masks.write(folder / f"{key}.png", class_mask(loaded, picture))


def mask_widths(detector: detectors.Detector, options: PredictionOptions) -> tuple[int, ...]:
    """At which widths a detector looks at a picture for its mask: those that the options name, else those for boxes."""
    return options.mask_widths or tuple(sizes_of(detector, options).widths)


def class_mask(loaded: Sequence[LoadedAt], picture: np.ndarray, full: tuple[int, int] = (WIDTH, HEIGHT)) -> np.ndarray:
    """(height, width) uint8: the likeliest class of every pixel of a whole picture.

    Detectors' probabilities are averaged, each over the widths that it looks at.

    Parameters
    ----------
    picture
        (h, w) uint8, maybe smaller than the whole picture, which is `full` wide and high.
    """
    shown = [_probabilities(one, picture, widths, full) for one, widths in loaded]
    return np.asarray(sum(shown[1:], start=shown[0])).argmax(axis=-1).astype(np.uint8)


def within_boxes(mask: np.ndarray, found: np.ndarray) -> np.ndarray:
    """A class mask (h, w) with ground for the rocks and shadows that lie in no box (n, 6) of their kind.

    A detector's boxes are surer than its mask: they leave out most of what looks like rock on walls and relief.
    """
    kept = np.full_like(mask, class_masks.CLASSES.index("ground"))
    for x0, y0, x1, y1, _, kind in found:
        inside = slice(int(np.floor(y0)), int(np.ceil(y1))), slice(int(np.floor(x0)), int(np.ceil(x1)))
        number = class_masks.CLASSES.index(BOX_CLASSES[int(kind)])
        kept[inside][mask[inside] == number] = number
    return kept


def _probabilities(
    loaded: detectors.LoadedMasks, picture: np.ndarray, widths: Sequence[int], full: tuple[int, int]
) -> np.ndarray:
    """(height, width, classes) float32 for every pixel of a whole picture, mean over the widths it is looked at."""
    shown = [_probabilities_at(loaded, picture, width, full) for width in widths]
    return np.asarray(sum(shown[1:], start=shown[0]) / np.float32(len(shown)))


def _probabilities_at(
    loaded: detectors.LoadedMasks, picture: np.ndarray, width: int, full: tuple[int, int]
) -> np.ndarray:
    import cv2

    framed, offset, scale = frame(picture, width, full)
    cells = np.ascontiguousarray(loaded(framed[None])[0].transpose(1, 2, 0))
    cell_px = framed.shape[1] / cells.shape[1]
    # From a pixel's centre in the whole picture to cells; OpenCV counts both from the first one's centre.
    factor = 1 / (scale * cell_px)
    start = HALF_PIXEL * factor + offset / cell_px - HALF_PIXEL
    matrix = np.column_stack([np.diag(factor), start])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(cells, matrix, full, flags=flags, borderMode=cv2.BORDER_REPLICATE))
