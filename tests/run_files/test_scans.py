from dataclasses import replace

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats.clouds import write_cloud
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.run_files.inventory import Inventory
from polarsim.run_files.scans import interpolate, read_scan, surface_of_cloud, trusted_pixels
from polarsim.site_file_names import Files
from tests.support.other_site import other_rig

LENS = Lens(500, 500, 100, 60, width=200, height=120)
WALL = np.where(np.arange(200)[None, :] < 100, 2.0, 2.6) * np.ones((120, 1))  # a step of 0.6 m in depth


def seen(depth):
    return (LENS.pixel_directions() * depth[..., None]).astype(np.float32)


def test_mixed_pixels_at_a_depth_edge_are_not_trusted():
    depth = WALL.copy()
    depth[:, 100] = 2.3  # neither on the near nor on the distant wall
    trusted = trusted_pixels(seen(depth), LENS.fx)[1:-1]  # a corner of the map has too few neighbours
    assert not trusted[:, 100].any()
    assert trusted[:, :98].all()
    assert trusted[:, 103:].all()


def test_an_isolated_return_is_not_trusted():
    points = np.full((120, 200, 3), np.nan, np.float32)
    points[60, 60] = [0, 0, 2]
    assert not trusted_pixels(points, LENS.fx).any()


def test_noise_of_two_millimetres_is_trusted(rng):
    trusted = trusted_pixels(seen(2.0 + 0.002 * rng.normal(size=(120, 200))), LENS.fx)
    assert trusted.mean() > 0.99


def test_the_surface_of_a_cloud_hides_points_behind_it():
    near, far = seen(np.full((120, 200), 2.0)).reshape(-1, 3), seen(np.full((120, 200), 3.0)).reshape(-1, 3)
    points, means, _ = surface_of_cloud(np.concatenate([near, far]).astype(float), LENS)
    assert points[:, 2].max() == pytest.approx(2.0)
    assert means[:, 2].max() == pytest.approx(2.0)
    assert len(points) > 0.98 * len(near)


def test_the_surface_of_a_noisy_cloud_has_all_of_its_points(rng):
    """Pixels have four points; the nearest of each would be 1 mm nearer than the plane."""
    directions = LENS.directions(rng.uniform([0, 0], [LENS.width, LENS.height], (100_000, 2)))
    depth = 2.5 + 0.002 * rng.normal(size=100_000)
    points, means, _ = surface_of_cloud(directions / directions[:, 2:] * depth[:, None], LENS)
    assert len(points) > 0.98 * len(depth)
    for surface in (points, means):
        assert abs(surface[:, 2].mean() - 2.5) < 5e-5  # standard error 7e-6


def test_points_between_the_points_of_a_cloud_are_on_their_plane_and_not_across_edges(rng):
    """An inclined plane in front of a wall: the image of the plane is filled, its edge is not joined to the wall."""
    pixels = rng.uniform([0, 0], [LENS.width, LENS.height], (4000, 2))
    rays = LENS.directions(pixels)
    on_plane = pixels[:, 0] < 100
    depth = np.where(on_plane, 2 / (rays @ [0, 0.3, 1]), 5 / rays[:, 2])
    points, _, lens = surface_of_cloud(rays * depth[:, None], LENS)
    found = interpolate(points, lens.fx, LENS)
    near = found[:, 2] < 3.5
    np.testing.assert_allclose(found[near] @ [0, 0.3, 1], 2, atol=1e-5)
    np.testing.assert_allclose(found[~near][:, 2], 5, atol=1e-5)
    column, row = LENS.project(found[near]).T
    assert column.max() < 101
    inside = (column > 10) & (column < 90) & (row > 10) & (row < 110)
    assert inside.sum() > 0.98 * 80 * 100


def test_clouds_of_a_site_are_read_in_their_unit_and_frame(tmp_path, rng):
    """Points on a plane in the left frame are read from files of both units and frames."""
    rig = replace(
        other_rig(), left_from_right=Pose.from_rotvec(np.array([0.0, 0.02, 0.0]), np.array([0.12, 0.01, 0.0]))
    )
    grid = rectified_left(rig)
    pixels = rng.uniform([40, 40], [600, 440], (40_000, 2))
    points = 2.5 * rig.left.directions(pixels)
    for frame, unit in (("left", "m"), ("rectified", "mm")):
        stored = points if frame == "left" else grid.left_from_rectified.inverse().apply(points)
        write_cloud(tmp_path / "a.xyz", stored, np.zeros(len(stored)), unit)
        inventory = Inventory("yard-a", "files", clouds={"gate": str(tmp_path / "a.xyz")})
        files = Files(photos="{terrain}.png", cloud_frame=frame, cloud_unit=unit)
        found = read_scan(inventory, "gate", rig, files)
        np.testing.assert_allclose(found[:, 2], 2.5, atol=2e-3)
        assert len(found) > 1000
    with pytest.raises(FormatError, match="cloud_unit"):
        read_scan(inventory, "gate", rig, files.model_copy(update={"cloud_unit": "m"}))


def test_a_cloud_in_the_upright_frame_of_a_scanner_is_an_error(tmp_path, rng):
    sand = np.column_stack([rng.uniform(1, 8, 20_000), rng.uniform(-2, 2, 20_000), np.full(20_000, -1.5)])
    write_cloud(tmp_path / "a.xyz", sand, np.zeros(len(sand)), "m")
    inventory = Inventory("yard-a", "files", clouds={"gate": str(tmp_path / "a.xyz")})
    files = Files(photos="{terrain}.png", cloud_frame="left", cloud_unit="m")
    with pytest.raises(FormatError, match="cloud_frame") as raised:
        read_scan(inventory, "gate", StereoRig.single(other_rig().left), files)
    assert raised.value.path == tmp_path / "a.xyz"


def test_a_scan_of_a_single_camera_is_in_the_frame_of_the_camera(tmp_path, rng):
    lens = other_rig().left
    points = 2.0 * lens.directions(rng.uniform([60, 60], [580, 420], (40_000, 2)))
    write_cloud(tmp_path / "a.xyz", points, np.zeros(len(points)), "m")
    inventory = Inventory("yard-a", "files", clouds={"gate": str(tmp_path / "a.xyz")})
    found = read_scan(inventory, "gate", StereoRig.single(lens), Files(photos="{terrain}.png", cloud_frame="left"))
    np.testing.assert_allclose(found[:, 2], 2.0, atol=2e-3)
    assert len(found) > 1000
