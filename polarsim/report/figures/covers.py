"""Every real cover photo with its labels, and with what a detector finds in it that has not seen its terrain."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.geometry import boxes
from polarsim.geometry.matching import match
from polarsim.photo import COLOURS, HEIGHT, ROCK, WIDTH
from polarsim.report.figures.canvas import FIGURE_WIDTH, boxed, page, picture
from polarsim.schemas.detect import PREDICTIONS

_COLUMNS = 2
_TITLE_PX = 40
_FOUND = (0, 229, 255)  # of predicted boxes
_CORNERS = ["x0", "y0", "x1", "y1"]
_SAME = 0.5  # IoU from which a prediction is right


def draw_covers(*, photos: Path, labels: Path, predictions: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure: a panel a cover photo, rocks alone.

    Parameters
    ----------
    photos : Path
        Folder of cover photos without strokes, `KEY.png`.
    labels : Path
        Their label table.
    predictions : Path
        Prediction table of all of them.
    """
    drawn = read_parquet(labels, LABEL_COLUMNS)
    found = read_parquet(predictions, PREDICTIONS.columns)
    drawn, found = drawn[drawn["kind"] == ROCK], found[found["kind"] == ROCK]
    least = best_confidence(drawn[drawn["key"].isin(found["key"])], found)
    found = found[found["confidence"] >= least]
    paths = sorted(photos.glob("*.png"))
    rows = -(-len(paths) // _COLUMNS)
    column = width // _COLUMNS
    with page(figure, width, rows * (round(column * HEIGHT / WIDTH) + _TITLE_PX)) as sheet:
        grid = sheet.subplots(rows, _COLUMNS, squeeze=False).ravel()
        for axes in grid[len(paths) :]:
            axes.set_axis_off()
        for axes, path in zip(grid, paths, strict=False):
            key = path.stem
            own, seen = (table.loc[table["key"] == key, _CORNERS].to_numpy(float) for table in (drawn, found))
            coloured = [*((box, COLOURS[ROCK]) for box in own), *((box, _FOUND) for box in seen)]
            picture(axes, boxed(png.read(path), coloured, column), f"{key}, confidence from {least:.2f}")


def best_confidence(labels: pd.DataFrame, predictions: pd.DataFrame) -> float:
    """Confidence at which the F1 of all predictions is largest; 1 without any that is right.

    The surest prediction first takes the label with the largest IoU, if that is 0.5 or more, that is still free.
    """
    ordered = predictions.sort_values("confidence", ascending=False, kind="stable")
    corners, right = ordered[_CORNERS].to_numpy(float), np.zeros(len(ordered), bool)
    for key, rows in ordered.groupby("key").indices.items():
        own = labels.loc[labels["key"] == key, _CORNERS].to_numpy(float)
        overlap = boxes.iou(corners[rows], own)
        right[rows] = match(overlap, np.array([_SAME]), np.zeros((1, len(own)), bool))[0][0, 0]
    f1 = 2 * np.cumsum(right) / (np.arange(1, len(right) + 1) + len(labels))
    return float(ordered["confidence"].iloc[f1.argmax()]) if right.any() else 1.0
