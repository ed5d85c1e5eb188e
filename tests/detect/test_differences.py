import pandas as pd
import pytest

from polarsim.detect.differences import paired_differences
from polarsim.detect.domain_evaluation import DomainEvaluation
from polarsim.detect.options import ComparisonOptions
from tests.support.polar_photos import SIZE

VIEWS = ("01_A_off_180_L_0256", "01_A_off_180_R_0256", "01_B_off_180_L_0256", "01_C_off_180_L_0256")
OPTIONS = ComparisonOptions(resamples=500)


def seen(overlaps, found=1.0):
    """A domain of one rock a view, each found with an IoU, and a share of 10 shadows in the first views."""
    labels, boxes = [], []
    for key, overlap in zip(VIEWS, overlaps, strict=True):
        labels.append((key, "rock", 1, 0.0, 0.0, 100.0, 100.0))
        boxes.append((key, "rock", 0.9, 0.0, 0.0, 100.0 * overlap, 100.0))
        for number in range(10):
            labels.append((key, "shadow", 1, 150.0 * number, 500.0, 150.0 * number + 100, 600.0))
            if number < found * 10:
                boxes.append((key, "shadow", 0.9, 150.0 * number, 500.0, 150.0 * number + 100, 600.0))
    return DomainEvaluation(
        VIEWS,
        pd.DataFrame(labels, columns=["key", "kind", "rock", "x0", "y0", "x1", "y1"]),
        pd.DataFrame(boxes, columns=["key", "kind", "confidence", "x0", "y0", "x1", "y1"]),
        OPTIONS,
        SIZE,
    )


def rows(table, metric, kind):
    return table[(table["metric"] == metric) & (table["kind"] == kind)].reset_index(drop=True)


def test_a_difference_that_every_view_shows_is_sure_though_the_metrics_intervals_meet():
    """Views differ by 0.4, the domains by 0.1 in each: the interval of the difference has no width."""
    photo, near, far = seen([0.9, 0.8, 0.6, 0.5]), seen([0.8, 0.7, 0.5, 0.4]), seen([0.7, 0.6, 0.4, 0.3])
    table = rows(paired_differences({("a", "a"): photo, ("a", "b"): near, ("a", "c"): far}), "ipd", "rock")
    found = table[table["against"] == "a"].iloc[0]
    assert found[["evaluated", "other_evaluated"]].tolist() == ["b", "c"]
    assert found[["value", "other_value", "difference"]].tolist() == pytest.approx([0.1, 0.2, -0.1])
    assert found[["difference_low", "difference_high"]].tolist() == pytest.approx([-0.1, -0.1])
    assert found["pairs"] == 4


def test_own_domain_stands_against_every_other_one_and_own_detector_against_every_other_one():
    good, bad = seen([0.9] * 4), seen([0.9] * 4, found=0.5)
    domains = {(trained, evaluated): good if trained == evaluated else bad for trained in "ab" for evaluated in "ab"}
    table = rows(paired_differences(domains), "map50", "shadow")
    sides = table[["trained", "evaluated", "other_trained", "other_evaluated"]].agg("".join, axis=1)
    assert sides.tolist() == ["aaab", "bbba", "aaba", "bbab"]
    assert table["difference"].tolist() == pytest.approx([1 - 51 / 101] * 4)
