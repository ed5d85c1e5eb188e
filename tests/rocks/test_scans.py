import numpy as np
import pytest

from polarsim.geometry.poses import Pose
from polarsim.rocks.clouds import surface_cloud, voxel_means
from polarsim.rocks.scans import ScanPoints, scan_in_sandbox


def test_directions_to_the_scanner(rng):
    pose = Pose.from_rotvec(np.array([0.3, -2, 0.1]), np.array([1.0, 2, 3]))
    scan = scan_in_sandbox(rng.normal(size=(1000, 3)), pose)
    back = scan.points + scan.to_scanner * np.linalg.norm(scan.points - pose.translation, axis=1)[:, None]
    np.testing.assert_allclose(back, np.broadcast_to(pose.translation, back.shape), atol=1e-6)
    np.testing.assert_allclose(scan.weights, 1 / np.linalg.norm(scan.points - pose.translation, axis=1) ** 2)


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
    # With planes, the radius was 0.8, 0.5 and 0.3 mm too small.
    outward = rng.normal(size=(round(5e6 * radius**2), 3))
    outward = outward[outward[:, 2] > 0] / np.linalg.norm(outward[outward[:, 2] > 0], axis=1, keepdims=True)
    noise = 0.002 * rng.normal(size=len(outward))  # along the beams of a distant scanner
    points = radius * outward + noise[:, None] * [0, 0, 1]
    scan = ScanPoints(points, np.tile([0.0, 0, 1], (len(points), 1)), np.ones(len(points)))
    cloud = surface_cloud(voxel_means(scan, 0.002))
    error = np.linalg.norm(cloud.points, axis=1) - radius
    well_seen = cloud.points[:, 2] > 0.5 * radius
    assert abs(np.median(error[well_seen])) < 0.0002
    assert np.median(np.abs(error[well_seen])) < 0.0003


def test_a_single_point_is_not_moved(rng):
    patch = np.column_stack([rng.uniform(0, 0.05, (500, 2)), np.zeros(500)])
    points = np.concatenate([patch, [[5.0, 5.0, 5.0]]])
    cloud = surface_cloud(ScanPoints(points, np.tile([0.0, 0, 1], (501, 1)), np.ones(501)))
    np.testing.assert_allclose(cloud.points[-1], points[-1], atol=1e-9)
    assert np.isfinite([cloud.points, cloud.normals]).all()


def test_too_few_points_make_an_empty_cloud():
    assert len(surface_cloud(ScanPoints(np.zeros((3, 3)), np.zeros((3, 3)), np.ones(3)))) == 0
