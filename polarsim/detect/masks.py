"""Masks of ground, rocks and shadows, predicted by detectors trained with masks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.detect import detectors
from polarsim.detect.dataset import dataset_images
from polarsim.detect.frame import letterbox, read_picture
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import inference_widths_of
from polarsim.detect.split import TEST
from polarsim.errors import with_path
from polarsim.formats.files import writing_folder
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.photo import BOX_CLASSES
from polarsim.progress import track
from polarsim.run_files import class_masks

MaskInference = tuple[detectors.LoadedMasks, tuple[int, ...]]  # mask inference and its widths


def segment_pictures(
    *,
    weights: Sequence[Path],
    dataset: Path,
    masks: Path,
    size: tuple[int, int],
    options: PredictionOptions,
    threads: int,
) -> None:
    """Write the class mask `KEY.png`, of the size of photos, of each image in the test part of a data set."""
    loaded = [load_segmenter(path, options, threads) for path in weights]
    with writing_folder(masks) as folder:
        for key in track(dataset_images(dataset, TEST), "masks"):
            picture = read_picture(dataset / "images" / TEST / f"{key}.png")
            class_masks.write_class_mask(folder / f"{key}.png", class_mask(loaded, picture, size))


def load_segmenter(path: Path, options: PredictionOptions, threads: int) -> MaskInference:
    """Return the mask inference of a detector and its widths: `mask_widths` of the options, else those for boxes."""
    with with_path(path):
        detector = detectors.read_detector(path)
        loaded = detectors.load_masks(detector, options, threads)
    return loaded, options.mask_widths or tuple(inference_widths_of(detector, options).widths)


def class_mask(loaded: Sequence[MaskInference], picture: np.ndarray, full: tuple[int, int]) -> np.ndarray:
    """Return the most probable class (height, width) uint8 of each pixel of an image of size `full` (width, height).

    Probabilities are averaged over detectors and inference widths. The picture (h, w) uint8 may be a reduced copy.
    """
    total: np.ndarray = np.zeros((), np.float32)
    for detector, widths in loaded:
        by_width = [_probabilities_at(detector, picture, width, full) for width in widths]
        total = total + sum(by_width[1:], start=by_width[0]) / np.float32(len(by_width))
    return np.asarray(total.argmax(axis=-1)).astype(np.uint8)


def within_boxes(mask: np.ndarray, detections: np.ndarray) -> np.ndarray:
    """Replace rocks and shadows outside the boxes (n, 6) of their class in a class mask (h, w) by ground.

    The boxes of a detector have fewer false positives than the mask on walls and relief.
    """
    kept = np.full_like(mask, class_masks.CLASSES.index("ground"))
    for x0, y0, x1, y1, _, kind in detections:
        inside = slice(int(np.floor(y0)), int(np.ceil(y1))), slice(int(np.floor(x0)), int(np.ceil(x1)))
        number = class_masks.CLASSES.index(BOX_CLASSES[int(kind)])
        kept[inside][mask[inside] == number] = number
    return kept


def _probabilities_at(
    loaded: detectors.LoadedMasks, picture: np.ndarray, width: int, full: tuple[int, int]
) -> np.ndarray:
    """Return class probabilities (height, width, classes) float32 of each pixel of the full image."""
    import cv2

    framed, offset, scale = letterbox(picture, width, full)
    cells = np.ascontiguousarray(loaded(framed[None])[0].transpose(1, 2, 0))
    cell_px = framed.shape[1] / cells.shape[1]
    # From pixels of the full image to cells; the origin of OpenCV is the centre of the first pixel.
    factor = 1 / (scale * cell_px)
    start = HALF_PIXEL * factor + offset / cell_px - HALF_PIXEL
    matrix = np.column_stack([np.diag(factor), start])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpAffine(cells, matrix, full, flags=flags, borderMode=cv2.BORDER_REPLICATE))
