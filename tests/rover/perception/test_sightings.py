"""Detected rocks, their distances, and false stops."""

import numpy as np
import pandas as pd
import pytest

from polarsim.rover.perception import sightings
from tests.rover.perception.boxes import CONFIDENCE, box_of, ride, table, truth_table


def test_a_rock_is_detected_above_the_thresholds_of_overlap_and_confidence():
    box = np.array([100, 100, 200, 200.0])
    truth = truth_table([(0, 7, box, 2, 0.2), (1, 7, box, 1.8, 0.2), (2, 7, box, 1.6, 0.2)])
    detections = table([(0, box, 0.9), (1, box + np.array([60, 0, 60, 0]), 0.9), (2, box, 0.1)])
    assert list(sightings.sightings(truth, detections, CONFIDENCE)["detected"]) == [True, False, False]
    two = truth_table([(0, 1, box, 2, 0.2), (0, 2, box + 5, 2, 0.2)])
    assert sightings.sightings(two, table([(0, box, 0.9)]), CONFIDENCE)["detected"].sum() == 1  # of one rock only


def test_recall_is_counted_by_height_and_distance():
    seen = pd.DataFrame(
        {
            "frame": 0,
            "rock": [1, 2, 3],
            "distance_m": [0.7, 0.9, 2.2],
            "height_m": [0.07, 0.2, 0.2],
            "detected": [False, True, True],
        }
    )
    recall = sightings.recall_by_distance(seen).set_index(["height_m", "from_m"])
    assert tuple(recall.loc[(0.05, 0.5), ["rocks", "detected"]]) == (2, 1)
    assert tuple(recall.loc[(0.1, 0.5), ["rocks", "detected"]]) == (1, 1)
    assert recall["rocks"].sum() == 5


@pytest.mark.parametrize(("hits", "expected"), [("0111", 1.7), ("1101", np.nan), ("11.11", np.nan), ("1111", 1.8)])
def test_a_detection_is_stable_at_the_third_consecutive_frame(hits, expected):
    frames = [n for n, hit in enumerate(hits) if hit != "."]
    seen = pd.DataFrame(
        {"frame": frames, "rock": 4, "distance_m": [2 - 0.1 * n for n in frames], "height_m": 0.2,
         "detected": [hits[n] == "1" for n in frames]}
    )  # fmt: skip
    stable = sightings.first_stable(seen, list(range(len(hits))))
    np.testing.assert_allclose(stable["first_stable_m"], expected)


def test_the_miss_distance_is_the_gap_to_the_nearest_undetected_rock():
    rocks = pd.DataFrame(
        {"rock": [1, 2, 3, 4], "x_m": [1.5, 1.6, 1.8, -2.0], "y_m": [0.6, 1.2, 2.0, 0.6],
         "height_m": [0.3, 0.3, 0.3, 0.3], "radius_m": 0.2}
    )  # fmt: skip
    stable = pd.DataFrame({"rock": [1, 2], "first_stable_m": [2.0, np.nan]})
    # Rock 2, since 1 is detected, 3 is at a larger distance and 4 is at the rear.
    gap = sightings.miss_distance(stable, rocks, ride(), 0.1)
    np.testing.assert_allclose(gap, 0.6 - 0.2 - 0.1, atol=1e-3)
    assert sightings.miss_distance(stable, rocks, ride(), 0.5) == np.inf
    np.testing.assert_allclose(ride().stopping_m, 0.17 + 0.2 * 1 + 0.2**2 / 0.6)  # reaction and braking


def test_a_stop_is_false_if_three_frames_contain_a_false_rock():
    ghost = [(n, box_of(3.0, 0.2, 0.3, 0.25, 0.2 * n), 0.9) for n in (1, 2, 3, 4, 6, 7)]
    none = truth_table([])
    assert sightings.false_stops(none, table(ghost), ride(), CONFIDENCE) == 1
    assert sightings.false_stops(none, table(ghost[:2]), ride(), CONFIDENCE) == 0
    real = truth_table([(n, 1, box, 2.0, 0.2) for n, box, _ in ghost])
    assert sightings.false_stops(real, table(ghost), ride(), CONFIDENCE) == 0
    aside = [(n, box_of(4.0, 1.3, 0.2, 0.25, 0.2 * n), 0.9) for n in range(4)]
    flat = [(n, box_of(3.0, 0.2, 0.05, 0.02, 0.2 * n), 0.9) for n in range(4)]
    assert sightings.false_stops(none, table(aside + flat), ride(), CONFIDENCE) == 0
