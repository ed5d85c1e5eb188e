import numpy as np
import pytest

from polarsim.labels.association import find_tracks, fit_dome, match_ids, number_domes
from polarsim.labels.bodies import Dome, build_world
from polarsim.photo import FIRST_ID_WITHOUT_MESH, NO_ROCK
from polarsim.run_files.scene import read_terrain
from tests.support.polar_survey import RIG_LAMP, SANDBOX, SUN_LAMPS

from .conftest import TERRAIN, localised

FIRST, SECOND = np.array([100.0, 100, 160, 150]), np.array([300.0, 100, 350, 140])


def test_overlapping_boxes_of_two_annotations_form_a_track_with_mean_edges():
    tracks = find_tracks(
        {("L", "30"): np.array([FIRST, SECOND]), ("R", "180"): np.array([FIRST + np.array([4, 2, 0, -2])])}, 0.3
    )
    assert sorted(len(track.rows) for track in tracks) == [1, 2]
    both = next(track for track in tracks if len(track.rows) == 2)
    assert both.rows == {("L", "30"): 0, ("R", "180"): 0}
    np.testing.assert_allclose(both.mean, [102, 101, 160, 149])


def test_a_track_has_at_most_one_box_per_annotation():
    tracks = find_tracks({("L", "30"): np.array([FIRST, FIRST + 3])}, 0.3)
    assert [len(track.rows) for track in tracks] == [1, 1]


def test_the_order_of_annotations_does_not_matter():
    annotated = {
        ("L", "30"): np.array([FIRST]),
        ("L", "180"): np.array([SECOND, FIRST + 2]),
        ("L", "270"): np.array([SECOND - 3]),
    }
    backwards = dict(reversed(annotated.items()))
    for one, other in zip(find_tracks(annotated, 0.3), find_tracks(backwards, 0.3), strict=True):
        np.testing.assert_array_equal(one.mean, other.mean)


def test_boxes_are_matched_one_to_one_with_the_nearest_expected_box():
    expected = np.array([[100.0, 100, 150, 150], [200, 100, 250, 150]])
    annotated = np.array([[205.0, 98, 255, 149], [700, 700, 750, 740], [90, 100, 140, 150], [108, 100, 158, 150]])
    assert match_ids(annotated, expected, [4, 7], 40).tolist() == [7, NO_ROCK, NO_ROCK, 4]
    assert match_ids(annotated, expected[:0], [], 40).tolist() == [NO_ROCK] * 4


@pytest.mark.parametrize(("radius", "height"), [(0.10, 0.10), (0.15, 0.09), (0.08, 0.14)])
@pytest.mark.parametrize("position", ["A", "C"])
def test_a_dome_is_recovered_from_its_bounding_box(untouched_scene, position, radius, height):
    mesh = read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX)
    world, view = build_world(mesh, 0.004, SUN_LAMPS, RIG_LAMP), localised(position).camera("L")
    dome = Dome(np.array([0.2, 0.3, 0.0]), radius, height)
    pixels = view.project(dome.mesh(rings=30, segments=90)[0])
    found = fit_dome(world, view, np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]))
    assert found is not None
    assert np.linalg.norm(found.foot - dome.foot) < 0.05 * radius + 0.005
    assert found.radius == pytest.approx(radius, rel=0.06)
    assert found.height == pytest.approx(height, rel=0.12)


def test_a_box_above_the_horizon_has_no_dome(untouched_scene):
    world = build_world(read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX), 0.004, SUN_LAMPS, RIG_LAMP)
    box = np.array([500.0, 0, 540, 20])
    level = localised("A").camera("L")
    assert fit_dome(world, level, box - [0, 3000, 0, 3000]) is None


def test_domes_of_two_views_at_the_same_place_are_the_same_rock():
    def dome(x, y):
        return Dome(np.array([x, y, 0.0]), 0.05, 0.05)

    numbers, domes = number_domes([[dome(0, 0), dome(1, 0)], [dome(1.02, 0.01), None, dome(0.5, 0.5)]])
    first = FIRST_ID_WITHOUT_MESH
    assert numbers == [[first, first + 1], [first + 1, first + 2, first + 3]]
    np.testing.assert_allclose(domes[first + 1].foot, [1.01, 0.005, 0])
    assert sorted(domes) == [first, first + 1, first + 3]  # a box without a dome has a number and no body
