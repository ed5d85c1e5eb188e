from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.masks import windows_of
from polarsim.labels.association import associate_rocks
from polarsim.labels.bodies import active_lamp, build_world
from polarsim.labels.brightness import OlatBrightness
from polarsim.labels.casting import VisibleIds, shadow_box
from polarsim.labels.fusion import PositionRocks
from polarsim.labels.options import LabelsOptions
from polarsim.labels.shadows import CastShadow, PositionShadows, mean_shadow
from polarsim.photo import NO_ROCK
from polarsim.run_files.scene import read_terrain
from polarsim.run_files.walls import level_walls
from polarsim.site import polar
from tests.support.polar_survey import RIG_LAMP, SANDBOX, SUN_LAMPS, lamp_position

from .conftest import BLOCKS, TERRAIN, localised


@pytest.fixture(scope="module")
def world(untouched_scene):
    return build_world(
        replace(read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX), walls=None), 0.004, SUN_LAMPS, RIG_LAMP
    )


@pytest.fixture(scope="module")
def ids(world):
    return VisibleIds(world, localised("A").camera("L"), np.arange(1, 1216, 2), np.arange(1, 1936, 2))


def box_of_shadow(shadow, rock, rock_box, step):
    return shadow_box(shadow, rock, rock_box, step, windows_of(shadow))


@pytest.mark.parametrize("azimuth", ["30", "180", "270", "350"])
@pytest.mark.parametrize("rock", list(BLOCKS))
def test_a_block_casts_its_shadow_where_its_top_corners_are_projected_from_the_lamp(world, ids, azimuth, rock):
    position = lamp_position(azimuth)
    centre, size = BLOCKS[rock]
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    bottom = np.column_stack([centre[:2] + signs * size[:2], np.zeros(4)])
    top = bottom + np.array([0, 0, size[2]])
    thrown = position + (top - position) * (position[2] / (position[2] - top[:, 2]))[:, None]  # on z = 0
    # The shadow on the ground is the convex hull of the base and the projected top, so its box in the photo is the box
    # of the projected corners. The grid of every second pixel and the trim of 4 mm cause errors of up to three pixels.
    pixels = localised("A").project("L", np.concatenate([bottom, thrown]))
    found = box_of_shadow(ids.shadow_of(world, position), rock, None, 2)
    np.testing.assert_allclose(found, [*pixels.min(axis=0), *pixels.max(axis=0)], atol=4)


def test_shadow_inside_the_ellipse_of_its_rock_is_ignored():
    shadow = np.full((120, 120), NO_ROCK)
    shadow[40:60, :100] = 4
    # The ellipse (0.8 of the rock box) has half axes 24 and 40 around (30, 50). At the first row of the band, 9.5 above
    # the centre, it ends at 30 + 24 sqrt(1 - (9.5 / 40)^2) = 53.3; the sliver to its left is too small.
    found = box_of_shadow(shadow, 4, np.array([0.0, 0, 60, 100]), 1)
    np.testing.assert_array_equal(found, [53, 40, 100, 60])


def test_a_rim_under_a_rock_does_not_widen_its_shadow():
    shadow = np.full((120, 240), NO_ROCK)
    shadow[40:60, 100:180] = 4
    shadow[60:62, 20:180] = 4  # rim at the foot of a mesh: two pixels high, connected, left of the shadow
    found = box_of_shadow(shadow, 4, None, 1)
    np.testing.assert_allclose(found, [100, 40, 180, 62], atol=4)


def test_an_invisible_shadow_has_no_box(world, ids):
    assert box_of_shadow(ids.shadow_of(world, lamp_position("30")), 99, None, 2) is None


def test_the_active_lamp_of_each_light_setting(world):
    rig = localised("A")
    assert active_lamp(world, rig, "off", "no") is None
    cameras = [rig.camera(side).centre for side in "LR"]
    assert np.linalg.norm(active_lamp(world, rig, "on", "no") - np.mean(cameras, axis=0)) < 0.15
    np.testing.assert_allclose(active_lamp(world, rig, "on", "30"), active_lamp(world, rig, "off", "30"))


def test_lamp_positions_come_from_the_calibration(untouched_scene):
    found = {"180": np.array([-3.5, 0.4, 0.8])}
    world = build_world(read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX), 0.004, found, RIG_LAMP)
    np.testing.assert_array_equal(active_lamp(world, localised("A"), "off", "180"), found["180"])


@pytest.fixture(scope="module")
def walled(untouched_scene):
    terrain = read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX)
    return build_world(replace(terrain, walls=level_walls(2.1, terrain.sand_level + 0.3)), 0.004, SUN_LAMPS, RIG_LAMP)


def seen_at(world, position):
    """Return the visible id of the left camera of position A at a point of the ground."""
    view = localised("A").camera("L")
    u, v = view.project(np.array(position))
    return VisibleIds(world, view, np.array([v]), np.array([u]))


def test_the_near_wall_hides_the_ground_behind_it(world, walled):
    behind = [2.0, -0.4, 0.0]  # 10 cm from the near wall, which occludes 0.4 m
    assert seen_at(world, behind).ground.all()
    assert not seen_at(walled, behind).ground.any()
    assert not seen_at(walled, behind).hit.any()
    assert seen_at(walled, [1.0, -0.4, 0.0]).ground.all()


