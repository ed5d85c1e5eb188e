"""Errors of trajectories: equal to those of evo, and known for constructed drifts."""

from copy import deepcopy

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from polarsim.errors import FormatError
from polarsim.geometry.poses import Pose
from polarsim.geometry.trajectories import (
    POSE_COLUMNS,
    Trajectory,
    absolute_error,
    consecutive,
    motion_errors,
    steps_along,
    trajectory_errors,
)


def wandering(seed: int, count: int = 30) -> Trajectory:
    rng = np.random.default_rng(seed)
    rotations = Rotation.from_rotvec(0.3 * rng.normal(size=(count, 3)))
    return Trajectory(np.arange(count, dtype=float), rng.normal(size=(count, 3)).cumsum(axis=0) / 3, rotations)


def straight(metres: float, count: int = 61) -> Trajectory:
    positions = np.zeros((count, 3))
    positions[:, 0] = np.linspace(0, metres, count)
    return Trajectory(np.arange(count, dtype=float), positions, Rotation.identity(count))


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_errors_equal_those_of_evo(seed):
    metrics = pytest.importorskip("evo.core.metrics", reason="evo is not installed")
    estimated, true = wandering(seed), wandering(seed + 5000)
    theirs, reference = (_evo(part) for part in (estimated, true))

    def error(metric, path):
        metric.process_data((reference, path))
        return metric.get_statistic(metrics.StatisticsType.rmse), metric.get_statistic(metrics.StatisticsType.mean)

    translation, angle = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad
    by_frame = [error(metrics.RPE(kind, 1, metrics.Unit.frames), theirs)[0] for kind in (translation, angle)]
    np.testing.assert_allclose(motion_errors(estimated, true, consecutive(30)), by_frame)
    per_metre = [
        error(metrics.RPE(kind, 1.0, metrics.Unit.meters, pairs_from_reference=True), theirs)[0]
        for kind in (translation, angle)
    ]
    from_start, fitted = deepcopy(theirs), deepcopy(theirs)
    from_start.align_origin(reference)
    fitted.align(reference)
    rms, mean = error(metrics.APE(translation), from_start)
    found = trajectory_errors(estimated, true)
    np.testing.assert_allclose(
        [found.rms, found.mean, found.rms_aligned, found.relative, found.relative_angle, found.path],
        [rms, mean, error(metrics.APE(translation), fitted)[0], *per_metre, reference.path_length],
    )


def test_a_scale_of_one_percent_is_one_percent_of_the_path_at_the_end_and_of_each_metre():
    true = straight(60.0)
    estimated = Trajectory(true.times, 1.01 * true.positions, true.rotations)
    errors = trajectory_errors(estimated, true)
    np.testing.assert_allclose([errors.path, errors.end, errors.mean, errors.relative], [60, 0.6, 0.3, 0.01])
    assert errors.relative_angle == 0


def test_a_turned_start_is_removed_by_both_alignments_but_a_turn_on_the_way_is_not():
    true = wandering(3)
    turned = true.moved(Pose.from_rotvec(np.array([0.1, -0.2, 0.5]), np.array([3.0, 1.0, -2.0])))
    errors = trajectory_errors(turned, true)
    np.testing.assert_allclose([errors.end, errors.rms, errors.rms_aligned, errors.relative], 0, atol=1e-6)
    bent = straight(10.0)
    ramp = np.column_stack([np.cos(0.1) * bent.positions[:, 0], np.sin(0.1) * bent.positions[:, 0], 0 * bent.times])
    errors = trajectory_errors(Trajectory(bent.times, ramp, bent.rotations), bent)
    assert errors.end == pytest.approx(20 * np.sin(0.05))
    assert errors.rms_aligned == pytest.approx(0, abs=1e-9)


def test_positions_on_a_line_have_an_alignment():
    """Most drives are nearly straight; evo refuses the alignment of a line."""
    on_a_line = np.linspace([0.0, 0, 0], [3.0, 0, 0], 8)
    pose = Pose.from_rotvec(np.array([0.3, 0.2, -0.9]), np.array([1.0, 2.0, 3.0]))
    assert absolute_error(pose.apply(on_a_line), on_a_line) < 1e-12


def test_a_path_shorter_than_a_step_has_no_relative_error():
    assert len(steps_along(straight(0.9), 1.0)) == 0
    errors = trajectory_errors(straight(0.9), straight(0.9))
    assert np.isnan(errors.relative)
    assert errors.end == 0


def test_interpolated_poses_lie_between_the_poses_of_the_table():
    table = pd.DataFrame([(0.0, 0, 0, 0, 1, 0, 0, 0), (2.0, 4, 0, 2, 0, 0, 0, 1)], columns=list(POSE_COLUMNS))
    middle = Trajectory.from_table(table).at(np.array([1.0]))
    np.testing.assert_allclose(middle.positions, [[2, 0, 1]])
    np.testing.assert_allclose(middle.pose(0).rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    with pytest.raises(FormatError, match="outside"):
        Trajectory.from_table(table).at(np.array([2.1]))
    for wrong in (table.assign(time_s=0.0), table.assign(x_m=np.nan), table.iloc[:1]):
        with pytest.raises(FormatError):
            Trajectory.from_table(wrong)


def _evo(trajectory: Trajectory):
    from evo.core.trajectory import PosePath3D

    return PosePath3D(poses_se3=[trajectory.pose(index).matrix for index in range(len(trajectory.times))])
