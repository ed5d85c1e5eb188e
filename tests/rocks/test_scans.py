import numpy as np
import pytest

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.rocks.alignment import alignment
from polarsim.rocks.clouds import surface_cloud, voxel_means
from polarsim.rocks.scans import ScanPoints, organised, place_scan, trusted_pixels

LENS = Lens(500, 500, 100, 60, width=200, height=120)
WALL = np.where(np.arange(200)[None, :] < 100, 2.0, 2.6) * np.ones((120, 1))  # a step of 0.6 m in depth


def seen(depth):
    return (LENS.pixel_directions() * depth[..., None]).astype(np.float32)


def test_mixed_pixels_at_a_depth_edge_are_not_trusted():
    depth = WALL.copy()
    depth[:, 100] = 2.3  # neither on the near wall nor on the far one
    trusted = trusted_pixels(seen(depth), LENS.fx)[1:-1]  # a corner of the map has too few neighbours
    assert not trusted[:, 100].any()
    assert trusted[:, :98].all()
    assert trusted[:, 103:].all()


def test_a_lone_return_is_not_trusted():
    points = np.full((120, 200, 3), np.nan, np.float32)
    points[60, 60] = [0, 0, 2]
    assert not trusted_pixels(points, LENS.fx).any()


def test_noise_of_two_millimetres_is_trusted(rng):
    trusted = trusted_pixels(seen(2.0 + 0.002 * rng.normal(size=(120, 200))), LENS.fx)
    assert trusted.mean() > 0.99


def test_a_placed_scan_looks_back_at_its_scanner():
    pose = Pose.from_rotvec(np.array([0.3, -2, 0.1]), np.array([1.0, 2, 3]))
    scan = place_scan(seen(WALL), np.ones(WALL.shape, bool), pose)
    back = scan.points + scan.to_scanner * np.linalg.norm(scan.points - pose.translation, axis=1)[:, None]
    np.testing.assert_allclose(back, np.broadcast_to(pose.translation, back.shape), atol=1e-6)
    np.testing.assert_allclose(scan.weights, 1 / np.linalg.norm(scan.points - pose.translation, axis=1) ** 2)


def test_a_cloud_becomes_a_range_map_that_hides_what_lies_behind():
    near, far = seen(np.full((120, 200), 2.0)).reshape(-1, 3), seen(np.full((120, 200), 3.0)).reshape(-1, 3)
    range_map, lens = organised(np.concatenate([near, far]).astype(float), LENS)
    assert range_map.shape == (lens.height, lens.width, 3)
    assert np.nanmax(range_map[..., 2]) == pytest.approx(2.0)
    assert np.isfinite(range_map[..., 2]).mean() > 0.95


def test_voxel_means_do_not_depend_on_the_order_of_points(rng):
    points = rng.uniform(0, 0.05, (5000, 3))
    scan = ScanPoints(points, np.tile([0.0, 0, 1], (5000, 1)), rng.uniform(1, 2, 5000))
    order = rng.permutation(5000)
    np.testing.assert_array_equal(voxel_means(scan, 0.01).points, voxel_means(scan.select(order), 0.01).points)
    assert len(voxel_means(scan, 0.01)) == 125


def test_a_noisy_plane_becomes_flat_with_normals_to_the_scanner(rng):
    points = np.column_stack([rng.uniform(0, 0.1, (4000, 2)), 0.001 * rng.normal(size=4000)])
    scan = ScanPoints(points, np.tile([0.0, 0, 1], (4000, 1)), np.ones(4000))
    cloud = surface_cloud(scan)
    assert cloud.points[:, 2].std() < 0.0004
    assert (cloud.normals[:, 2] > 0.95).mean() > 0.95


@pytest.mark.parametrize("radius", [0.03, 0.05, 0.1])
def test_a_noisy_ball_keeps_its_radius(rng, radius):
    # Planes through the same neighbours made it smaller by 0.8, 0.5 and 0.3 mm.
    outward = rng.normal(size=(round(5e6 * radius**2), 3))
    outward = outward[outward[:, 2] > 0] / np.linalg.norm(outward[outward[:, 2] > 0], axis=1, keepdims=True)
    noise = 0.002 * rng.normal(size=len(outward))  # along the beams of a scanner high above
    points = radius * outward + noise[:, None] * [0, 0, 1]
    scan = ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points)))
    cloud = surface_cloud(voxel_means(scan, 0.002))
    error = np.linalg.norm(cloud.points, axis=1) - radius
    well_seen = cloud.points[:, 2] > 0.5 * radius
    assert abs(np.median(error[well_seen])) < 0.0002
    assert np.median(np.abs(error[well_seen])) < 0.0003


def test_a_lone_point_stays_where_it_is(rng):
    patch = np.column_stack([rng.uniform(0, 0.05, (500, 2)), np.zeros(500)])
    points = np.concatenate([patch, [[5.0, 5.0, 5.0]]])
    cloud = surface_cloud(ScanPoints(points, np.tile([0.0, 0, 1], (501, 1)), np.ones(501)))
    np.testing.assert_allclose(cloud.points[-1], points[-1], atol=1e-9)
    assert np.isfinite(cloud.points).all()
    assert np.isfinite(cloud.normals).all()


def test_too_few_points_make_an_empty_cloud():
    assert len(surface_cloud(ScanPoints(np.zeros((3, 3)), np.zeros((3, 3)), np.ones(3)))) == 0


def test_alignment_undoes_a_shift_between_scans(rng):
    places = rng.uniform(-1, 1, (2, 60_000, 2))
    heights = 0.1 * np.sin(5 * places[..., 0]) * np.cos(4 * places[..., 1])
    surface = np.concatenate([places, heights[..., None]], axis=-1)
    moved = Pose.from_rotvec(np.array([0.0005, -0.001, 0.001]), np.array([0.004, -0.003, 0.005]))
    scans = [ScanPoints(p, np.zeros_like(p), np.ones(len(p))) for p in (surface[0], moved.apply(surface[1]))]
    first, second = alignment(scans)
    between = first.inverse() @ second @ moved
    assert np.linalg.norm(between.translation) < 3e-4
    np.testing.assert_allclose(between.rotation, np.eye(3), atol=2e-4)
    np.testing.assert_allclose(first.translation + second.translation, 0, atol=1e-4)  # the frame stays


def test_one_scan_stays_where_it_is(rng):
    points = rng.normal(size=(1000, 3))
    assert np.array_equal(alignment([ScanPoints(points, points, np.ones(1000))])[0].matrix, np.eye(4))
