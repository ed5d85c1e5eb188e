"""Files of a drive."""

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.rover.drive.trace import COLUMNS, LevelChanges, Trace, read_trace, trace_table, write_trace
from polarsim.rover.world.surface import bare_world, write_world

BASE = [COLUMNS.index(name) for name in ("qw", "lf_qw", "rf_qw", "lr_qw", "rr_qw")]


def small_trace() -> Trace:
    """Two seconds along +x at 0.5 m/s with a quarter turn to the left; a cell sinks in each of two frames."""
    rows = np.zeros((3, len(COLUMNS)))
    rows[:, COLUMNS.index("time_s")] = [0, 1, 2]
    rows[:, COLUMNS.index("x_m")] = [0, 0.5, 1]
    rows[:, BASE] = 1
    rows[2, COLUMNS.index("qw")] = rows[2, COLUMNS.index("qz")] = np.sqrt(0.5)
    rows[:, COLUMNS.index("rf_contact")] = [0, 1, 3]
    tracks = LevelChanges(
        np.array([0.0, 1.0]), np.array([0, 1, 3]), np.array([1, 1, 5]), np.float32([-0.01, -0.02, 0.01])
    )
    return Trace(trace_table(rows), bare_world(np.zeros((3, 4)), 0.1, -1.0, 2.0), tracks, {"ended": "finished"})


def test_a_drive_reads_back_and_has_equal_bytes(tmp_path):
    trace = small_trace()
    write_trace(tmp_path / "one", trace)
    again = read_trace(tmp_path / "one")
    assert again.table.equals(trace.table)
    assert again.drive == trace.drive
    np.testing.assert_array_equal(again.world.level, trace.world.level)
    np.testing.assert_array_equal(again.tracks.level, trace.tracks.level)
    assert list(again.table["rf_contact"]) == ["none", "soil", "both"]
    write_trace(tmp_path / "two", again)
    for path in (p for p in (tmp_path / "one").rglob("*") if p.is_file()):
        assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes()


def test_the_ground_changes_frame_by_frame():
    trace = small_trace()
    level = trace.world.level.copy()
    for frame, changed in enumerate(({1: -0.01}, {1: -0.02, 5: 0.01})):
        trace.tracks.apply(frame, level)
        np.testing.assert_allclose(level.ravel(), [changed.get(cell, 0.0) for cell in range(12)], atol=1e-8)
    assert (trace.world.level == 0).all()


def test_poses_are_interpolated_between_logged_times():
    pose = small_trace().pose_at(1.5)
    np.testing.assert_allclose(pose.translation, [0.75, 0, 0])
    # Halfway through a quarter turn to the left, the heading is north-east.
    np.testing.assert_allclose(pose.rotation[:, 0], [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-12)


@pytest.mark.parametrize("name", ["trace.parquet", "tracks.npz", "drive.json", "world/ground.npz", "world/rocks.npz"])
def test_the_error_of_a_broken_file_has_its_path(tmp_path, name):
    write_trace(tmp_path, small_trace())
    (tmp_path / name).write_bytes(b"nothing")
    with pytest.raises(FormatError, match=name):
        read_trace(tmp_path)


def test_tracks_of_another_ground_are_an_error(tmp_path):
    write_trace(tmp_path, small_trace())
    write_world(tmp_path / "world", bare_world(np.zeros((2, 2)), 0.1, 0.0, 0.0))
    with pytest.raises(FormatError, match=r"tracks\.npz"):
        read_trace(tmp_path)
