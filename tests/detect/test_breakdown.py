import numpy as np
import pandas as pd
import pytest

from polarsim.detect.breakdown import breakdown, curves, match_predictions
from polarsim.detect.ipd import instance_performance

BRIGHT, DIM, OTHER = "01_A_off_180_L_0512", "01_A_off_180_L_0064", "02_B_on_30_R_0512"
KEYS = sorted([BRIGHT, DIM, OTHER])
SMALL, LARGE = (0, 0, 20, 20), (200, 200, 400, 400)


def table(*rows):
    return pd.DataFrame([(key, kind, *box) for key, kind, box in rows], columns=["key", "kind", "x0", "y0", "x1", "y1"])


LABELS = table(
    (BRIGHT, "rock", SMALL), (BRIGHT, "rock", LARGE), (DIM, "rock", SMALL), (DIM, "rock", LARGE),
    (OTHER, "rock", LARGE), (OTHER, "shadow", SMALL),
).assign(rock=[1, 2, 1, 2, 1, 1])  # fmt: skip
FOUND = table(
    (BRIGHT, "rock", SMALL), (BRIGHT, "rock", LARGE), (DIM, "rock", LARGE), (OTHER, "rock", (0, 0, 5, 5))
).assign(confidence=0.9)  # fmt: skip


@pytest.fixture
def rows():
    matched = match_predictions(KEYS, LABELS, FOUND, instance_performance(LABELS, FOUND, 0))
    return breakdown(matched, resamples=100, group_resamples=100).set_index(["by", "group", "kind"])


def test_a_group_has_the_metrics_of_its_photos(rows):
    assert rows.loc[("exposure", "0512", "rock"), ["images", "labels", "iou_mean"]].tolist() == [2, 3, 2 / 3]
    assert rows.loc[("exposure", "0064", "rock"), ["images", "labels", "iou_mean"]].tolist() == [1, 2, 0.5]
    assert rows.loc[("exposure", "0064", "rock"), "map50"] == pytest.approx(51 / 101)
    assert rows.loc[("light", "on", "rock"), "map50"] == 0
    assert rows.loc[("terrain", "01", "rock"), "iou_mean"] == 0.75
    assert rows.loc[("azimuth", "30", "rock"), "labels"] == 1


def test_a_size_class_ignores_labels_and_boxes_of_different_sizes(rows):
    assert rows.loc[("size", "small", "rock"), ["labels", "iou_mean"]].tolist() == [2, 0.5]
    assert rows.loc[("size", "large", "rock"), ["labels", "iou_mean"]].tolist() == [3, 2 / 3]
    # Both large detections are true positives, the small false positive is ignored: precision 1 up to recall 2/3.
    assert rows.loc[("size", "large", "rock"), "map50"] == pytest.approx(67 / 101)
    assert np.isnan(rows.loc[("size", "medium", "rock"), "map50"])


def test_a_class_without_labels_does_not_lower_the_mean(rows):
    assert np.isnan(rows.loc[("terrain", "01", "shadow"), "map50"])
    assert rows.loc[("terrain", "01", "all"), "map50"] == rows.loc[("terrain", "01", "rock"), "map50"]


def test_a_group_of_a_single_view_has_no_interval(rows):
    row = rows.loc[("terrain", "01", "rock")]
    assert row["units"] == 1
    assert np.isnan([row["map50_low"], row["map50_high"]]).all()
    low, high = rows.loc[("all", "all", "rock"), ["iou_mean_low", "iou_mean_high"]]
    assert (low, high) == (0, 0.75)  # the means of the two views


def test_the_curve_holds_the_average_precision_as_its_mean(rows):
    matched = match_predictions(KEYS, LABELS, FOUND, instance_performance(LABELS, FOUND, 0))
    curve = curves(matched)
    at_half = curve[(curve["kind"] == "rock") & (curve["iou"] == 0.5)]
    assert at_half["precision"].mean() == pytest.approx(rows.loc[("all", "all", "rock"), "map50"])
    assert at_half["precision"].is_monotonic_decreasing
