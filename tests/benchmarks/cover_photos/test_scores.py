"""Detectors of cover photos are scored as by hand."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.cover_photos.scores import cover_figures


def labelled(key, boxes, **more):
    return pd.DataFrame(boxes, columns=["x0", "y0", "x1", "y1"]).assign(key=key, kind="rock", **more)


def test_figures_are_pooled_over_photos_and_intervals_hold_them():
    """By hand, hit, miss, hit of 4 labels: precision 1 to recall 1/4, 2/3 to 1/2: (26 + 25 * 2/3) / 101."""
    boxes = np.array([[10.0, 10, 50, 50], [100, 100, 150, 150]])
    labels = pd.concat([labelled("a", boxes), labelled("b", boxes)])
    predictions = pd.concat(
        [
            labelled("a", boxes[:1], confidence=0.9),
            labelled("b", [[300.0, 300, 340, 340]], confidence=0.8),
            labelled("b", boxes[1:], confidence=0.3),
        ]
    )
    row = cover_figures(labels, predictions, ["a", "b"], seed=0, resamples=200).set_index("kind").loc["rock"]
    assert row["map50"] == pytest.approx((26 + 25 * 2 / 3) / 101)
    assert row["map50_low"] <= row["map50"] <= row["map50_high"]
    assert row["iou_mean"] == pytest.approx(0.5)
    assert row["labels"] == 4
