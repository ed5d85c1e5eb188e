from functools import partial

import numpy as np
import pandas as pd
import pytest

from polarsim.detect import ipd
from polarsim.detect.ipd import IpdRules, instance_performance, pair_rock_labels, rock_means

# arXiv 2309.12397: IOU_mean of Table 1 in two domains, and the IPD of Table 2.
PAPER = [
    (0.849, 0.534, 0.3152),  # trained on Real: Real, Hapke
    (0.849, 0.624, 0.2256),  # Real, Principled
    (0.893, 0.842, 0.0511),  # trained on Principled: Principled, Hapke
    (0.893, 0.513, 0.3808),  # Principled, Real
    (0.898, 0.872, 0.0261),  # trained on Hapke: Hapke, Principled
    (0.898, 0.434, 0.4638),  # Hapke, Real
]


PHOTOS = IpdRules(unit="photo")  # the names in these tests are not photo keys
instance_performance_difference = partial(ipd.instance_performance_difference, rules=PHOTOS)


def performances(*rows: tuple[str, int, float], kind: str = "rock") -> pd.DataFrame:
    return pd.DataFrame([(key, kind, rock, iou) for key, rock, iou in rows], columns=["key", "kind", "rock", "iou"])


FIRST = performances(("a", 1, 0.9), ("a", 2, 0.5), ("b", 1, 0.6))
SECOND = performances(("a", 1, 0.7), ("a", 2, 0.8), ("b", 1, 0.2))


def test_gains_and_losses_cancel_in_ipd_but_not_in_absolute_ipd():
    found = instance_performance_difference(FIRST, SECOND)
    assert instance_performance_difference(SECOND, FIRST) == found
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


def test_only_rocks_known_in_both_domains_are_pairs():
    first = performances(("a", 1, 0.9), ("a", 2, 0.5), ("c", 1, 0.4), ("a", -1, 0.3))
    second = performances(("a", 1, 0.7), ("b", 2, 0.8), ("c", 2, 0.2), ("a", -1, 0.1))
    assert pair_rock_labels(first, second)[["key", "rock"]].to_numpy().tolist() == [["a", 1]]


def test_a_shadow_is_not_paired_with_a_rock():
    assert pair_rock_labels(FIRST, performances(("a", 1, 0.7), kind="shadow")).empty


def test_the_best_of_several_labels_of_a_rock_is_used():
    twice = performances(("a", 1, 0.2), ("a", 1, 0.6))
    assert pair_rock_labels(twice, FIRST)["first"].tolist() == [0.6]


def test_no_pairs_give_no_number():
    found = instance_performance_difference(FIRST, FIRST.iloc[:0])
    assert found.pairs == 0
    assert np.isnan(found.ipd)


def test_the_interval_of_a_steady_difference_is_narrow_and_of_one_photo_is_none():
    steady = performances(*[(f"p{n}", 1, 0.5) for n in range(30)])
    shifted = steady.assign(iou=0.4)
    found = instance_performance_difference(steady, shifted)
    np.testing.assert_allclose([found.ipd_low, found.ipd_high, found.ipd_abs_low, found.ipd_abs_high], 0.1)


def test_an_uncertain_sign_gives_a_lower_limit_of_zero():
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


@pytest.mark.parametrize(
    ("kind", "confidence", "performance"),
    [("rock", 0, [1, 0, 0]), ("rock", 0.25, [0.5, 0, 0]), ("shadow", 0, [0, 0, 0])],
)
def test_performance_is_the_best_overlap_of_the_kind_in_the_same_photo(kind, confidence, performance):
    assert instance_performance(LABELS, PREDICTIONS.assign(kind=kind), confidence)["iou"].tolist() == performance


def test_an_undetected_rock_counts_zero_or_is_excluded():
    first, second = performances(("a", 1, 0.9), ("b", 1, 0.6)), performances(("a", 1, 0.0), ("b", 1, 0.5))
    found = instance_performance_difference(first, second)
    assert (found.pairs, found.ipd) == (2, pytest.approx((0.9 + 0.1) / 2))
    found = instance_performance_difference(first, second, rules=IpdRules(undetected="left_out", unit="photo"))
    assert (found.pairs, found.ipd) == (1, pytest.approx(0.1))


def test_an_unpaired_rock_is_excluded_or_counts_zero():
    first, second = performances(("a", 1, 0.9), ("b", 1, 0.6)), performances(("a", 1, 0.7), ("c", 1, 0.5))
    found = instance_performance_difference(first, second)
    assert (found.pairs, found.ipd) == (1, pytest.approx(0.2))
    found = instance_performance_difference(first, second, rules=IpdRules(unpaired="zero", unit="photo"))
    assert (found.pairs, found.ipd) == (3, pytest.approx((0.2 + 0.6 - 0.5) / 3))
    assert found.ipd_abs == pytest.approx((0.2 + 0.6 + 0.5) / 3)


def test_an_undetected_unpaired_rock_is_excluded_by_rule_undetected():
    first, second = performances(("a", 1, 0.0), ("b", 1, 0.6)), performances(("b", 1, 0.5))
    rules = IpdRules(undetected="left_out", unpaired="zero", unit="photo")
    assert pair_rock_labels(first, second, rules)["key"].tolist() == ["b"]


def test_a_performance_of_nan_is_missing():
    assert pair_rock_labels(performances(("a", 1, np.nan), ("b", 1, 0.5)), performances(("a", 1, 0.5), ("b", 1, 0.5)))[
        "key"
    ].tolist() == ["b"]


def test_intervals_over_views_are_wider_if_photos_of_a_view_agree():
    keys = [f"01_{p}_off_180_{c}_{e:04d}" for p in "ABC" for c in "LR" for e in (32, 64, 128, 256)]
    shift = {"A": 0.1, "B": 0.3, "C": 0.5}
    first = performances(*[(key, 1, 0.9) for key in keys])
    second = performances(*[(key, 1, 0.9 - shift[key[3]]) for key in keys])
    views = instance_performance_difference(first, second, rules=IpdRules())
    photos = instance_performance_difference(first, second)
    assert (views.units, photos.units) == (6, 24)
    assert views.ipd == photos.ipd == pytest.approx(0.3)
    spread = np.sqrt((0.2**2) * 2 / 3)  # standard deviation of the offsets
    assert views.ipd_high - views.ipd_low == pytest.approx(2 * 1.96 * spread / np.sqrt(6), rel=0.15)
    assert photos.ipd_high - photos.ipd_low == pytest.approx(2 * 1.96 * spread / np.sqrt(24), rel=0.15)


def test_one_view_has_no_interval():
    first = performances(("01_A_off_180_L_0256", 1, 0.9), ("01_A_off_180_L_0512", 1, 0.8))
    found = instance_performance_difference(first, first.assign(iou=0.5), rules=IpdRules())
    assert found.ipd == pytest.approx(0.35)
    assert np.isnan([found.ipd_low, found.ipd_high, found.ipd_abs_low, found.ipd_abs_high]).all()


def test_a_rocks_row_is_the_mean_over_its_photos():
    keys = ("03_A_off_180_L_0256", "03_A_off_180_R_0256")
    pairs = pair_rock_labels(
        performances((keys[0], 7, 0.9), (keys[1], 7, 0.7)), performances((keys[0], 7, 0.5), (keys[1], 7, 0.1))
    )
    row = rock_means(pairs).iloc[0]
    assert row[["terrain", "rock", "kind", "photos"]].tolist() == [3, 7, "rock", 2]
    assert row[["iou_first", "iou_second", "difference"]].tolist() == pytest.approx([0.8, 0.3, 0.5])
