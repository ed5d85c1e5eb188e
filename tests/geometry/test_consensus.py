import numpy as np

from polarsim.geometry.consensus import consensus_boxes

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
