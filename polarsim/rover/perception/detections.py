"""Rocks and shadows in the front camera's pictures: detections of a drive, and labels with contrast in a picture.

Output below a drive's folder: `front_end_cam/<Sun>_<model>_<exposure>/detections.parquet`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.detect import detectors, tone
from polarsim.detect.frame import max_inference_width
from polarsim.detect.inference_widths import ClassInferenceWidths
from polarsim.detect.predict import inference_widths_of, predict_images
from polarsim.errors import with_path
from polarsim.formats import png, tables
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.progress import track
from polarsim.rover.cameras.layout import BOX, DETECTION_COLUMNS, frame_files, picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.table import Vehicle

_BATCH = 8
_RIM_PX = 2  # margin around a box that is included in the contrast
_DARK_PERCENT, _BRIGHT_PERCENT = 2, 98
# Minimum contrast of a visible label, as a share of white. Rocks in the rover's shadow are below it.
MIN_CONTRAST = 0.06


class FrontCameraDetector:
    """Detector for pictures of the front camera, `width` px wide; shadows are skipped if `rocks_only`."""

    def __init__(self, applied: OnboardDetector, width: int, threads: int = 1, *, rocks_only: bool = False) -> None:
        detector = detectors.read_detector(applied.weights)
        with with_path(applied.weights):
            self._loaded = detectors.load_detector(detector, Path.cwd(), applied.prediction, threads)
        sizes = inference_widths_of(detector, applied.prediction).within(max_inference_width(width))
        self._sizes = ClassInferenceWidths.same(sizes.by_class[BOX_CLASSES.index(ROCK)]) if rocks_only else sizes
        self._applied = applied

    def detect(self, pictures: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the detector's inputs, and (n, 6) boxes, confidences and classes, of 12-bit pictures (h, w)."""
        eights = [tone.to_8_bits(tone.shrink(grey, max(self._sizes.widths))) for grey in pictures]
        full = pictures[0].shape[1], pictures[0].shape[0]
        return eights, list(predict_images(self._loaded, eights, self._sizes, self._applied.prediction.nms_iou, full))


def detect_drive(
    folder: Path,
    vehicle: Vehicle,
    options: CameraSuiteOptions,
    onboard: OnboardDetector,
    seed: int,
    threads: int = 1,
) -> None:
    """Write the detections of each picture set of the front camera."""
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    detector = FrontCameraDetector(onboard, suite.mounts[FRONT].lens.width, threads)
    for sun, what in product(suite.suns, options.pictures):
        pictures = picture_folder(folder, FRONT, sun, *what)
        files, rows = frame_files(pictures, suite.frames), []
        for first in track(range(0, len(files), _BATCH), pictures.name):
            batch = slice(first, first + _BATCH)
            _, results = detector.detect([png.read_png(path) for path in files[batch]])
            for frame, boxes in zip(suite.frames[batch], results, strict=True):
                rows += [(frame, BOX_CLASSES[int(box[5])], box[4], *box[:4]) for box in boxes]
        tables.write_parquet(pictures / "detections.parquet", detection_table(rows))


def detection_table(rows: list[tuple[Any, ...]]) -> pd.DataFrame:
    """Return detections with data types, rounded, sorted by frame, kind and descending confidence."""
    dtypes = {"frame": "int64", "kind": "str", **dict.fromkeys(("confidence", *BOX), "float64")}
    table = pd.DataFrame(rows, columns=list(DETECTION_COLUMNS)).astype(dtypes)
    table = table.round({"confidence": 5, **dict.fromkeys(BOX, 2)})
    order = [True, True, False, *[True] * 4]
    return table.sort_values(list(DETECTION_COLUMNS), ascending=order, kind="stable", ignore_index=True)


def boxes_with_contrast(picture: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Return (n,) bool: boxes (n, 4) with a contrast of at least `MIN_CONTRAST` in the detector's input (h, w) uint8.

    Contrast is the difference of bright (98 %) and dark pixels (2 %), margin included, as a share of white. Rocks and
    shadows inside a larger shadow are labelled, but have too little contrast.
    """
    visible = np.zeros(len(boxes), bool)
    height, width = picture.shape
    for number, (x0, y0, x1, y1) in enumerate(np.asarray(boxes, float).reshape(-1, 4)):
        left, top = max(int(np.floor(x0)) - _RIM_PX, 0), max(int(np.floor(y0)) - _RIM_PX, 0)
        right, bottom = min(int(np.ceil(x1)) + _RIM_PX, width), min(int(np.ceil(y1)) + _RIM_PX, height)
        if right > left and bottom > top:
            dark, bright = np.percentile(picture[top:bottom, left:right], [_DARK_PERCENT, _BRIGHT_PERCENT])
            visible[number] = bright - dark >= MIN_CONTRAST * np.iinfo(np.uint8).max
    return visible
