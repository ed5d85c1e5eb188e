"""Whole drives, short ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

from polarsim.rover.drive import ride as drive
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.job import Job
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import STATE, Ride, drive_to_end
from polarsim.rover.drive.state import OffGridError
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.surface import bare_world

CONFIG = Path(__file__).parents[3] / "config"


def job(seed: int = 0, slope_deg: float = 0.0, physics: SoilOptions | None = None, **drive) -> Job:
    """A metre over ground that falls from east to west."""
    x = -2.0 + 0.02 * np.arange(201)
    level = np.tile(np.tan(np.radians(slope_deg)) * -x, (121, 1))
    options = {"path_m": ((0.25, 0.0), (-0.25, 0.0)), "settle_s": 0.5, "speed_m_s": 0.3} | drive
    return Job(
        bare_world(level, 0.02, -2.0, -1.2),
        read_vehicle(CONFIG / "viper.yaml"),
        read_soil(CONFIG / "soils.csv", "lunar"),
        DriveOptions(**options),
        physics or SoilOptions(),
        WorldOptions(),
        seed,
    )


@pytest.fixture(autouse=True)
def often_saved(monkeypatch):
    """A state is saved every half second that is driven, so that short drives have some."""
    monkeypatch.setattr(drive, "SAVE_EVERY_S", 0.5)


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    drive_to_end(job(), folder)
    return folder


def test_a_drive_reaches_its_end_and_leaves_all_its_files(whole):
    trace = read_trace(whole)
    assert trace.drive["ended"] == "finished"
    assert trace.table["x_m"].iloc[-1] == pytest.approx(-0.25, abs=0.005)
    assert abs(trace.drive["energy_open"]) < 0.02
    assert sorted(files_of(whole)) == [
        "drive.json", "trace.parquet", "tracks.npz", "world/ground.npz", "world/rocks.npz", "world/rocks.parquet",
    ]  # fmt: skip
    steps = np.diff(trace.table["time_s"])
    np.testing.assert_allclose(steps, 0.01, atol=1e-9)
    np.testing.assert_allclose(np.diff(trace.tracks.time), 1 / 15, atol=1.1e-3)


def test_tracks_hold_the_ruts_that_the_wheels_left(whole):
    trace = read_trace(whole)
    level = trace.world.level.copy()
    for frame in range(len(trace.tracks.time)):
        trace.tracks.apply(frame, level)
    behind = np.abs(trace.world.y[:, None] - 0.61) < 0.05
    passed = (trace.world.x > 0.45) & (trace.world.x < 0.55)
    sunk = (trace.world.level - level)[np.ix_(behind[:, 0], passed)]
    assert sunk.mean() > 0.008


def test_a_stopped_drive_goes_on_to_the_same_bytes(whole, tmp_path):
    stopped = Ride(job())
    stopped.go_on(0.9)
    assert stopped.ended is None
    stopped.save(tmp_path / STATE)
    drive_to_end(job(), tmp_path)
    assert files_of(tmp_path) == files_of(whole)


def test_a_state_of_another_drive_is_not_gone_on_with(whole, tmp_path):
    other = Ride(job(seed=1))
    other.go_on(0.9)
    other.save(tmp_path / STATE)
    drive_to_end(job(), tmp_path)
    assert files_of(tmp_path) == files_of(whole)


def test_a_state_of_other_code_is_not_gone_on_with(tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(drive, "code_digest", lambda *modules: "of old")
        old = Ride(job())
        old.go_on(0.1)
        old.save(tmp_path / STATE)
    ride = Ride(job())
    ride.resume(tmp_path / STATE)
    assert not ride.rows
    assert not ride.settled


def test_seeds_differ(whole, tmp_path):
    drive_to_end(job(seed=1), tmp_path)
    assert files_of(tmp_path)["trace.parquet"] != files_of(whole)["trace.parquet"]
    assert files_of(tmp_path)["world/ground.npz"] == files_of(whole)["world/ground.npz"]  # the job's world is given


def test_progress_is_told(tmp_path):
    told: list[float] = []
    drive_to_end(job(), tmp_path, told.append)
    assert told == sorted(told)
    assert told[-1] == 1.0


def test_a_rover_too_weak_to_move_is_stuck_and_its_tables_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(drive, "STUCK_S", 2.0)
    strong = job()
    weak = strong.vehicle.model_copy(
        update={"drive": strong.vehicle.drive.model_copy(update={"torque_limit_n_m": 1.0})}
    )
    trace = drive_to_end(replace(strong, vehicle=weak), tmp_path)
    assert trace.drive["ended"] == "stuck"
    assert "cm of headway in the last 2 s" in trace.drive["reason"]
    assert len(read_trace(tmp_path).table) > 100
    assert not (tmp_path / STATE).exists()


def test_a_path_that_leaves_the_grid_is_refused_before_anything_runs(tmp_path):
    with pytest.raises(OffGridError, match=r"the path leaves the ground at \(-1\.05, 0\.00\) m"):
        drive_to_end(job(path_m=((0.25, 0.0), (-1.5, 0.0))), tmp_path)
    assert not list(tmp_path.iterdir())


def test_an_open_energy_balance_ends_a_drive_with_its_tables_written(tmp_path):
    strict = job(physics=SoilOptions(energy_bound=1e-5))
    with pytest.raises(EnergyError, match="of the energy is missing"):
        drive_to_end(strict, tmp_path)
    assert read_trace(tmp_path).drive["ended"] == "energy"
