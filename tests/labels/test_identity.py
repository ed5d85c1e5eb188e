import numpy as np
import pytest

from polarsim.labels.association import dome_behind, match_boxes, number_domes
from polarsim.labels.bodies import Dome, build_world
from polarsim.photo import FIRST_UNMESHED_ROCK
from polarsim.run_files.scene import read_terrain

from .conftest import TERRAIN, localised


def test_each_box_finds_the_nearest_expected_one():
    expected = np.array([[100.0, 100, 150, 150], [200, 100, 250, 150]])
    annotated = np.array([[205.0, 98, 255, 149], [700, 700, 750, 740], [90, 100, 140, 150]])
    np.testing.assert_array_equal(match_boxes(annotated, expected, 40), [1, -1, 0])


def test_one_expected_box_is_given_once():
    expected = np.array([[100.0, 100, 150, 150]])
    assert sorted(match_boxes(np.array([[101.0, 100, 151, 150], [108, 100, 158, 150]]), expected, 40)) == [-1, 0]


def test_nothing_expected_matches_nothing():
    np.testing.assert_array_equal(match_boxes(np.zeros((2, 4)), np.zeros((0, 4)), 40), [-1, -1])


@pytest.mark.parametrize(("radius", "height"), [(0.10, 0.10), (0.15, 0.09), (0.08, 0.14)])
@pytest.mark.parametrize("position", ["A", "C"])
def test_a_dome_is_found_again_from_the_box_around_it(untouched_scene, position, radius, height):
    world, view = build_world(read_terrain(untouched_scene.meshes, TERRAIN), 0.004), localised(position).camera("L")
    dome = Dome(np.array([0.2, 0.3, 0.0]), radius, height)
    pixels = view.project(dome.mesh(rings=30, segments=90)[0])
    found = dome_behind(world, view, np.concatenate([pixels.min(axis=0), pixels.max(axis=0)]))
    assert found is not None
    assert np.linalg.norm(found.foot - dome.foot) < 0.05 * radius + 0.005
    assert found.radius == pytest.approx(radius, rel=0.06)
    assert found.height == pytest.approx(height, rel=0.12)


def test_a_box_above_the_horizon_has_no_dome(untouched_scene):
    world = build_world(read_terrain(untouched_scene.meshes, TERRAIN), 0.004)
    box = np.array([500.0, 0, 540, 20])
    level = localised("A").camera("L")
    assert dome_behind(world, level, box - [0, 3000, 0, 3000]) is None


def test_domes_of_two_views_at_one_position_are_one_rock():
    def dome(x, y):
        return Dome(np.array([x, y, 0.0]), 0.05, 0.05)

    numbers, domes = number_domes([[dome(0, 0), dome(1, 0)], [dome(1.02, 0.01), None, dome(0.5, 0.5)]])
    first = FIRST_UNMESHED_ROCK
    assert numbers == [[first, first + 1], [first + 1, first + 2, first + 3]]
    np.testing.assert_allclose(domes[first + 1].foot, [1.01, 0.005, 0])
    assert sorted(domes) == [first, first + 1, first + 3]  # a box without a dome has a number and no body
