import numpy as np
import pytest

from polarsim.analog import scanner
from polarsim.analog.options import AnalogOptions
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose

BALL_RADIUS = 0.15  # metres, radius of the ball in conftest

SCANNER = Pose(np.diag([-1.0, -1.0, 1.0]), np.array([3.5, 0.0, 1.5]))  # x ahead (towards -X), y left, z up
CLEAN = {"mixed_pixels": 0.0, "range_noise_mm": 2.0, "scan_step_deg": 0.25}


def scanned(scene, caster, **options):
    return scanner.scan(scene, caster, SCANNER, np.random.default_rng(1), AnalogOptions(**{**CLEAN, **options}))


def on_sand(points):
    """Return the points on open sand, without ball and walls."""
    near = np.abs(points[..., :2]).max(axis=-1) < 1.5
    return near & (np.linalg.norm(points[..., :2], axis=-1) > 0.5) & (np.abs(points[..., 2]) < 0.1)


def test_ranges_scatter_by_the_noise_along_the_ray(ball_scene, ball_caster):
    points = scanned(ball_scene, ball_caster).points
    points = points[on_sand(points)]
    away = points - SCANNER.translation
    along = points[:, 2] / away[:, 2] * np.linalg.norm(away, axis=1)  # distance along the ray below the plane z = 0
    assert len(points) > 1000
    assert along.std() == pytest.approx(0.002, rel=0.1)
    assert abs(along.mean()) < 2e-4


def test_there_are_no_points_in_the_scanner_shadow_of_a_rock(ball_scene, ball_caster):
    points = scanned(ball_scene, ball_caster).points
    behind = (points[..., 0] < -BALL_RADIUS) & (np.abs(points[..., 1]) < 0.02) & (np.abs(points[..., 2]) < 0.02)
    # The ray over the top of the ball (z about 0.25) hits the sand about 0.5 m after the ball.
    assert not (behind & (points[..., 0] > -0.4)).any()
    assert (behind & (points[..., 0] < -0.9)).any()


def test_mixed_pixels_are_between_a_rock_and_the_sand_behind_it(ball_scene, ball_caster):
    def hanging(share):
        points = scanned(ball_scene, ball_caster, mixed_pixels=share, range_noise_mm=0.0).points
        behind = (points[..., 0] < -BALL_RADIUS - 0.02) & (points[..., 0] > -1)
        return (behind & (points[..., 2] > 0.02) & (np.abs(points[..., 1]) < 0.3)).sum()

    assert hanging(0.0) == 0
    assert hanging(0.9) > 3


def test_grazing_and_dark_surfaces_have_fewer_returns():
    bright, grazing, dark = (
        scanner._lost(np.array([c]), np.array([a]))[0] for c, a in ((0.8, 0.4), (0.02, 0.4), (0.8, 0.02))
    )
    assert bright < 0.01
    assert grazing > 0.5
    assert dark > 0.1


def test_a_map_of_an_exact_scan_shows_the_plane_at_its_depth(ball_scene, ball_caster):
    found = scanned(ball_scene, ball_caster, range_noise_mm=0.0)
    grid = Lens(500.0, 500.0, 240.0, 150.0, width=480, height=300)
    sandbox_from_grid = camera_pose(SCANNER.translation, np.pi, np.radians(25))
    vertices, faces = scanner.join_points(found, SCANNER.translation)
    points = scanner.range_map([(sandbox_from_grid.inverse().apply(vertices), faces)], grid)
    at = sandbox_from_grid.apply(points.astype(float))
    flat = on_sand(at)
    assert flat.mean() > 0.2
    assert np.abs(at[flat][:, 2]).max() < 0.002
    v, u = np.argwhere(np.isfinite(points[..., 2]))[500]
    np.testing.assert_allclose(grid.project(points[v, u].astype(float)), [u + 0.5, v + 0.5], atol=0.1)
