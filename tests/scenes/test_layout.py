"""Layout of scenes: sizes, positions, burial and piles of rocks."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull, Delaunay

from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator
from polarsim.scenes.layout import RockShape, draw_render_options, draw_rotation, draw_scene, draw_sizes, scatter_rocks
from polarsim.scenes.options import SceneRanges
from polarsim.scenes.viewpoints import draw_camera

COARSE = {"cell_m": 0.1, "max_craters": 0}


def test_scenes_are_reproducible_and_have_the_given_number_of_rocks_and_vertex_albedo(shapes):
    first, again, other = (
        draw_scene(shapes, SceneRanges(rocks=(7, 7), **COARSE), generator(n, "x")) for n in (3, 3, 4)
    )
    assert first.mesh.rocks == list(range(1, 8))
    assert first.mesh.rock_of_face[0] == NO_ROCK
    assert np.count_nonzero(first.mesh.rock_of_face == 1) == 12
    assert len(first.albedo) == len(first.mesh.vertices)
    assert (first.albedo > 0).all()
    np.testing.assert_array_equal(first.mesh.vertices, again.mesh.vertices)
    assert first.options == again.options
    assert first.options != other.options
    assert not np.intersect1d(first.mesh.rock_vertices(1), other.mesh.rock_vertices(1)).size


def test_a_scene_has_one_of_the_given_models(shapes):
    def models(**options):
        chosen = SceneRanges(rocks=(1, 1), **COARSE, **options)
        return {draw_scene(shapes, chosen, generator(n, "x")).options.models for n in range(12)}

    assert models() == {("hapke",), ("principled",)}
    assert models(models=("principled",)) == {("principled",)}


def test_the_number_of_larger_rocks_falls_with_the_power_of_their_size(rng):
    """Expected share above d: (d^-2 - D^-2) / (s^-2 - D^-2) for sizes from s to D."""
    options = SceneRanges(rock_size_m=(0.05, 0.6), size_power=(2.0, 2.0))
    sizes = draw_sizes(20000, options, rng)
    assert sizes.min() >= 0.05
    assert sizes.max() <= 0.6
    for size in (0.1, 0.2, 0.4):
        expected = (size**-2 - 0.6**-2) / (0.05**-2 - 0.6**-2)
        assert (sizes > size).mean() == pytest.approx(expected, abs=4 * np.sqrt(expected / 20000))


@pytest.mark.parametrize(("size", "ratios"), [(0.05, {0.5}), (0.15, {0.5, 0.667}), (0.5, {0.667})])
def test_rocks_are_scaled_within_the_limits_and_keep_their_shape(shapes, size, ratios):
    """Blocks of 0.1 and 0.3 m with a height of 0.5 and 2/3 of the length may be scaled by 0.3 to 2."""
    options = SceneRanges(
        rocks=(1, 1), rock_size_m=(size, size), tumbled_share=0, tilt_sd_deg=0, piled_share=(0, 0), **COARSE
    )
    scenes = [draw_scene(shapes, options, generator(number, "size")) for number in range(12)]
    heights = [np.ptp(scene.mesh.rock_vertices(1)[:, 2]) for scene in scenes]
    assert {round(height / size, 3) for height in heights} == ratios


def test_rocks_are_sunk_by_the_given_share(shapes):
    grid = np.meshgrid(np.arange(-2, 2.01, 0.1), np.arange(-2, 2.01, 0.1))
    for sunk in (0.0, 0.4):
        options = SceneRanges(rocks=(9, 9), sunk=(sunk, sunk), piled_share=(0, 0))
        camera, seen = _camera(options)
        for rock in scatter_rocks(shapes, grid, np.zeros((41, 41)), camera, seen, options, generator(1, "sunk")):
            assert rock.vertices[:, 2].min() == pytest.approx(-sunk * np.ptp(rock.vertices[:, 2]), abs=1e-9)


def test_rocks_are_placed_on_visible_sand(shapes):
    options = SceneRanges(rocks=(30, 30), piled_share=(0, 0), camera_height_m=(1.2, 1.2))
    grid = np.meshgrid(np.arange(-3, 3.01, 0.1), np.arange(-3, 3.01, 0.1))
    camera, seen = _camera(options)
    area = Delaunay(seen)
    rocks = scatter_rocks(shapes, grid, np.zeros((61, 61)), camera, seen, options, generator(1, "place"))
    centres = [(rock.vertices[:, :2].min(axis=0) + rock.vertices[:, :2].max(axis=0)) / 2 for rock in rocks]
    assert (area.find_simplex(np.array(centres)) >= 0).all()


def test_piles_are_higher_than_any_of_their_rocks():
    grid = np.meshgrid(np.arange(-3, 3.01, 0.02), np.arange(-3, 3.01, 0.02))
    options = SceneRanges(
        rocks=(6, 6), rock_size_m=(0.2, 0.2), rock_scale=(0.01, 1), piled_share=(1, 1), sunk_into_rocks=(0, 0)
    )
    camera, seen = _camera(options)
    shapes = [RockShape(_ball(3000))]
    highest = [
        max(
            rock.vertices[:, 2].max()
            for rock in scatter_rocks(shapes, grid, np.zeros((301, 301)), camera, seen, options, random)
        )
        for random in (generator(n, "pile") for n in range(6))
    ]
    assert np.median(highest) > 0.25  # single rocks are 0.2 m high


def test_tumbled_rocks_have_any_rotation_and_others_are_upright(rng):
    upright = [draw_rotation(0.0, 5.0, rng).apply([0, 0, 1])[2] for _ in range(300)]
    assert np.degrees(np.arccos(min(upright))) < 30
    tumbled = [draw_rotation(1.0, 6.0, rng).apply([0, 0, 1])[2] for _ in range(300)]
    assert np.mean(tumbled) == pytest.approx(0, abs=4 / np.sqrt(3 * 300))


def test_a_coarse_copy_keeps_the_rocks_size():
    lumpy = RockShape(_ball(3000))
    few, many = lumpy.mesh(0.4, 0.1), lumpy.mesh(0.4, 0.02)
    assert len(few.faces) < len(many.faces)
    for mesh in (few, many):
        np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), 0.4, rtol=0.1)


def _ball(count):
    """Return the convex hull of evenly distributed points on the unit sphere (Fibonacci lattice)."""
    number = np.arange(count)
    height, angle = 1 - (2 * number + 1) / count, number * np.pi * (3 - np.sqrt(5))
    level = np.sqrt(1 - height**2)
    points = np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1)
    faces = ConvexHull(points).simplices.copy()
    a, b, c = (points[faces[:, corner]] for corner in range(3))
    inward = np.einsum("na,na->n", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)


def _camera(options):
    random = generator(4, "camera")
    chosen, wall_height = draw_render_options(options, random)
    return draw_camera(2.05 if chosen.walls else 3.0, wall_height if chosen.walls else 0.0, options, random)
