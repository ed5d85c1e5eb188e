import numpy as np
import pytest

from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import outlines_of, rock_outline
from polarsim.geometry.planes import level_from, robust_plane, tracked_plane
from polarsim.geometry.poses import camera_pose

CUBE = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (0.0, 0.1)])
FACES = np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]])


def skirted_cube(skirt: float) -> Mesh:
    """Return a cube of 10 cm with a flat skirt of sand, 1 mm high, on all sides."""
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring *= (0.05 + skirt) / np.abs(ring).max(axis=1, keepdims=True)
    vertices = np.concatenate([CUBE, np.column_stack([ring, np.full(48, 0.001)])])
    faces = np.column_stack([np.zeros(48, int), 8 + np.arange(48), 8 + (np.arange(48) + 1) % 48])
    return Mesh(vertices, np.concatenate([FACES, faces]))


def test_a_skirt_of_sand_does_not_widen_a_rock():
    outlines = outlines_of({7: skirted_cube(0.03)}, trim=0.004, trim_share=0.35)
    camera = camera_pose(np.array([3.0, 0, 1.0]), np.pi, np.radians(20))
    lens = Lens(2000, 2000, 968, 608, width=1936, height=1216)
    whole = box_around_points(lens.project(camera.inverse().apply(skirted_cube(0.03).vertices)))
    cube = box_around_points(lens.project(camera.inverse().apply(CUBE)))
    cube_above_rim = box_around_points(lens.project(camera.inverse().apply(CUBE[CUBE[:, 2] > 0.005])))
    projected = outlines.project(Camera(camera, lens))[0]
    np.testing.assert_allclose(projected[[0, 2]], cube_above_rim[[0, 2]], atol=1e-9)  # left and right: top of the cube
    np.testing.assert_allclose(projected[[1, 3]], whole[[1, 3]], atol=1e-9)  # top and bottom: all vertices
    assert whole[2] - whole[0] > 1.4 * (cube[2] - cube[0])


def test_trimming_removes_at_most_its_share_of_a_rock():
    # The upper 65 % remain, although the trim is higher than the rock.
    _, upper = rock_outline(skirted_cube(0.03), trim=1.0, trim_share=0.35)
    np.testing.assert_array_equal(np.unique(upper[:, 2]), [0.1])


def test_outlines_give_the_box_of_all_vertices(rng):
    points = rng.standard_normal((500, 3)) * 0.05
    mesh = Mesh(points, np.column_stack([np.arange(498), np.arange(1, 499), np.arange(2, 500)]))
    outlines = outlines_of({1: mesh}, trim=0, trim_share=0)
    camera = camera_pose(np.array([3.0, 0.2, 1.0]), 3.1, 0.3, 0.1)
    lens = Lens(2000, 2000, 968, 608, (-0.1, 0.15, 0.0005, -0.001, 0), width=1936, height=1216)
    everything = box_around_points(lens.project(camera.inverse().apply(points)))
    np.testing.assert_allclose(outlines.project(Camera(camera, lens))[0, [1, 3]], everything[[1, 3]], atol=1e-9)
    edges, makers = outlines.edges(Camera(camera, lens))
    pixels = lens.project(camera.inverse().apply(makers[0]))
    np.testing.assert_allclose(pixels[[0, 1, 2, 3], [0, 1, 0, 1]], edges[0], atol=1e-9)


def test_rocks_with_negative_depth_have_no_box():
    outlines = outlines_of({1: Mesh(CUBE, FACES)}, 0.004, 0.35)
    away = camera_pose(np.array([3.0, 0, 1]), 0.0, 0.3)
    assert np.isnan(outlines.project(Camera(away, Lens(2000, 2000, 968, 608, width=1936, height=1216)))).all()


def test_a_robust_plane_passes_gross_outliers(rng):
    points = np.column_stack([rng.uniform(-1, 1, (200, 2)), np.zeros(200)])
    points[:, 2] = 0.1 * points[:, 0] - 0.05 * points[:, 1] + 0.3 + 0.001 * rng.standard_normal(200)
    points[:30, 2] += 0.5
    np.testing.assert_allclose(robust_plane(points, 0.003), [0.1, -0.05, 0.3], atol=0.002)


def test_a_tracked_plane_follows_the_surface_at_its_start(rng):
    sand = np.column_stack([rng.uniform(-1, 1, (500, 2)), 0.002 * rng.standard_normal(500) + 0.05])
    floor = np.column_stack([rng.uniform(-1, 1, (900, 2)), np.full(900, -0.5)])
    found = tracked_plane(np.concatenate([sand, floor]), np.zeros(3), [0.3, 0.1, 0.03])
    np.testing.assert_allclose(found, [0, 0, 0.05], atol=0.001)


@pytest.mark.parametrize("plane", [[0.1, -0.2, 0.3], [0.0, 0.0, 0.5], [-0.4, 0.0, 0.0]])
def test_levelling_a_plane_makes_its_points_level_at_zero(plane, rng):
    points = np.column_stack([rng.uniform(-1, 1, (50, 2)), np.zeros(50)])
    points[:, 2] = points[:, :2] @ plane[:2] + plane[2]
    levelled = level_from(np.array(plane)).apply(points)
    np.testing.assert_allclose(levelled[:, 2], 0, atol=1e-12)
