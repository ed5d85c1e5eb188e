import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats.tables import key_columns, typed
from polarsim.photo import PhotoKey
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.scoring.reliability import (
    COLUMNS,
    LabelConfidences,
    binned_calibration_error,
    brier_score,
    equal_bins,
    label_confidences,
    reliability_bins,
    reliability_table,
    wilson,
)


def pair_rows(*labels):
    """Rows of pairs: labels as (key, x0, confidence, hit)."""
    rows = [
        key_columns(PhotoKey.parse(key))
        | {"task": "light on", "kind": "rock", "annotated": False, "hit": hit, "iou": 0.7 if hit else np.nan, "rock": 1}
        | {"iou_best": np.nan, "truth_px": 9.0 if hit else np.nan, "label_px": 10.0, "source": "fused"}
        | {"confidence": confidence, "x0": x0, "y0": 0.0, "x1": x0 + 10.0, "y1": 10.0, "against": "truth"}
        for key, x0, confidence, hit in labels
    ]
    return typed(rows, LABEL_PAIRS)


@pytest.mark.parametrize(
    ("right", "n", "low", "high"),  # Newcombe, Stat. Med. 17 (1998) 857, table I, method 3
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilsons_interval_agrees_with_the_literature(right, n, low, high):
    assert wilson(right / n, n) == pytest.approx((low, high), abs=6e-5)
    assert wilson(1 - right / n, n) == pytest.approx((1 - high, 1 - low), abs=6e-5)


def test_copies_in_exposures_have_the_weight_of_a_single_label():
    names = ["03_A_on_30_L_0128", "03_A_on_30_L_0256", "03_A_on_30_L_0512", "03_A_on_30_R_0256"]
    once = reliability_bins(label_confidences(pair_rows((names[0], 0.0, 0.9, True), (names[3], 0.0, 0.9, False))))
    often = [(name, 0.0, 0.9, True) for name in names[:3]] + [(names[3], 0.0, 0.9, False)]
    pd.testing.assert_frame_equal(reliability_bins(label_confidences(pair_rows(*often))), once)
    assert once["labels"].tolist() == [2]
    assert once["right"].tolist() == [0.5]


def test_a_label_that_is_correct_at_some_exposures_is_partly_correct():
    partly = pair_rows(("03_A_on_30_L_0064", 0.0, 0.5, False), ("03_A_on_30_L_0128", 0.0, 0.5, True))
    bins = reliability_bins(label_confidences(partly))
    assert (bins["labels"].tolist(), bins["right"].tolist()) == ([1], [0.5])


def test_missed_boxes_do_not_affect_the_calibration():
    missed = pair_rows(("03_A_on_30_L_0064", 0.0, 0.5, True)).assign(label_px=np.nan, hit=False)
    assert len(reliability_table(missed)) == 0
    assert {name: str(kind) for name, kind in reliability_table(missed).dtypes.items()} == COLUMNS


def test_calibrated_labels_have_no_calibration_error_and_the_expected_brier_score():
    confidence = np.repeat([0.2, 0.8], 50)
    right = (
        np.tile([True, False, False, False, False], 10).tolist() + np.tile([True, True, True, True, False], 10).tolist()
    )
    bins = reliability_bins(LabelConfidences(confidence, np.array(right), np.ones(100)))
    assert binned_calibration_error(bins) == pytest.approx(0)
    assert brier_score(bins) == pytest.approx(0.2 * 0.8)


def test_the_calibration_error_of_overconfident_labels_is_the_excess():
    bins = reliability_bins(LabelConfidences(np.full(80, 0.9), np.arange(80) % 2 == 0, np.ones(80)))
    assert binned_calibration_error(bins) == pytest.approx(0.4)
    assert brier_score(bins) == pytest.approx((0.1**2 + 0.9**2) / 2)


def test_bins_are_computed_for_each_source_and_for_all():
    rows = pair_rows(*((f"03_A_on_30_{camera}_0256", x, 0.5, x < 9) for camera in "LR" for x in map(float, range(20))))
    rows["source"] = np.where(rows["camera"] == "L", "seed", "fused")
    table = reliability_table(rows)
    assert table["label_source"].tolist() == ["all", "fused", "seed"]
    assert table["labels"].tolist() == [40, 20, 20]


confidences = st.lists(st.tuples(st.integers(0, 20), st.booleans(), st.integers(1, 4)), min_size=1, max_size=400).map(
    lambda rows: LabelConfidences(
        np.array([row[0] for row in rows]) / 20,
        np.array([row[1] for row in rows]),
        1 / np.array([row[2] for row in rows]),
    )
)


@given(confidences)
def test_bins_are_sorted_by_confidence_and_include_all_labels(confidences):
    bins = equal_bins(confidences)
    order = np.argsort(confidences.confidence, kind="stable")
    assert (np.diff(bins[order]) >= 0).all()
    for confidence in np.unique(confidences.confidence):
        assert len(set(bins[confidences.confidence == confidence])) == 1
    table = reliability_bins(confidences)
    assert table["labels"].sum() == pytest.approx(confidences.weight.sum())
    assert (table["labels"] * table["right"]).sum() == pytest.approx((confidences.weight * confidences.right).sum())
    assert ((table["right_low"] <= table["right"] + 1e-9) & (table["right"] <= table["right_high"] + 1e-9)).all()
    expected = (confidences.weight * (confidences.confidence - confidences.right) ** 2).sum() / confidences.weight.sum()
    assert brier_score(table) == pytest.approx(expected)
    assert brier_score(table) >= binned_calibration_error(table) ** 2 - 1e-12  # Jensen


def test_many_labels_make_ten_bins_of_equal_size_and_few_make_one():
    even = LabelConfidences(np.linspace(0, 1, 1000), np.ones(1000, bool), np.ones(1000))
    assert np.bincount(equal_bins(even)).tolist() == [100] * 10
    few = LabelConfidences(np.linspace(0, 1, 40), np.ones(40, bool), np.ones(40))
    assert set(equal_bins(few)) == {0}
