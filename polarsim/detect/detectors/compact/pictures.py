"""Loading and augmentation of training images with boxes and masks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.detect.dataset import KINDS, MASKS, dataset_images
from polarsim.detect.frame import PADDING, letterbox, read_picture
from polarsim.errors import DetectError
from polarsim.formats import yolo
from polarsim.geometry.boxes import area, clip
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.run_files import class_masks

_CACHE_BYTES = 1 << 30  # memory of cached images; the remaining images are read in every epoch
_TRANSLATION, _SCALE, _BRIGHTNESS = 0.1, 0.3, 0.3  # maximum relative changes, equal to those of YOLO detectors
_MIN_VISIBLE_SHARE = 0.25  # minimum visible share of a box in an augmented image
_MIN_SIDE = 0.5  # minimum side of a box, px


@dataclass(frozen=True)
class TrainingImage:
    """Network input with labels."""

    pixels: np.ndarray  # (h, w) uint8
    classes: np.ndarray  # (n,) int64
    boxes: np.ndarray  # (n, 4) x0, y0, x1, y1 in px of the picture
    mask: np.ndarray | None = None  # (h, w) uint8, see `class_masks`; None without mask training


class TrainingImages:
    """Images of a part of a data set, cached in memory up to `_CACHE_BYTES`."""

    def __init__(self, dataset: Path, part: str, imgsz: int, masks: bool = False) -> None:
        self._dataset, self._part, self._imgsz, self._masks = dataset, part, imgsz, masks
        self._keys = dataset_images(dataset, part)
        self._cache: dict[int, TrainingImage] = {}
        self._room = _CACHE_BYTES

    def __len__(self) -> int:
        return len(self._keys)

    def __getitem__(self, index: int) -> TrainingImage:
        if index in self._cache:
            return self._cache[index]
        picture = self._read(self._keys[index])
        size = picture.pixels.nbytes * (1 if picture.mask is None else 2)
        if self._room >= size:
            self._cache[index] = picture
            self._room -= size
        return picture

    def _read(self, key: str) -> TrainingImage:
        image, label, mask_file = (
            self._dataset / kind / self._part / f"{key}{ending}" for kind, ending in (*KINDS, (MASKS, ".png"))
        )
        picture = read_picture(image)
        size = picture.shape[1], picture.shape[0]
        pixels, offset, scale = letterbox(picture, self._imgsz, size)
        classes, boxes = yolo.read_boxes(label, size)
        mask = _framed(class_masks.read_class_mask(mask_file), pixels, offset, size / scale) if self._masks else None
        return TrainingImage(pixels, classes, boxes / np.tile(scale, 2) + np.tile(offset, 2), mask)


def _framed(mask: np.ndarray, pixels: np.ndarray, offset: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Resize a mask (h, w) to the image of a size (width, height) in the output of `letterbox`, with offset (x, y).

    Padding gets the value `IGNORED`.
    """
    width, height = (round(side) for side in size)
    left, top = offset.astype(int)
    framed = np.full(pixels.shape, class_masks.IGNORED, np.uint8)
    framed[top : top + height, left : left + width] = class_masks.resized(mask, (width, height))
    return framed


def class_shares(mask: np.ndarray, cell: int) -> np.ndarray:
    """Return the share of each class (classes, h / cell, w / cell) float32 in the cells of a mask (h, w)."""
    height, width = mask.shape
    cells = mask.reshape(height // cell, cell, width // cell, cell)
    return np.stack(
        [(cells == number).mean(axis=(1, 3), dtype=np.float32) for number in range(len(class_masks.CLASSES))]
    )


def batches(pictures: TrainingImages, order: np.ndarray, size: int) -> Iterator[list[TrainingImage]]:
    """Yield batches of images in the given order; different sizes in a batch are an error."""
    for start in range(0, len(order), size):
        batch = [pictures[int(index)] for index in order[start : start + size]]
        if len({picture.pixels.shape for picture in batch}) > 1:
            raise DetectError(f"images of sizes {sorted({x.pixels.shape for x in batch})}, expected equal sizes")
        yield batch


def augment(picture: TrainingImage, random: np.random.Generator) -> TrainingImage:
    """Mirror, shift, scale and brighten or darken an image with its boxes and mask at random."""
    import cv2

    height, width = picture.pixels.shape
    scale = 1 + random.uniform(-_SCALE, _SCALE)
    translation = random.uniform(-_TRANSLATION, _TRANSLATION, 2) * (width, height)
    mirror = -1 if random.random() < 0.5 else 1
    centre = np.array([width, height]) / 2
    factor = np.array([mirror * scale, scale])
    offset = centre + translation - factor * centre  # origin at the corner of the image
    # The origin of OpenCV is the centre of the first pixel.
    matrix = np.column_stack([np.diag(factor), offset + HALF_PIXEL * factor - HALF_PIXEL])

    def warped(values: np.ndarray, flags: int, border: int) -> np.ndarray:
        return np.asarray(
            cv2.warpAffine(values, matrix, (width, height), flags=flags, borderValue=(float(border),) * 4)
        )

    pixels = warped(picture.pixels, cv2.INTER_LINEAR, PADDING)
    mask = None if picture.mask is None else warped(picture.mask, cv2.INTER_NEAREST, class_masks.IGNORED)
    gain = 1 + random.uniform(-_BRIGHTNESS, _BRIGHTNESS)
    pixels = np.clip(pixels * gain + 0.5, 0, 255).astype(np.uint8)
    low, high = picture.boxes[:, :2] * factor + offset, picture.boxes[:, 2:] * factor + offset
    moved = np.concatenate([np.minimum(low, high), np.maximum(low, high)], axis=1)
    inside = clip(moved, width, height)
    sides = inside[:, 2:] - inside[:, :2]
    visible = (sides.min(axis=1) >= _MIN_SIDE) & (area(inside) >= _MIN_VISIBLE_SHARE * area(moved))
    return TrainingImage(pixels, picture.classes[visible], inside[visible], mask)
