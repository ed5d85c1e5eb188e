"""What the detectors of several seeds see in cover photos, as one detector would."""

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
    """Write one prediction table of several, which detectors of other seeds made of the same photos: see `fusion.fuse`.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    found = [tables.read_parquet(path, PREDICTIONS.columns) for path in predictions]
    keys = sorted(set().union(*(table["key"] for table in found)))
    boxes = [detections_by_photo(table, keys) for table in found]
    fused = {key: fuse([own[key] for own in boxes], options.nms_iou, MAX_BOXES) for key in keys}
    rows = [row for key in keys for row in detection_rows(key, fused[key])]
    tables.write_parquet(merged, prediction_table(rows))
