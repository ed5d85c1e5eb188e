"""Predictions of a judge on the test pictures of a domain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import judges
from polarsim.detect.dataset import BOX_COLUMNS, read_pictures
from polarsim.detect.options import DetectOptions
from polarsim.detect.parts import digest, write_in_parts
from polarsim.detect.split import TEST
from polarsim.errors import DetectError, about
from polarsim.formats import png
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES, HEIGHT, WIDTH

PREDICTION_COLUMNS = ("key", "kind", "confidence", *BOX_COLUMNS)
STRIDE = 32  # a network's pictures have sides that are multiples of it
PADDING = 114  # grey value around the picture, as in training
BATCH = 8
PART = 25 * BATCH  # pictures whose predictions are held in memory


def predict(*, weights: Path, dataset: Path, predictions: Path, options: DetectOptions, threads: int) -> None:
    """Write what a judge sees in the test part of a data set, boxes in pixels of the full photo.

    Memory does not grow with the number of pictures; a call that was stopped goes on where it stopped.

    Raises
    ------
    PolarsimError
        Weights that are no judge, a broken picture or data set.
    """
    judge = judges.read_judge(weights)
    keys = read_pictures(dataset, TEST)
    predictions.parent.mkdir(parents=True, exist_ok=True)
    library = judges.ultralytics(predictions.parent)
    with about(weights):
        module = judges.network(judge, predictions.parent)
    paths = {key: dataset / "images" / TEST / f"{key}.png" for key in keys}

    def see(some: Sequence[str]) -> pd.DataFrame:
        rows: list[tuple[Any, ...]] = []
        for group in (some[n : n + BATCH] for n in range(0, len(some), BATCH)):
            pictures = [_read(paths[key]) for key in group]
            results = detect(module, library, pictures, judge.imgsz, options, threads)
            rows += [
                (key, BOX_CLASSES[int(found[5])], found[4], *found[:4])
                for key, result in zip(group, results, strict=True)
                for found in result
            ]
        return _table(rows)

    identity = digest([weights, *paths.values()], options.model_dump_json())
    write_in_parts(predictions, keys, see, PART, identity)


def detect(
    module: Any, library: Any, pictures: list[np.ndarray], imgsz: int, options: DetectOptions, threads: int
) -> Iterator[np.ndarray]:
    """What a network sees in pictures (h, w) uint8 of one size: for each (n, 6) x0, y0, x1, y1, confidence, class.

    Boxes are in pixels of a full photo, whatever the pictures' size.
    """
    import torch

    if len({picture.shape for picture in pictures}) > 1:
        raise DetectError(f"pictures of sizes {sorted({picture.shape for picture in pictures})}, expected one size")
    torch.set_num_threads(threads)
    device = judges.choose_device(options.device)
    framed = [frame(picture, imgsz) for picture in pictures]
    batch = torch.from_numpy(np.stack([pixels for pixels, _, _ in framed]))[:, None].expand(-1, 3, -1, -1)
    with torch.inference_mode():
        module = module.to(device, memory_format=torch.channels_last)
        output = module(batch.to(device).float().contiguous(memory_format=torch.channels_last) / 255)
        found = library.non_max_suppression(
            output,
            conf_thres=options.confidence,
            iou_thres=options.nms_iou,
            max_det=options.max_boxes,
        )
    for result, (_, offset, scale) in zip(found, framed, strict=True):
        boxes_found = result.cpu().numpy().astype(float)
        boxes_found[:, :4] = (boxes_found[:, :4] - np.tile(offset, 2)) * np.tile(scale, 2)
        boxes_found[:, :4] = boxes.clip(boxes_found[:, :4])
        yield boxes_found[boxes.area(boxes_found[:, :4]) > 0]


def frame(picture: np.ndarray, imgsz: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A picture (h, w) uint8 as the network takes it: longer side `imgsz`, padded to whole strides.

    Returns the pixels, the (x, y) offset of the picture in them, and the (x, y) pixels of a full photo to one of them.
    """
    import cv2

    height, width = picture.shape
    if max(height, width) != imgsz:
        scale = imgsz / max(height, width)
        width, height = round(width * scale), round(height * scale)
        picture = np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_LINEAR))
    rows, columns = -height % STRIDE, -width % STRIDE
    top, left = rows // 2, columns // 2
    pixels = np.pad(picture, ((top, rows - top), (left, columns - left)), constant_values=PADDING)
    return pixels, np.array([left, top], float), np.array([WIDTH / width, HEIGHT / height])


def _read(path: Path) -> np.ndarray:
    pixels = png.read(path)
    if pixels.ndim != 2 or pixels.dtype != np.uint8:
        raise DetectError(f"{path}: {pixels.dtype} with shape {pixels.shape}, expected one channel of 8 bits")
    return pixels


def _table(rows: list[tuple[Any, ...]]) -> pd.DataFrame:
    """Rounded and ordered: by photo and kind, the surest first."""
    table = pd.DataFrame(rows, columns=list(PREDICTION_COLUMNS))
    for name in ("key", "kind"):
        table[name] = table[name].astype("str")
    table["confidence"] = table["confidence"].astype("float64").round(5)
    for name in BOX_COLUMNS:
        table[name] = table[name].astype("float64").round(2)
    order = [True, True, False, *[True] * 4]
    return table.sort_values(list(PREDICTION_COLUMNS), ascending=order, kind="stable", ignore_index=True)
