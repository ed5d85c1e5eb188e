"""What boxes tell a driving rover, and the figures made of it."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import RoverError
from polarsim.geometry.poses import Pose
from polarsim.rover import hazard_map, hazards
from polarsim.rover.frames import render_frames
from polarsim.rover.ground_view import estimate, plane_under
from polarsim.rover.hazards import Ride
from polarsim.rover.onboard import detect_drive, detection_table, measure_drive, ride_of
from polarsim.rover.onboard_table import figures, summarise_onboard
from polarsim.rover.sight import Sight, mount_of
from polarsim.rover.sight_options import FRONT, OnboardOptions, SightOptions
from polarsim.rover.trace import write_trace
from tests.rover import driven

OPTIONS = OnboardOptions(resamples=100)
MOUNT = mount_of(driven.vehicle().camera(FRONT))
GROUND = -0.25
WORLD_FROM_CAMERA = MOUNT.base_from_camera  # base_link is the world


def level(x, y):
    return np.full(np.shape(x), GROUND)


def ride(frames=10, step=0.2):
    """A ride along +x from x = 0."""
    cameras = {n: Pose(np.eye(3), np.array([step * n, 0, 0.25])) @ MOUNT.base_from_camera for n in range(frames)}
    path = np.concatenate([np.stack([np.linspace(0, step * frames, 50), np.full(50, y)], 1) for y in (0.6, -0.6)])
    return Ride(
        list(range(frames)), cameras, MOUNT.base_from_camera, MOUNT.lens, GROUND, 0.17, 0.71, path, 0.1,
        step * frames, 0.2,
    )  # fmt: skip


def box_of(x, y, width, height, base_x=0.0):
    """Box (4,) around an upright board on the ground at base_link's (x, y), that faces the camera."""
    corners = np.array([[x - base_x, y + s * width / 2, GROUND + h] for s in (-1, 1) for h in (0, height)])
    pixels = MOUNT.lens.project(MOUNT.base_from_camera.inverse().apply(corners))
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def table(rows):
    """Of (frame, box, confidence)."""
    return detection_table([(frame, "rock", confidence, *box) for frame, box, confidence in rows])


def truth_table(rows):
    """Of (frame, rock, box, distance, height)."""
    return pd.DataFrame(
        [(f, 0.1 * f, "rock", r, *box, 500, d, h) for f, r, box, d, h in rows],
        columns=["frame", "time_s", "kind", "rock", "x0", "y0", "x1", "y1", "pixels", "distance_m", "height_m"],
    )


@given(x=st.floats(1.8, 5), y=st.floats(-0.4, 0.4), width=st.floats(0.05, 0.4))
def test_the_lower_side_of_a_box_lies_where_the_rock_meets_the_ground(x, y, width):
    found = estimate(box_of(x, y, width, 0.0), MOUNT.lens, WORLD_FROM_CAMERA, level)
    np.testing.assert_allclose(found.near[0], [x, y], atol=1e-6)
    np.testing.assert_allclose(found.width[0], width, atol=1e-6)


@given(x=st.floats(1.8, 5), height=st.floats(0.03, 0.4), width=st.floats(0.02, 0.3))
def test_a_top_above_the_footprints_middle_tells_the_height(x, height, width):
    lower, upper = box_of(x, 0, width, 0), box_of(x + width / 2, 0, width, height)
    box = np.array([lower[0], upper[1], lower[2], lower[3]])
    found = estimate(box, MOUNT.lens, WORLD_FROM_CAMERA, level)
    np.testing.assert_allclose(found.height[0], height, atol=1e-6)


def test_on_a_slope_the_rock_lies_where_the_slope_is():
    found = estimate(
        box_of(3.0, 0.2, 0.0, 0.0), MOUNT.lens, WORLD_FROM_CAMERA, lambda x, y: GROUND + 0.2 * (x - 3.0) + 0 * y
    )
    np.testing.assert_allclose(found.near[0], [3.0, 0.2], atol=1e-4)


@given(roll=st.floats(-0.2, 0.2), pitch=st.floats(-0.2, 0.2))
def test_the_plane_under_the_wheels_tilts_with_the_rover(roll, pitch):
    pose = Pose.from_rotvec(np.array([roll, pitch, 0.3]), np.array([1.0, 2, 0.4]))
    place = pose.apply(np.array([2.0, -0.7, GROUND]))
    np.testing.assert_allclose(plane_under(pose, GROUND)(*place[:2]), place[2], atol=1e-9)


