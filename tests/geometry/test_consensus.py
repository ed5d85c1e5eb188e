import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.consensus import consensus_boxes, find_mislabelled_positions
from polarsim.geometry.poses import camera_pose
from tests.support.polar_rig import default_rig

ROCK, OTHER = np.array([100.0, 100, 140, 130]), np.array([500.0, 300, 520, 315])


def test_a_rock_annotated_under_every_lamp_becomes_its_median_box():
    annotated = [np.array([ROCK + offset]) for offset in (-2, 0, 1, 2)]
    np.testing.assert_allclose(consensus_boxes(annotated), [ROCK + 0.5])  # median of -2, 0, 1, 2


def test_a_box_under_one_of_four_lamps_is_excluded():
    annotated = [np.array([ROCK, OTHER]), *[np.array([ROCK])] * 3]
    np.testing.assert_allclose(consensus_boxes(annotated, share=0.3), [ROCK])
    assert len(consensus_boxes(annotated, share=0.25)) == 2


def test_the_boxes_of_a_single_azimuth_are_its_consensus():
    np.testing.assert_array_equal(consensus_boxes([np.array([ROCK, OTHER])]), [ROCK, OTHER])


def test_two_boxes_of_one_photo_never_share_a_rock():
    near = ROCK + np.array([3, 0, 3, 0])  # IoU 0.86 with ROCK
    boxes = consensus_boxes([np.array([ROCK, near]), np.array([ROCK, near])], same_iou=0.9)
    assert len(boxes) == 2


def test_duplicates_of_a_rock_become_one_box():
    near = ROCK + np.array([3, 0, 3, 0])
    assert len(consensus_boxes([np.array([ROCK, near])])) == 1


def test_a_rock_may_first_appear_in_a_later_photo():
    annotated = [np.array([ROCK]), np.array([ROCK, OTHER]), np.array([ROCK, OTHER])]
    np.testing.assert_array_equal(consensus_boxes(annotated), [ROCK, OTHER])


def test_no_annotations_give_no_boxes():
    assert consensus_boxes([]).shape == (0, 4)
    assert consensus_boxes([np.zeros((0, 4))]).shape == (0, 4)


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
