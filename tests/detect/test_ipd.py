import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect.ipd import instance_performance, instance_performance_difference, pair
from polarsim.errors import DetectError

# arXiv 2309.12397: IOU_mean of Table 1 in two domains, and the IPD of Table 2.
PAPER = [
    (0.849, 0.534, 0.3152),  # trained on Real: Real, Hapke
    (0.849, 0.624, 0.2256),  # Real, Principled
    (0.893, 0.842, 0.0511),  # trained on Principled: Principled, Hapke
    (0.893, 0.513, 0.3808),  # Principled, Real
    (0.898, 0.872, 0.0261),  # trained on Hapke: Hapke, Principled
    (0.898, 0.434, 0.4638),  # Hapke, Real
]


def performances(*rows: tuple[str, int, float], kind: str = "rock") -> pd.DataFrame:
    return pd.DataFrame([(key, kind, rock, iou) for key, rock, iou in rows], columns=["key", "kind", "rock", "iou"])


FIRST = performances(("a", 1, 0.9), ("a", 2, 0.5), ("b", 1, 0.6))
SECOND = performances(("a", 1, 0.7), ("a", 2, 0.8), ("b", 1, 0.2))


def test_gains_and_losses_cancel_in_the_papers_ipd_and_not_in_the_absolute_one():
    found = instance_performance_difference(FIRST, SECOND)
    assert found.pairs == 3
    assert found.ipd == pytest.approx((0.2 - 0.3 + 0.4) / 3)
    assert found.ipd_abs == pytest.approx((0.2 + 0.3 + 0.4) / 3)


@pytest.mark.parametrize(("first", "second", "published"), PAPER)
def test_the_papers_ipd_is_the_difference_of_its_mean_overlaps(rng, first, second, published):
    def around(mean: float) -> pd.DataFrame:
        spread = rng.uniform(-0.1, 0.1, 200)
        return performances(*[(f"p{n % 20}", n, mean + value) for n, value in enumerate(spread - spread.mean())])

    found = instance_performance_difference(around(first), around(second))
    assert found.ipd == pytest.approx(published, abs=0.0011)  # the means are printed with three digits
    assert found.ipd_low < found.ipd < found.ipd_high


def test_a_domain_does_not_differ_from_itself():
    found = instance_performance_difference(FIRST, FIRST)
    assert (found.ipd, found.ipd_abs, found.ipd_low, found.ipd_high) == (0, 0, 0, 0)


some_performances = st.lists(
    st.tuples(st.sampled_from("abcd"), st.integers(1, 6), st.floats(0, 1)),
    min_size=1,
    unique_by=lambda row: row[:2],
).map(lambda rows: performances(*rows))


@settings(deadline=None, max_examples=40)
@given(some_performances, some_performances)
def test_ipd_is_symmetric_bounded_and_at_most_the_absolute_one(first, second):
    there = instance_performance_difference(first, second, resamples=100)
    back = instance_performance_difference(second, first, resamples=100)
    assert there.pairs == back.pairs
    if there.pairs:
        assert there.ipd == pytest.approx(back.ipd)
        assert there.ipd_abs == pytest.approx(back.ipd_abs)
        assert 0 <= there.ipd <= there.ipd_abs + 1e-12 <= 1 + 1e-12
        assert there.ipd_low <= there.ipd_high <= 1


def test_only_rocks_known_in_both_domains_are_pairs():
    first = performances(("a", 1, 0.9), ("a", 2, 0.5), ("c", 1, 0.4), ("a", -1, 0.3))
    second = performances(("a", 1, 0.7), ("b", 2, 0.8), ("c", 2, 0.2), ("a", -1, 0.1))
    assert pair(first, second)[["key", "rock"]].to_numpy().tolist() == [["a", 1]]


def test_a_shadow_is_no_pair_of_a_rock():
    assert pair(FIRST, performances(("a", 1, 0.7), kind="shadow")).empty


def test_of_two_labels_of_one_rock_the_best_counts():
    twice = performances(("a", 1, 0.2), ("a", 1, 0.6))
    assert pair(twice, FIRST)["first"].tolist() == [0.6]


def test_no_pairs_give_no_number():
    found = instance_performance_difference(FIRST, FIRST.iloc[:0])
    assert found.pairs == 0
    assert np.isnan(found.ipd)


def test_the_interval_of_a_steady_difference_is_narrow_and_of_one_photo_is_a_point():
    steady = performances(*[(f"p{n}", 1, 0.5) for n in range(30)])
    shifted = steady.assign(iou=0.4)
    found = instance_performance_difference(steady, shifted)
    np.testing.assert_allclose([found.ipd_low, found.ipd_high, found.ipd_abs_low, found.ipd_abs_high], 0.1)


def test_an_open_sign_reaches_down_to_zero():
    first = performances(*[(f"p{n}", 1, 0.5) for n in range(20)])
    second = first.assign(iou=[0.3, 0.7] * 10)
    found = instance_performance_difference(first, second)
    assert found.ipd == pytest.approx(0)
    assert found.ipd_low == 0
    assert 0.02 < found.ipd_high < 0.15  # 0.2 / sqrt(20) is 0.045, times 1.96


def boxes(rows, **columns):
    table = pd.DataFrame(rows, columns=["key", "x0", "y0", "x1", "y1"])
    return table.assign(kind="rock", **columns)


LABELS = boxes([("a", 0, 0, 10, 10), ("a", 50, 0, 60, 10), ("b", 0, 0, 10, 10)], rock=[1, 2, 1])
PREDICTIONS = boxes([("a", 0, 0, 10, 5), ("a", 0, 0, 10, 10), ("b", 50, 0, 60, 10)], confidence=[0.9, 0.2, 0.9])


def test_performance_is_the_best_overlap_in_the_same_photo():
    assert instance_performance(LABELS, PREDICTIONS, 0)["iou"].tolist() == [1, 0, 0]


def test_unsure_predictions_do_not_count():
    assert instance_performance(LABELS, PREDICTIONS, 0.25)["iou"].tolist() == [0.5, 0, 0]


def test_a_prediction_of_the_other_kind_does_not_count():
    assert instance_performance(LABELS, PREDICTIONS.assign(kind="shadow"), 0)["iou"].tolist() == [0, 0, 0]


def test_a_missing_column_is_named():
    with pytest.raises(DetectError, match="'rock'"):
        instance_performance_difference(FIRST.drop(columns="rock"), SECOND)
