"""Fusion of the predictions of several training seeds."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from polarsim.detect.detectors import MAX_BOXES
from polarsim.detect.fusion import fuse
from polarsim.detect.grouping import detection_rows, detections_by_photo
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import prediction_table
from polarsim.formats import tables
from polarsim.schemas.detect import PREDICTIONS


def merge_seeds(*, predictions: Sequence[Path], merged: Path, options: PredictionOptions) -> None:
    """Merge prediction tables of several training seeds on the same photos, see `fusion.fuse`.

    Raises
    ------
    PolarsimError
        Missing or invalid file.
    """
    parts = [tables.read_parquet(path, PREDICTIONS.columns) for path in predictions]
    keys = sorted(set().union(*(table["key"] for table in parts)))
    boxes = [detections_by_photo(table, keys) for table in parts]
    fused = {key: fuse([of_seed[key] for of_seed in boxes], options.nms_iou, MAX_BOXES) for key in keys}
    rows = [row for key in keys for row in detection_rows(key, fused[key])]
    tables.write_parquet(merged, prediction_table(rows))
