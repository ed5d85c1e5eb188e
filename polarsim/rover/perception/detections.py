"""Detect rocks and shadows in the front camera's pictures of a drive.

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
from polarsim.formats import png
from polarsim.formats.table_parts import write_in_parts
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.provenance import identity, is_current, store_identity
from polarsim.rover.cameras.layout import BOX, DETECTION_COLUMNS, picture_folder, require_pictures
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.mounts import FRONT
from polarsim.rover.vehicle.table import Vehicle

_BATCH = 8
_PART = 25 * _BATCH


class FrontCameraDetector:
    """Detector for pictures of the front camera, `width` px wide; shadows are skipped if `rocks_only`."""

    def __init__(self, applied: OnboardDetector, width: int, threads: int = 1, *, rocks_only: bool = False) -> None:
        """
        Raises
        ------
        PolarsimError
            The detector cannot be read.
        """
        detector = detectors.read_detector(applied.weights)
        with with_path(applied.weights):
            self._loaded = detectors.load_detector(detector, Path.cwd(), applied.prediction, threads)
        sizes = inference_widths_of(detector, applied.prediction).within(max_inference_width(width))
        self._sizes = ClassInferenceWidths.same(sizes.by_class[BOX_CLASSES.index(ROCK)]) if rocks_only else sizes
        self._applied = applied

    def detect(self, pictures: Sequence[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Return the detector's inputs, and (n, 6) boxes, confidences and classes, of 12-bit pictures (h, w)."""
        small = [tone.shrink(grey, max(self._sizes.widths)) for grey in pictures]
        eights = [tone.to_8_bits(each) for each in small]
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
    """Write the detections of each picture set of the front camera; sets that are current are kept.

    Raises
    ------
    PolarsimError
        The detector cannot be read, or a picture is missing.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    detector: FrontCameraDetector | None = None
    for sun, (model, exposure_ms) in product(suite.suns, options.pictures):
        pictures = picture_folder(folder, FRONT, sun, model, exposure_ms)
        paths = {f"{frame:05d}": pictures / f"{frame:05d}.png" for frame in suite.frames}
        require_pictures(paths.values())
        used = onboard.model_dump_json(include={"prediction"})
        made_with = identity(__name__, [onboard.weights, *paths.values()], used)
        if is_current(pictures / "detections.parquet", made_with):
            continue
        detector = detector or FrontCameraDetector(onboard, suite.mounts[FRONT].lens.width, threads)
        with store_identity(pictures / "detections.parquet", made_with):
            _write_detections(pictures, paths, detector, made_with)


def _write_detections(pictures: Path, paths: dict[str, Path], detector: FrontCameraDetector, made_with: str) -> None:
    def rows_of(names: Sequence[str]) -> pd.DataFrame:
        rows: list[tuple[Any, ...]] = []
        for group in (names[n : n + _BATCH] for n in range(0, len(names), _BATCH)):
            _, results = detector.detect([png.read_png(paths[name]) for name in group])
            for name, result in zip(group, results, strict=True):
                rows += [(int(name), BOX_CLASSES[int(r[5])], r[4], *r[:4]) for r in result]
        return detection_table(rows)

    write_in_parts(pictures / "detections.parquet", list(paths), rows_of, _PART, made_with)


def detection_table(rows: list[tuple[Any, ...]]) -> pd.DataFrame:
    """Return detections with data types, rounded, sorted by frame, kind and descending confidence."""
    dtypes = {"frame": "int64", "kind": "str", **dict.fromkeys(("confidence", *BOX), "float64")}
    table = pd.DataFrame(rows, columns=list(DETECTION_COLUMNS)).astype(dtypes)
    table = table.round({"confidence": 5, **dict.fromkeys(BOX, 2)})
    order = [True, True, False, *[True] * 4]
    return table.sort_values(list(DETECTION_COLUMNS), ascending=order, kind="stable", ignore_index=True)