def test_a_box_above_the_horizon_is_nowhere():
    found = estimate(np.array([900, -900, 1000, -850.0]), MOUNT.lens, WORLD_FROM_CAMERA, level)
    assert np.isnan(found.near).all()


def test_a_rock_counts_as_detected_from_the_stated_overlap_and_confidence_on():
    box = np.array([100, 100, 200, 200.0])
    truth = truth_table([(0, 7, box, 2, 0.2), (1, 7, box, 1.8, 0.2), (2, 7, box, 1.6, 0.2)])
    found = table([(0, box, 0.9), (1, box + np.array([60, 0, 60, 0]), 0.9), (2, box, 0.1)])
    assert list(hazards.sightings(truth, found, OPTIONS)["detected"]) == [True, False, False]


def test_one_detection_serves_one_rock():
    box = np.array([100, 100, 200, 200.0])
    truth = truth_table([(0, 1, box, 2, 0.2), (0, 2, box + 5, 2, 0.2)])
    assert hazards.sightings(truth, table([(0, box, 0.9)]), OPTIONS)["detected"].sum() == 1


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
    found = hazards.recall_by_distance(seen, OPTIONS).set_index(["height_m", "from_m"])
    assert tuple(found.loc[(0.05, 0.5), ["rocks", "detected"]]) == (2, 1)
    assert tuple(found.loc[(0.1, 0.5), ["rocks", "detected"]]) == (1, 1)
    assert found["rocks"].sum() == 5


@pytest.mark.parametrize(("hits", "expected"), [("0111", 1.7), ("1101", np.nan), ("11.11", np.nan), ("1111", 1.8)])
def test_a_rock_is_stably_seen_at_the_third_frame_in_a_row(hits, expected):
    frames = [n for n, hit in enumerate(hits) if hit != "."]
    seen = pd.DataFrame(
        {"frame": frames, "rock": 4, "distance_m": [2 - 0.1 * n for n in frames], "height_m": 0.2,
         "detected": [hits[n] == "1" for n in frames]}
    )  # fmt: skip
    found = hazards.first_stable(seen, list(range(len(hits))), OPTIONS)
    np.testing.assert_allclose(found["first_stable_m"], expected)


def test_the_miss_distance_is_the_gap_to_the_nearest_rock_that_nobody_saw():
    rocks = pd.DataFrame(
        {"rock": [1, 2, 3, 4], "x_m": [1.5, 1.6, 1.8, -2.0], "y_m": [0.6, 1.2, 2.0, 0.6],
         "height_m": [0.3, 0.3, 0.3, 0.3], "radius_m": 0.2}
    )  # fmt: skip
    stable = pd.DataFrame({"rock": [1, 2], "first_stable_m": [2.0, np.nan]})
    gap = hazards.miss_distance(stable, rocks, ride(), 0.1)
    np.testing.assert_allclose(gap, 0.6 - 0.2 - 0.1, atol=1e-3)  # rock 2: 1 is seen, 3 is farther, 4 is behind
    assert hazards.miss_distance(stable, rocks, ride(), 0.5) == np.inf


def test_a_stop_is_false_where_three_frames_see_a_rock_that_is_not_there():
    ghost = [(n, box_of(3.0, 0.2, 0.3, 0.25, 0.2 * n), 0.9) for n in (1, 2, 3, 4, 6, 7)]
    none = truth_table([])
    assert hazards.false_stops(none, table(ghost), ride(), OPTIONS) == 1
    assert hazards.false_stops(none, table(ghost[:2]), ride(), OPTIONS) == 0
    real = truth_table([(n, 1, box, 2.0, 0.2) for n, box, _ in ghost])
    assert hazards.false_stops(real, table(ghost), ride(), OPTIONS) == 0
    aside = [(n, box_of(4.0, 1.3, 0.2, 0.25, 0.2 * n), 0.9) for n in range(4)]
    flat = [(n, box_of(3.0, 0.2, 0.05, 0.02, 0.2 * n), 0.9) for n in range(4)]
    assert hazards.false_stops(none, table(aside + flat), ride(), OPTIONS) == 0


