"""Table of the evaluation of the packaged detector on images from outside POLAR."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from polarsim.formats.tables import read_parquet
from polarsim.report.layout import write_table
from polarsim.schemas.detect import ELSEWHERE

CAPTION = (
    "Packaged detector on images from outside POLAR, rocks only: recall by the longer side of the label over the image "
    "width, at a confidence of 0.25 and at 0.5 false positives per image, AP@0.5 with 95 % interval over images, "
    "false positives per image, calibration error, and share of images marked as not calibrated."
)


def tabulate_elsewhere(*, scores: Sequence[Path], table: Path, origin: Mapping[str, str]) -> None:
    """Write the table `elsewhere` from the scores of all folders. `table` is a path without suffix."""
    rows = pd.concat([read_parquet(path, ELSEWHERE.columns) for path in scores], ignore_index=True)
    write_table(table, rows, CAPTION, origin=origin)
