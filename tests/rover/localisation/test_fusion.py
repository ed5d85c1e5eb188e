"""Consistency and invariances of the filter on drives that follow its own model."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from polarsim.geometry.poses import Pose, camera_pose
from polarsim.rover.localisation import sensors
from polarsim.rover.localisation.fusion import (
    ATTITUDE,
    GRAVITY_SD,
    GYRO,
    POSITION,
    STEP_NOISE,
    WHEEL_S,
    WHEEL_SD,
    PoseFilter,
)
from polarsim.rover.localisation.motion import Motion

G, DT, SECONDS = 1.62, 0.1, 20
CAMERA = camera_pose(np.array([0.7, 0.1, 1.2]), 0.1, 0.3)
MOTION_SD = np.repeat([5e-4, 2e-3], 3)
START = Pose.from_rotvec(np.array([0.05, -0.03, 0.8]), np.array([1.0, 2.0, 0.3]))


@dataclass(frozen=True)
class Step:
    gyro: np.ndarray
    wheels: np.ndarray
    true: Pose
    force: np.ndarray  # with bias and noise


def drive(seed: int, start: Pose = START) -> list[Step]:
    """Return a winding drive over waves, whose biases and wheel errors are random as the filter assumes."""
    rng, pose, steps = np.random.default_rng(seed), start, []
    gyro_bias, force_bias = sensors.GYRO_BIAS * rng.normal(size=3), sensors.ACCELERATION_BIAS * rng.normal(size=3)
    error = WHEEL_SD * rng.normal(size=3)
    for number in range(round(SECONDS / DT)):
        rate = np.array([0.02, 0.03, 0.2]) * np.sin(number * DT * np.array([0.5, 0.7, 0.3]))
        wheels = np.array([0.2, 0.05 * np.sin(0.2 * number * DT)])
        of_error = np.array([[wheels[0], -wheels[1], 0], [wheels[1], wheels[0], 0], [0, 0, wheels[0]]])
        midway = pose.rotation @ Rotation.from_rotvec(rate * DT / 2).as_matrix()
        step = midway @ ([*wheels, 0] + of_error @ error) * DT
        step += STEP_NOISE * np.sqrt(np.hypot(*wheels) * DT) * rng.normal(size=3)
        pose = Pose(midway @ Rotation.from_rotvec(rate * DT / 2).as_matrix(), pose.translation + step)
        gyro = rate + gyro_bias + sensors.GYRO_NOISE / np.sqrt(DT) * rng.normal(size=3)
        force = midway.T @ [0, 0, G] + force_bias + GRAVITY_SD / np.sqrt(DT) * rng.normal(size=3)
        steps.append(Step(gyro, wheels, pose, force))
        gyro_bias = gyro_bias + sensors.GYRO_WALK * np.sqrt(DT) * rng.normal(size=3)
        force_bias = force_bias + sensors.ACCELERATION_WALK * np.sqrt(DT) * rng.normal(size=3)
        kept = np.exp(-DT / WHEEL_S)
        error = kept * error + WHEEL_SD * np.sqrt(1 - kept**2) * rng.normal(size=3)
    return steps


def motions(steps: list[Step], seed: int, start: Pose = START) -> list[Motion]:
    """Return the motion of each second, with noise."""
    rng, before, found = np.random.default_rng(1000 + seed), start @ CAMERA, []
    for step in steps[round(1 / DT) - 1 :: round(1 / DT)]:
        now = step.true @ CAMERA
        true, noise = before.inverse() @ now, MOTION_SD * rng.normal(size=6)
        wrong = Rotation.from_rotvec(noise[:3]).as_matrix().T
        measured = Pose(true.rotation @ wrong, true.translation - noise[3:])
        found.append(Motion(measured, np.diag(MOTION_SD**2), 100))
        before = now
    return found


def run(steps: list[Step], moved: list[Motion] | None = None, start: Pose = START) -> PoseFilter:
    """Return the filter at the end of the steps, with or without motions of the camera."""
    estimate, force, attitude = PoseFilter(start, G), np.zeros(3), np.zeros((3, 3))
    estimate.store_pose()
    each = round(1 / DT)
    for number, step in enumerate(steps, 1):
        midway = estimate.propagate(DT, step.gyro, step.wheels)
        force, attitude = force + midway @ (step.force - estimate.acceleration_bias) / each, attitude + midway / each
        if number % each == 0:
            estimate.correct_tilt(force - [0, 0, G], attitude, at_rest=False)
            force, attitude = np.zeros(3), np.zeros((3, 3))
            if moved is not None:
                assert estimate.correct_by_motion(moved[number // each - 1], CAMERA)
                estimate.store_pose()
    return estimate


@pytest.mark.parametrize("fused", [False, True])
def test_the_normalised_error_is_that_of_the_covariance(fused):
    seeds = range(8)
    drives = [drive(seed) for seed in seeds]
    ends = [run(steps, motions(steps, seed) if fused else None) for steps, seed in zip(drives, seeds, strict=True)]
    errors = [end.normalised_error(steps[-1].true) for end, steps in zip(ends, drives, strict=True)]
    low, high = chi2.ppf([0.005, 0.995], 6 * len(errors))
    assert low < sum(errors) < high
    assert max(errors) < chi2.ppf(0.9999, 6)


def test_motions_of_the_camera_halve_the_error_of_the_wheels():
    steps = [drive(seed) for seed in range(4)]
    errors = []
    for moved in ([None] * 4, [motions(each, seed) for seed, each in enumerate(steps)]):
        ends = [run(each, found) for each, found in zip(steps, moved, strict=True)]
        errors.append(
            np.linalg.norm([end.position - each[-1].true.translation for end, each in zip(ends, steps, strict=True)])
        )
    assert errors[1] < errors[0] / 2


def test_a_drive_in_a_rotated_world_gives_the_rotated_estimate():
    steps = drive(3)
    moved = motions(steps, 3)
    turn = Pose.from_rotvec(np.array([0, 0, 2.1]), np.array([-3.0, 5.0, 1.0]))
    here, there = run(steps, moved), run(steps, moved, turn @ START)
    np.testing.assert_allclose((turn @ here.pose).matrix, there.pose.matrix, atol=1e-9)
    for part in (ATTITUDE, POSITION):
        rotated = turn.rotation @ here.covariance[part, part] @ turn.rotation.T
        np.testing.assert_allclose(rotated, there.covariance[part, part], rtol=1e-6, atol=1e-12)


def test_a_motion_that_contradicts_the_wheels_is_rejected():
    steps = drive(0)[: round(1 / DT)]
    (true,) = motions(steps, 0)
    wrong = replace(true, before_from_now=Pose(true.before_from_now.rotation, true.before_from_now.translation + 0.3))
    estimate = run(steps)
    before = estimate.pose.matrix.copy()
    assert not estimate.correct_by_motion(wrong, CAMERA)
    assert estimate.rejected == 1
    np.testing.assert_array_equal(estimate.pose.matrix, before)
    assert estimate.correct_by_motion(true, CAMERA)


def test_a_slide_with_the_rotation_of_the_gyroscope_is_followed_and_another_rotation_is_not():
    steps = drive(0)[: round(1 / DT)]
    (true,) = motions(steps, 0)
    slide = np.array([0.0, 0.05, 0.15])  # to the front of the camera, without turning wheels
    slid = replace(true, before_from_now=Pose(true.before_from_now.rotation, true.before_from_now.translation + slide))
    estimate, without = run(steps), run(steps).pose.translation
    assert estimate.correct_by_motion(slid, CAMERA)
    assert np.linalg.norm(estimate.pose.translation - without) == pytest.approx(np.linalg.norm(slide), abs=0.02)
    turn = Pose.from_rotvec(np.array([0.0, 0.02, 0.0]), np.zeros(3))  # rad; the gyroscope is right to 1e-4
    other, estimate = replace(slid, before_from_now=slid.before_from_now @ turn), run(steps)
    assert not estimate.correct_by_motion(other, CAMERA)
    assert estimate.rejected == 1


def test_motions_reveal_a_slip_that_the_wheels_do_not_know():
    steps = drive(1)
    estimate = run(steps, motions(steps, 1))
    alone = run(steps)
    assert np.diag(estimate.covariance)[POSITION].max() < np.diag(alone.covariance)[POSITION].max() / 10
    assert alone.wheel_error == pytest.approx([0, 0, 0])
    assert abs(estimate.wheel_error[0]) > 0


def test_standing_reveals_the_bias_of_the_gyroscope_and_gravity_the_tilt():
    estimate = PoseFilter(START, G)
    estimate.covariance[ATTITUDE, ATTITUDE] = 0.02**2 * np.eye(3)
    estimate.covariance[GYRO, GYRO] = 0.01**2 * np.eye(3)
    tilt = Rotation.from_rotvec([0.01, -0.02, 0.0]).as_matrix()
    true, bias = tilt @ START.rotation, np.array([0.003, -0.002, 0.001])
    for _ in range(5):
        attitude = estimate.propagate(1.0, bias, np.zeros(2))
        estimate.correct_gyro_bias(bias, 1.0)
        estimate.correct_tilt(attitude @ true.T @ [0, 0, G] - [0, 0, G], attitude, at_rest=True)
    np.testing.assert_allclose(estimate.gyro_bias, bias, atol=1e-4)
    np.testing.assert_allclose(estimate.rotation[2], true[2], atol=1e-3)