def test_the_stopping_distance_is_that_of_reaction_and_brake():
    np.testing.assert_allclose(ride().stopping_m(OPTIONS), 0.17 + 0.2 * 1 + 0.2**2 / 0.6)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("seed3")
    write_trace(folder, driven.trace(seconds=8.0))
    options = SightOptions(
        views=(FRONT,), suns=("1", "2"), models=("hapke",), exposures_ms=(256,), scale=0.2, finer=1, far_m=5.0,
        every=4, onboard=OPTIONS,
    )  # fmt: skip
    render_frames(folder, driven.vehicle(), options, 3)
    return folder, options


def test_the_true_map_has_the_rocks_where_they_stand():
    world = driven.world()
    grid = hazard_map.grid_over(world, OPTIONS)
    true = hazard_map.true_map(world, grid)
    x, y, height, _ = driven.ROCKS[2]
    row, column = int((y - world.y[0]) / 0.15), int((x - world.x[0]) / 0.15)
    assert true.rock[row, column]
    assert 0.4 * height < true.height[row, column] <= height + 0.01
    touched = sum((2 * rock[3] / 0.15 + 1) ** 2 for rock in driven.ROCKS)  # cells of squares around the rocks
    assert 0.5 * touched < true.rock.sum() < touched
    assert true.looked.all()


def test_a_map_made_of_labels_is_nearly_the_true_one(drive):
    folder, options = drive
    found = measure_drive(folder, driven.vehicle(), options, 3)
    assert (found["map"]["source"] == "truth").all()
    assert found["map"]["f1"].min() > 0.85
    assert found["map"]["within_5_cm"].min() > 0.97
    assert (found["stops"]["stops"] == 0).all()
    assert found["sightings"]["detected"].all()
    assert found["stable"].loc[found["stable"]["height_m"] > 0.1, "first_stable_m"].max() > 2


def test_ground_is_looked_at_only_where_the_camera_passed(drive):
    folder, options = drive
    sight = Sight(driven.trace(seconds=8.0), driven.vehicle(), options)
    grid = hazard_map.grid_over(sight.trace.world, OPTIONS)
    nothing = table([])
    seen = hazard_map.mapped(nothing, ride_of(sight), grid, OPTIONS)
    assert 0.1 < seen.looked.mean() < 0.9
    assert not seen.looked[:, -3:].any()  # behind the start
    assert not seen.rock.any()
    assert folder.is_dir()


def test_figures_have_intervals_over_rides(drive):
    folder, options = drive
    measure_drive(folder, driven.vehicle(), options, 3)
    summarise_onboard([folder], folder / "figures.parquet", OPTIONS)
    summary = pd.read_parquet(folder / "figures.parquet")
    assert (summary["rides"] <= 2).all()
    recall = summary[summary["figure"] == "recall"]
    assert (recall["value"] == 1).all()
    known = summary.dropna(subset=["value", "low", "high"])
    assert (known["low"] <= known["value"] + 1e-12).all()
    assert (known["value"] <= known["high"] + 1e-12).all()
    assert {"rock cell F1", "height error m", "false stops per 100 m", "first stable distance m"} <= set(
        summary["figure"]
    )


def test_exposures_are_told_apart_and_pooled():
    stops = pd.DataFrame(
        {"seed": 0, "sun": "1", "model": "hapke", "exposure_ms": [256.0, 512.0], "source": "judge", "stops": [1, 3],
         "length_m": 10.0, "miss_5_cm_m": [0.3, np.inf], "miss_10_cm_m": np.inf}
    )  # fmt: skip
    setting = stops[["seed", "sun", "model", "exposure_ms", "source"]]
    parts = {
        "stops": stops,
        "map": setting.assign(cells=10, right=3, false=1, missed=0, f1=1.0, height_error_m=0.01, within_5_cm=1.0),
        "stable": setting.assign(rock=1, height_m=0.2, first_seen_m=3.0, first_stable_m=2.0, stopping_m=0.5),
        "sightings": setting.assign(frame=0, rock=1, distance_m=1.2, height_m=0.2, detected=[True, False]),
    }
    found = figures(parts, OPTIONS).set_index(["figure", "exposure_ms"])["value"]
    np.testing.assert_allclose(found["false stops per 100 m"].sort_index(), [20, 10, 30])  # 0: both
    np.testing.assert_allclose(found.loc["rock cell F1"].iloc[0], 6 / 7)
    assert figures(parts, OPTIONS)[["low", "high"]].isna().all(axis=None)  # of one ride


def test_no_judge_is_refused(drive):
    folder, options = drive
    with pytest.raises(RoverError, match="no weights"):
        detect_drive(folder, driven.vehicle(), options, 3)
