"""What the detectors of several seeds see in cover photos, as one detector would."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect.dataset import BOX_COLUMNS
from polarsim.detect.detectors import MAX_BOXES
from polarsim.detect.fusion import fuse
from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import prediction_table
from polarsim.formats import tables
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.detect import PREDICTIONS

_NOTHING = np.zeros((0, 6))


def merge_seeds(*, predictions: Sequence[Path], merged: Path, options: PredictionOptions) -> None:
    """Write one prediction table of several, which detectors of other seeds made of the same photos: see `fusion.fuse`.

    Raises
    ------
    PolarsimError
        A file is missing or broken.
    """
    found = [_by_photo(tables.read_parquet(path, PREDICTIONS.columns)) for path in predictions]
    rows = [
        (key, BOX_CLASSES[int(box[5])], box[4], *box[:4])
        for key in sorted(set().union(*found))
        for box in fuse([own.get(key, _NOTHING) for own in found], options.nms_iou, MAX_BOXES)
    ]
    tables.write_parquet(merged, prediction_table(rows))


def _by_photo(table: pd.DataFrame) -> dict[str, np.ndarray]:
    """Boxes (n, 6) of every photo."""
    numbered = table.assign(kind=table["kind"].map(BOX_CLASSES.index))
    columns = [*BOX_COLUMNS, "confidence", "kind"]
    return {str(key): rows.to_numpy(float) for key, rows in numbered.groupby("key")[columns]}
