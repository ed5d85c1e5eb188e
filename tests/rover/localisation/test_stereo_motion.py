"""Stereo odometry on pictures of a textured plane with a box, and the covariance of its fit."""

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import Rotation

from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.rover.localisation import motion_fit, stereo_motion
from polarsim.rover.localisation.motion_fit import fit_motion
from polarsim.rover.localisation.stereo_motion import StereoMotion, visual_odometry
from polarsim.rover.perception.observation import rectification

LENS = Lens(345.0, 345.0, 160.0, 100.0, width=320, height=200)
RIG = rectification(LENS, 0.3)
CELL = 0.02
SMOOTH_NOISE = ndimage.gaussian_filter(np.random.default_rng(1).normal(size=(600, 600)), 1.2)
TEXTURE = SMOOTH_NOISE / SMOOTH_NOISE.std()
BOX_LOW, BOX_HIGH = np.array([2.6, -0.5, 0.0]), np.array([3.0, 0.0, 0.25])
RAYS = LENS.pixel_directions()


def camera(x: float, y: float = 0.0, yaw: float = 0.0, roll: float = 0.0) -> Pose:
    return camera_pose(np.array([x, y, 1.25]), yaw, np.radians(30), roll)


def picture(world_from_camera: Pose) -> np.ndarray:
    """Return light (h, w) of the plane z = 0 and the box, with the texture along x + z and y."""
    rays, eye = world_from_camera.rotate(RAYS), world_from_camera.translation
    down = np.where(rays[..., 2] < 0, -eye[2] / np.minimum(rays[..., 2], -1e-9), 50.0)
    ends = np.sort(np.stack([(BOX_LOW - eye) / rays, (BOX_HIGH - eye) / rays]), axis=0)
    enters, leaves = ends[0].max(axis=-1), ends[1].min(axis=-1)
    distance = np.where((enters < leaves) & (enters > 0), np.minimum(enters, down), down)
    points = eye + rays * distance[..., None]
    at = np.stack([points[..., 1], points[..., 0] + points[..., 2]]) / CELL
    return 100 + 25 * ndimage.map_coordinates(TEXTURE, at, order=1, mode="grid-wrap")


