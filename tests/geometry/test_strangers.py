import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.consensus import find_mislabelled_positions
from polarsim.geometry.poses import camera_pose
from polarsim.geometry.stereo import default_rig

POSES = {  # at the distance of NASA's A and C
    "A": camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(25)),
    "C": camera_pose(np.array([0.8, -3.7, 1.5]), np.radians(104), np.radians(25)),
}


@pytest.fixture
def projected(rng):
    """Return boxes of twenty rocks in the left photos of both positions; NaN for rocks out of view."""
    lens, seen = default_rig().left, {name: [] for name in POSES}
    for x, y, size in rng.uniform((-1.4, -1.4, 0.08), (1.4, 1.4, 0.3), (20, 3)):
        rock = np.array([x, y, size / 3]) + size / 2 * rng.uniform(-1, 1, (60, 3))
        for name, pose in POSES.items():
            box = box_around_points(lens.project(pose.inverse().apply(rock)))
            inside = (box[0] > 0) & (box[1] > 0) & (box[2] < lens.width) & (box[3] < lens.height)
            seen[name].append(box if inside else np.full(4, np.nan))
    return {name: np.array(boxes) for name, boxes in seen.items()}


@pytest.fixture
def annotated(projected, rng):
    """Return annotated boxes with edges that are off by 2 px."""
    shown = {name: boxes[np.isfinite(boxes).all(axis=1)] for name, boxes in projected.items()}
    return {name: boxes + rng.normal(0, 2, boxes.shape) for name, boxes in shown.items()}


def test_boxes_at_the_correct_position_are_accepted(annotated, projected):
    assert find_mislabelled_positions(annotated, projected) == []


def test_boxes_of_another_position_are_reported(annotated, projected):
    (stranger,) = find_mislabelled_positions({"A": annotated["A"], "C": annotated["A"]}, projected)
    assert (stranger.position, stranger.other) == ("C", "A")
    assert stranger.met < 0.2
    assert stranger.met_from_other > 0.9
    assert "position C" in str(stranger)
    assert "position A" in str(stranger)


def test_exchanged_positions_are_both_reported(annotated, projected):
    exchanged = {"A": annotated["C"], "C": annotated["A"]}
    assert [stranger.position for stranger in find_mislabelled_positions(exchanged, projected)] == ["A", "C"]


@pytest.mark.parametrize("name", sorted(POSES))
def test_missing_boxes_are_accepted(name, annotated, projected):
    assert find_mislabelled_positions({**annotated, name: annotated[name][::2]}, projected) == []


@pytest.mark.parametrize("name", sorted(POSES))
def test_unknown_rocks_are_accepted(name, annotated, projected):
    known = {pose: boxes[::2] for pose, boxes in projected.items()}
    assert find_mislabelled_positions(annotated, known) == []
    assert [
        one.position for one in find_mislabelled_positions({name: annotated["A" if name == "C" else "C"]}, known)
    ] == [name]


def test_few_boxes_and_a_single_pose_are_accepted(annotated, projected):
    assert find_mislabelled_positions({"C": annotated["A"][:3]}, projected) == []
    assert find_mislabelled_positions({"C": annotated["A"]}, {"C": projected["C"]}) == []
    assert find_mislabelled_positions({"B": annotated["A"]}, projected) == []