def test_a_wall_shades_the_adjacent_ground(walled):
    position = lamp_position("30")  # low, outside the wall at x = 2.1
    assert (seen_at(walled, [1.6, 0.9, 0.0]).clearance(walled.sandbox, position) < 0).all()
    assert (seen_at(walled, [-1.0, -0.4, 0.0]).clearance(walled.sandbox, position) > 0).all()


def test_the_near_wall_hides_the_foot_of_a_rock_and_all_of_a_low_rock(world, walled):
    eye = localised("A").camera("L").centre
    behind = np.array([[1.9, -0.4, 0.0], [1.9, -0.4, 0.25]])  # 20 cm from the wall, which occludes points below 0.2 m
    assert walled.hidden(eye, behind, 4).tolist() == [True, False]
    assert not world.hidden(eye, behind, 4).any()


ANNOTATED, INSIDE = np.array([100.0, 200, 180, 230]), np.zeros(4, bool)


def test_an_edge_is_the_mean_of_annotation_and_photo_if_both_are_close():
    in_photo = CastShadow(ANNOTATED + np.array([4, -2, 60, 3]), in_photo=True)  # dark ground continues on the right
    np.testing.assert_allclose(mean_shadow(ANNOTATED, INSIDE, in_photo, 0.3), ANNOTATED + np.array([2, -1, 0, 1.5]))


def test_a_cast_shadow_without_photo_has_a_lower_weight():
    cast = CastShadow(ANNOTATED + np.array([13, 0, 13, 0]), in_photo=False)
    np.testing.assert_allclose(mean_shadow(ANNOTATED, INSIDE, cast, 0.3), ANNOTATED + np.array([3, 0, 3, 0]))


def test_an_edge_cut_by_the_annotated_photo_is_taken_from_the_cast_box():
    cast = CastShadow(ANNOTATED + np.array([0, 0, 90, 0]), in_photo=False)
    np.testing.assert_allclose(
        mean_shadow(ANNOTATED, np.array([0, 0, 1, 0], bool), cast, 0.0), ANNOTATED + np.array([0, 0, 90, 0])
    )


def test_a_cast_shadow_without_overlap_is_ignored():
    for cast in (None, CastShadow(ANNOTATED + 100, in_photo=True)):
        np.testing.assert_allclose(mean_shadow(ANNOTATED, INSIDE, cast, 0.3), ANNOTATED)


def test_a_shadow_in_a_photo_ends_at_the_shadow_of_the_wall(untouched_scene):
    """A higher wall shades the near part of the shadow of the rock."""
    lamp_position = np.array([3.2, -0.6, 0.6])
    terrain = read_terrain(untouched_scene.meshes, TERRAIN, SANDBOX)

    def box(height, *, with_photo=True):
        walls = level_walls(2.1, terrain.sand_level + height)
        known = associate_rocks(
            replace(terrain, walls=walls), {"A": localised("A")}, {"30": lamp_position}, RIG_LAMP, {}
        )
        photo = OlatBrightness(known, polar()).brightness((3, "A", "off", "30", "L")) if with_photo else None
        shadows = PositionShadows(PositionRocks(known, "A", LabelsOptions()), LabelsOptions())
        return shadows.cast("L", "off", "30", {4: None}, photo)[4].box

    low, high = box(0.3), box(0.42)
    assert high[3] < low[3] - 20  # the shadow of the near wall covers the lower part
    assert high[1] == pytest.approx(low[1], abs=4)
    np.testing.assert_array_equal(box(0.42, with_photo=False), box(0.3, with_photo=False))


def test_the_sphere_test_keeps_all_rays_that_hit_a_rock(world):
    toward = BLOCKS[4][0] - BLOCKS[7][0]
    points = world.bodies[7].vertices
    shares = []
    for off in ([0, 0, 0.05], [0, 0, 0.22], [0.3, 0.3, 0.05], [2.0, 2.0, 1.0]):
        eye = BLOCKS[4][0] + 0.6 * toward + off
        distance, face = world.rocks.nearest(np.broadcast_to(eye, points.shape), points - eye)
        expected = (distance < 1) & (world.rock_of_rocks_face[face] == 4)
        np.testing.assert_array_equal(world.hidden(eye, points, 7), expected)
        shares.append(expected.mean())
    assert shares[0] > 0.9  # behind the block
    assert 0 < shares[1] < 1
    assert shares[3] == 0


def test_slivers_have_a_box_only_if_enabled():
    shadow = np.full((100, 100), -1)
    shadow[40, 20:60] = 4  # one sample of 2 px wide
    assert shadow_box(shadow, 4, None, 2, windows_of(shadow)).tolist() == [40, 80, 120, 82]
    assert shadow_box(shadow, 4, None, 2, windows_of(shadow), slivers=False) is None
    shadow[40:46, 20:30] = 4
    assert shadow_box(shadow, 4, None, 2, windows_of(shadow), slivers=False) is not None
