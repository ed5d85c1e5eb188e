import numpy as np

from polarsim.labels.association import find_tracks

FIRST, SECOND = np.array([100.0, 100, 160, 150]), np.array([300.0, 100, 350, 140])


def test_overlapping_boxes_of_two_drawings_are_one_rock_with_the_mean_of_their_edges():
    tracks = find_tracks(
        {("L", "30"): np.array([FIRST, SECOND]), ("R", "180"): np.array([FIRST + np.array([4, 2, 0, -2])])}, 0.3
    )
    assert sorted(len(track.rows) for track in tracks) == [1, 2]
    both = next(track for track in tracks if len(track.rows) == 2)
    assert both.rows == {("L", "30"): 0, ("R", "180"): 0}
    np.testing.assert_allclose(both.mean, [102, 101, 160, 149])


def test_both_cameras_at_one_azimuth_are_one_azimuth():
    (track,) = find_tracks({("L", "30"): np.array([FIRST]), ("R", "30"): np.array([FIRST + 1])}, 0.3)
    assert track.azimuths == {"30"}


def test_two_boxes_of_one_drawing_are_never_one_rock():
    tracks = find_tracks({("L", "30"): np.array([FIRST, FIRST + 3])}, 0.3)
    assert [len(track.rows) for track in tracks] == [1, 1]


def test_the_order_in_which_drawings_are_given_does_not_matter():
    annotated = {
        ("L", "30"): np.array([FIRST]),
        ("L", "180"): np.array([SECOND, FIRST + 2]),
        ("L", "270"): np.array([SECOND - 3]),
    }
    backwards = dict(reversed(annotated.items()))
    for one, other in zip(find_tracks(annotated, 0.3), find_tracks(backwards, 0.3), strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)


def test_no_boxes_make_no_tracks():
    assert find_tracks({("L", "30"): np.zeros((0, 4))}, 0.3) == []