def pair(world_from_camera: Pose, seed: int = 0, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return noisy pictures of both cameras."""
    rng = np.random.default_rng(seed)
    aside = Pose(np.eye(3), np.array([RIG.baseline, 0.0, 0.0]))
    light = (picture(pose) for pose in (world_from_camera, world_from_camera @ aside))
    left, right = (np.clip(gain * image + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8) for image in light)
    return left, right


@pytest.fixture(scope="module")
def drive() -> tuple[list[Pose], list[tuple[np.ndarray, np.ndarray]]]:
    """Return poses and pairs of a straight drive over bumps."""
    poses = [camera(0.2 * k, 0.0, 0.0, 0.01 * (k % 2)) for k in range(5)]
    return poses, [pair(pose, k) for k, pose in enumerate(poses)]


def errors(motion, before: Pose, now: Pose) -> np.ndarray:
    """Return errors (6,) of rotation, rad, and translation, m, in the frames of `Motion`."""
    true = before.inverse() @ now
    turn = Rotation.from_matrix(motion.before_from_now.rotation.T @ true.rotation).as_rotvec()
    return np.concatenate([turn, true.translation - motion.before_from_now.translation])


def normalised(motion, before: Pose, now: Pose) -> float:
    error = errors(motion, before, now)
    return float(error @ np.linalg.solve(motion.covariance, error)) / 6


def require_right(motion, before: Pose, now: Pose) -> None:
    error = errors(motion, before, now)
    assert np.linalg.norm(error[:3]) < 1.5e-3
    assert np.linalg.norm(error[3:]) < 4e-3
    assert normalised(motion, before, now) < 3


def test_a_straight_drive_is_followed_with_errors_as_large_as_the_covariance_says(drive):
    poses, pairs = drive
    stereo = StereoMotion(RIG)
    motions = [stereo.add(*taken) for taken in pairs]
    assert motions[0] is None
    for motion, before, now in zip(motions[1:], poses, poses[1:], strict=False):
        require_right(motion, before, now)
    mean = np.mean([normalised(m, *p) for m, *p in zip(motions[1:], poses, poses[1:], strict=False)])
    assert 0.05 < mean < 1.6
    estimated, lost = visual_odometry(pairs, RIG)
    assert lost == 0
    assert np.linalg.norm(estimated[-1].translation - (poses[0].inverse() @ poses[-1]).translation) < 0.006


def test_a_turn_on_the_spot_is_found_without_prediction_and_a_wrong_prediction_does_not_change_it(drive):
    before, now = drive[0][0], camera(0.0, yaw=np.radians(7))
    taken = pair(now, 9)
    motions = []
    for predicted in (None, Pose.from_rotvec(np.array([0.0, 0.1, 0.0]), np.array([0.2, 0.0, 0.3]))):
        stereo = StereoMotion(RIG)
        stereo.add(*drive[1][0])
        motions.append(stereo.add(*taken, predicted))
        require_right(motions[-1], before, now)
    assert np.linalg.norm(errors(motions[0], before, now) - errors(motions[1], before, now)) < 2e-3


def test_a_shadow_that_moves_with_the_rover_does_not_change_the_motion(drive):
    poses, pairs = drive
    outline = np.zeros(LENS.shape, bool)
    teeth = (80 + 40 * (np.arange(LENS.height) // 8 % 2))[:, None]  # an edge with many corners
    outline[:, 60:] = np.arange(60, LENS.width) < 60 + teeth
    stereo = StereoMotion(RIG)
    motions = [stereo.add(*(np.where(outline, side // 12, side) for side in taken)) for taken in pairs[:3]]
    for motion, before, now in zip(motions[1:], poses, poses[1:], strict=False):
        require_right(motion, before, now)


@pytest.mark.parametrize("turn_deg", [90, 180])
def test_a_prediction_that_moves_all_corners_out_of_the_picture_does_not_change_the_motion(drive, turn_deg):
    poses, pairs = drive
    stereo = StereoMotion(RIG)
    stereo.add(*pairs[0])
    turned = Pose.from_rotvec(np.array([0.0, np.radians(turn_deg), 0.0]), np.zeros(3))
    require_right(stereo.add(*pairs[1], turned), poses[0], poses[1])


@pytest.mark.parametrize("gain", [0.5, 2.0])
def test_exposure_does_not_change_the_motion(drive, gain):
    poses, pairs = drive
    stereo = StereoMotion(RIG)
    stereo.add(*pairs[0])
    require_right(stereo.add(*pair(poses[1], 1, gain)), poses[0], poses[1])


def test_black_pictures_noise_and_another_place_give_no_motion(drive):
    poses, pairs = drive
    rng = np.random.default_rng(5)
    black = np.zeros(LENS.shape, np.uint8)
    stereo = StereoMotion(RIG)
    assert stereo.add(black, black) is None
    assert stereo.add(*pairs[0]) is None  # after a failure the next pair is the first
    require_right(stereo.add(*pairs[1]), poses[0], poses[1])
    assert stereo.add(*(rng.integers(0, 255, LENS.shape).astype(np.uint8) for _ in range(2))) is None
    assert stereo.add(*pairs[0]) is None
    assert stereo.add(*pair(camera(5.0, 3.0, 2.0), 3)) is None


def test_the_covariance_of_a_fit_is_that_of_repeated_fits_and_a_third_of_wrong_tracks_does_not_change_it():
    rng = np.random.default_rng(0)
    true = Pose.from_rotvec(np.array([0.02, -0.05, 0.01]), np.array([0.03, 0.1, -0.2]))
    pixels = rng.uniform([0, 40], [LENS.width, LENS.height], (150, 2))
    rays = LENS.directions(pixels)
    depth = 1.25 / (np.sin(np.radians(30)) + rays[:, 1] * np.cos(np.radians(30))) * rng.uniform(0.8, 1.0, 150)
    moved = true.apply(rays * depth[:, None])
    position, disparity, now = LENS.project(moved) - HALF_PIXEL, RIG.disparity(depth), RIG.disparity(moved[:, 2])
    squares = []
    for number in range(60):
        noisy = [values + rng.normal(0, 0.2, values.shape) for values in (disparity, position, now)]
        if number % 2:
            noisy[1][:50] += rng.uniform(5, 20, (50, 2))
        fit = fit_motion(rays, *noisy, RIG, Pose.identity())
        error = true @ fit.now_from_old.inverse()  # small motion after the fitted one
        turn = Rotation.from_matrix(error.rotation).as_rotvec()
        small = np.concatenate([turn, true.translation - fit.now_from_old.translation])
        squares.append(small @ np.linalg.solve(fit.covariance, small) / 6)
    assert np.mean(squares[::2]) == pytest.approx(1 / motion_fit._CORRELATION, rel=0.35)
    assert 0.2 < np.mean(squares[1::2]) * motion_fit._CORRELATION < 1.2  # outliers raise the estimated noise


def test_covariances_of_inverse_and_difference_are_those_of_random_errors():
    rng = np.random.default_rng(2)
    old, new = (Pose.from_rotvec(0.4 * rng.normal(size=3), rng.normal(size=3)) for _ in range(2))
    half = 1e-3 * rng.normal(size=(2, 6, 6))
    covariances = half @ half.transpose(0, 2, 1)
    draws = rng.normal(size=(2, 20_000, 6)) @ half.transpose(0, 2, 1)

    def wrong(pose: Pose, error: np.ndarray) -> Pose:
        return Pose(pose.rotation @ Rotation.from_rotvec(error[:3]).as_matrix(), pose.translation + error[3:])

    differences, inverses = [], []
    relative = old.inverse() @ new
    for first, second in zip(*draws[:, :4000], strict=True):
        found = wrong(old, first).inverse() @ wrong(new, second)
        turn = Rotation.from_matrix(relative.rotation.T @ found.rotation).as_rotvec()
        differences.append(np.concatenate([turn, found.translation - relative.translation]))
        after = Pose(
            Rotation.from_rotvec(second[:3]).as_matrix() @ new.rotation, new.translation + second[3:]
        ).inverse()
        turn = Rotation.from_matrix(new.rotation @ after.rotation).as_rotvec()
        inverses.append(np.concatenate([turn, after.translation - new.inverse().translation]))
    fit = stereo_motion.Fit(new, covariances[1], np.ones(1))
    for found, expected in (
        (differences, stereo_motion._of_difference(relative, old, covariances[1], covariances[0])),
        (inverses, stereo_motion._of_inverse(fit)),
    ):
        np.testing.assert_allclose(np.cov(np.array(found).T), expected, atol=0.08 * np.abs(expected).max())
