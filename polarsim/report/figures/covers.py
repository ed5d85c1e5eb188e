"""Figure of the real cover photos with labels and predictions of the detectors of held-out terrains."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.geometry import boxes
from polarsim.geometry.matching_numba import match_predictions_of_photo
from polarsim.photo import COLOURS, ROCK
from polarsim.report.figures.canvas import (
    BOX_LEGEND,
    FIGURE_WIDTH,
    PREDICTED,
    aspect_of,
    box_legend,
    boxed,
    page,
    rgb,
    show_image,
)
from polarsim.schemas.detect import PREDICTIONS

_COLUMNS = 2
_TITLE_PX, _LEGEND_PX = 40, 50
_CORNERS = ["x0", "y0", "x1", "y1"]
_MIN_IOU = 0.5  # of a correct prediction


def draw_covers(*, photos: Path, labels: Path, predictions: Path, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write a panel per cover photo with labels and predictions of rocks.

    `photos` is the folder of cover photos without red lines, `KEY.png`.
    """
    annotated = read_parquet(labels, LABEL_COLUMNS)
    predicted = read_parquet(predictions, PREDICTIONS.columns)
    annotated, predicted = annotated[annotated["kind"] == ROCK], predicted[predicted["kind"] == ROCK]
    threshold = best_confidence(annotated[annotated["key"].isin(predicted["key"])], predicted)
    predicted = predicted[predicted["confidence"] >= threshold]
    paths = sorted(photos.glob("*.png"))
    rows = -(-len(paths) // _COLUMNS)
    column = width // _COLUMNS
    with page(figure, width, rows * (round(column * aspect_of(paths)) + _TITLE_PX) + _LEGEND_PX) as sheet:
        grid = sheet.subplots(rows, _COLUMNS, squeeze=False).ravel()
        for axes in grid[len(paths) :]:
            axes.set_axis_off()
        for axes, path in zip(grid, paths, strict=False):
            key = path.stem
            coloured = [
                (box, colour)
                for table, colour in ((annotated, COLOURS[ROCK]), (predicted, rgb(PREDICTED)))
                for box in table.loc[table["key"] == key, _CORNERS].to_numpy(float)
            ]
            show_image(
                axes, boxed(png.read_png(path), coloured, column), f"{key}, confidence of at least {threshold:.2f}"
            )
        box_legend(sheet, BOX_LEGEND)


def best_confidence(labels: pd.DataFrame, predictions: pd.DataFrame) -> float:
    """Return the confidence threshold that maximises F1; 1 if no prediction is correct.

    In order of decreasing confidence, each prediction is matched to the unmatched label with the largest IoU of at
    least 0.5.
    """
    ordered = predictions.sort_values("confidence", ascending=False, kind="stable")
    corners, correct = ordered[_CORNERS].to_numpy(float), np.zeros(len(ordered), bool)
    for key, rows in ordered.groupby("key").indices.items():
        label_corners = labels.loc[labels["key"] == key, _CORNERS].to_numpy(float)
        overlap = boxes.iou(corners[rows], label_corners)
        correct[rows] = match_predictions_of_photo(
            overlap, np.array([_MIN_IOU]), np.zeros((1, len(label_corners)), bool)
        )[0][0, 0]
    f1 = 2 * np.cumsum(correct) / (np.arange(1, len(correct) + 1) + len(labels))
    return float(ordered["confidence"].iloc[f1.argmax()]) if correct.any() else 1.0
