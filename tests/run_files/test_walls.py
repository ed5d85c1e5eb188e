"""Geometry of walls: clearance of light, and triangles that cast the same shadow."""

import numpy as np
import pytest

from polarsim.geometry.casters import make_caster
from polarsim.run_files.walls import (
    SIDES,
    Wall,
    Walls,
    level_walls,
    lowest_wall,
    read_walls,
    surely_wall,
    surveyed_walls,
    wall_strips,
    write_walls,
)
from polarsim.site import polar
from tests.support.other_site import other_site

LEVEL = level_walls(2.0, 0.3)


def sloping(rng) -> Walls:
    """Return walls of different faces whose tops rise and fall."""
    along = wall_strips(2.0)
    return Walls(
        {
            side: Wall(rng.uniform(1.9, 2.1), along, 0.3 + 0.02 * np.sin(3 * along + number), 1.0)
            for number, side in enumerate(SIDES)
        },
        "scans",
    )


@pytest.mark.parametrize(
    ("position", "lamp", "height"),
    [
        ([0, 0, 0], [4, 0, 1], 0.5),  # half of the ray is inside
        ([1.5, 0, 0.1], [3.5, 0, 0.9], 0.3),
        ([0, 1, 0], [-3, 3, 1.2], 0.6),  # over the wall at y = 2, before it passes x = -2
        ([0, 0, 0], [1, 1, 1], np.inf),  # a lamp inside
        ([0, -1, 0], [0, -4, 0.9], 0.3),  # straight along an axis
    ],
)
def test_clearance_of_light_agrees_with_a_hand_calculation(position, lamp, height):
    clear = LEVEL.clearance(np.array([position], float), np.array(lamp, float))
    np.testing.assert_allclose(clear, [height - 0.3], atol=1e-12)


@pytest.mark.parametrize("lamp", [[3.4, 1.8, 0.8], [-3.5, 0.4, 0.7], [0.2, -4.0, 0.8], [0.3, 3.9, 0.7]])
def test_points_without_clearance_are_in_the_shadow_of_the_mesh(rng, lamp):
    walls, lamp = sloping(rng), np.array(lamp)
    points = np.column_stack([rng.uniform(-1.85, 1.85, (4000, 2)), rng.uniform(-0.05, 0.05, 4000)])
    vertices, faces, _ = walls.mesh(-0.5)
    occluded = make_caster(vertices, faces).occluded(points, lamp - points, 1.0)
    clear = walls.clearance(points, lamp)
    certain = np.abs(clear) > 0.012  # the outer edge of a sloping top can be higher than the inner edge
    np.testing.assert_array_equal(clear[certain] < 0, occluded[certain])
    assert 0.05 < occluded.mean() < 0.95


def test_normals_point_away_from_the_boards_and_faces_agree_with_them(rng):
    vertices, faces, normals = sloping(rng).mesh(-0.5)
    corners = vertices[faces]
    plane = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("fa,fa->f", plane, normals[faces[:, 0]]) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1)


def test_boards_enclose_the_floor_without_gaps(rng):
    walls = sloping(rng)
    vertices, faces, _ = walls.mesh(-0.5)
    caster = make_caster(vertices, faces)
    angle = np.linspace(0, 2 * np.pi, 721)
    rays = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(721)])
    distance, _ = caster.nearest(np.tile([0.0, 0.0, 0.2], (721, 1)), rays)
    assert np.isfinite(distance).all()
    low, high = walls.bounds
    points = distance[:, None] * rays[:, :2]
    np.testing.assert_allclose(np.minimum(points - low, high - points).min(axis=1), 0, atol=1e-5)


YARD = other_site().sandbox  # 3 m x 6 m, without a wall at -y


def test_stated_walls_are_at_the_borders_of_a_rectangle_and_an_open_side_casts_no_shadow():
    walls = surveyed_walls(YARD, 0.1)
    np.testing.assert_allclose(walls.bounds, [[-1.55, -3.0], [1.55, 3.05]])
    assert set(walls.sides) == {"-x", "+x", "+y"}
    assert [len(walls.sides[side].along_m) for side in ("+x", "+y")] == [61, 31]
    lamps = {"+x": (9, 0, 0.2), "-x": (-9, 0, 0.2), "+y": (0, 9, 0.2), "-y": (0, -9, 0.2)}
    centre = np.zeros((1, 3))
    shaded = {side: bool(walls.clearance(centre, np.array(lamp, float))[0] < 0) for side, lamp in lamps.items()}
    assert shaded == {"+x": True, "-x": True, "+y": True, "-y": False}
    vertices, faces, _ = walls.mesh(-0.5)
    caster = make_caster(vertices, faces)
    for side, lamp in lamps.items():
        assert caster.occluded(centre, np.array([lamp], float), 1.0)[0] == shaded[side]
    assert surveyed_walls(other_site(sandbox={"half_width_m": [1.5, 3.0]}).sandbox, 0.0) is None


def test_walls_of_some_sides_are_written_and_read(tmp_path):
    walls = surveyed_walls(YARD, 0.0)
    write_walls(tmp_path, walls)
    read = read_walls(tmp_path)
    assert read.open_m == {"-y": 3.0}
    assert set(read.sides) == set(walls.sides)
    np.testing.assert_allclose(read.bounds, walls.bounds)


def test_only_complete_walls_hide_everything_behind_them():
    assert surely_wall(polar().sandbox) == 0.28
    assert (surely_wall(YARD), lowest_wall(YARD)) == (0.0, 0.18)
