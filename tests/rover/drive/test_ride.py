"""Complete short drives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

from polarsim.render.olat import NO_LAMP
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive import energy
from polarsim.rover.drive import job as drive_job
from polarsim.rover.drive import ride as drive
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.job import DriveJob, cut_rocks, require_on_grid
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import drive_to_end, run_drive
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.planning.drive import job_for
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import DemOptions, WorldOptions
from polarsim.rover.world.rock_parts import rock_parts
from polarsim.rover.world.surface import bare_world
from polarsim.run_files.instances import BACKGROUND, ROCK_IDS
from tests.rover.drives import write_meshes

CONFIG = Path(__file__).parents[3] / "config"


def job(seed: int = 0, slope_deg: float = 0.0, physics: SoilOptions | None = None, **drive) -> DriveJob:
    """A drive of half a metre over ground that falls from east to west."""
    x = -2.0 + 0.02 * np.arange(201)
    level = np.tile(np.tan(np.radians(slope_deg)) * -x, (121, 1))
    options = {"path_m": ((0.25, 0.0), (-0.25, 0.0)), "speed_m_s": 0.3} | drive
    return DriveJob(
        bare_world(level, 0.02, -2.0, -1.2),
        read_vehicle(CONFIG / "viper.yaml"),
        read_soil(CONFIG / "soils.csv", "lunar"),
        DriveOptions(**options),
        physics or SoilOptions(),
        WorldOptions(),
        seed,
    )


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    reported: list[float] = []
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(drive, "REPORT_EVERY_S", 0.5)
        drive_to_end(job(), folder, reported.append)
    assert reported == sorted(reported)
    assert reported[-1] == 1.0
    return folder


def test_a_drive_reaches_the_end_and_writes_all_files(whole):
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


def test_tracks_contain_the_ruts_of_the_wheels(whole):
    trace = read_trace(whole)
    level = trace.world.level.copy()
    for frame in range(len(trace.tracks.time)):
        trace.tracks.apply(frame, level)
    behind = np.abs(trace.world.y[:, None] - 0.61) < 0.05
    passed = (trace.world.x > 0.45) & (trace.world.x < 0.55)
    sunk = (trace.world.level - level)[np.ix_(behind[:, 0], passed)]
    assert sunk.mean() > 0.008


def test_a_rover_too_weak_to_move_is_stuck_and_the_tables_are_written(tmp_path, monkeypatch):
    monkeypatch.setattr(drive, "STUCK_S", 2.0)
    strong = job()
    weak = strong.vehicle.model_copy(
        update={"drive": strong.vehicle.drive.model_copy(update={"torque_limit_n_m": 1.0})}
    )
    trace = drive_to_end(replace(strong, vehicle=weak), tmp_path)
    assert trace.drive["ended"] == "stuck"
    assert "cm of headway in the last 2 s" in trace.drive["reason"]
    assert len(read_trace(tmp_path).table) > 100


def test_an_open_energy_balance_ends_a_drive_with_tables(tmp_path, monkeypatch):
    monkeypatch.setattr(energy, "BOUND", 1e-5)
    with pytest.raises(EnergyError):
        drive_to_end(job(), tmp_path)
    assert read_trace(tmp_path).drive["ended"] == "energy"


def test_a_drive_over_an_elevation_model_is_rendered_up_to_the_horizon(tmp_path, monkeypatch):
    """From the meshes of a run to a picture: rocks with the terrain's shapes, and hills up to the horizon."""
    write_meshes(tmp_path / "meshes/Terrain03", 3)
    dem = DemOptions(size_m=10, horizon_m=40, drive_m=2, rocks=0.03, relief_m=0.1)
    world = WorldOptions(terrains=(3,), dem=dem, width_m=3, margin_m=1.5, cell_m=0.04)
    options = DriveOptions(longest_s=0.6, picture_hz=2)
    trace = run_drive(
        meshes=tmp_path / "meshes", folder=tmp_path / "drive", world=world, soil=SoilOptions(), drive=options, seed=0
    )
    assert trace.drive["ended"] == "out of time"
    driven = read_trace(tmp_path / "drive").world
    assert 0 < len(driven.rocks_on_grid) < len(driven.rocks)
    assert set(driven.rocks["terrain"]) == {3}
    monkeypatch.setattr(drive_job, "AHEAD_M", 2.0)
    job = job_for(
        meshes=tmp_path / "meshes", world=world, soil=SoilOptions(), drive=options,
        options=AutonomyOptions(width_m=4.0), seed=0,
    )  # fmt: skip
    assert job.drive.path_m == ((3.0, 0.0), (-3.0, 0.0))
    require_on_grid(job)
    assert np.hypot(job.world.rocks["x_m"] - 3.0, job.world.rocks["y_m"]).min() > 1.5
    suite = CameraSuiteOptions(views=("ncl",), suns=("3",), scale=1 / 32, finer=1)
    shown = CameraSuite(read_trace(tmp_path / "drive"), job.vehicle, suite)
    shown.show(0)
    ids = shown.render("ncl", ["3"]).ids[NO_LAMP]
    sky = (ids == BACKGROUND).sum(axis=0)  # number of sky pixels in each column
    assert sky.min() > 0
    assert np.ptp(sky) > 3
    assert (ids >= ROCK_IDS).sum() > 20


@pytest.mark.parametrize("dem", [None, DemOptions(size_m=10, horizon_m=40, drive_m=2, rocks=0.03)])
def test_drives_with_rocks_cut_once_are_the_same_for_every_seed(tmp_path, dem):
    write_meshes(tmp_path / "meshes/Terrain03", 3)
    world = WorldOptions(terrains=(3,), dem=dem, terrain_m=2, width_m=3, margin_m=1.5, cell_m=0.04)
    options = DriveOptions(longest_s=0.3, picture_hz=2, path_m=((0.4, 0.0), (-0.4, 0.0)))
    given = {"meshes": tmp_path / "meshes", "world": world, "drive": options}
    cut_rocks(**given, parts=tmp_path / "parts.npz", autonomous_width_m=None)
    for seed in (0, 1):
        folders = tmp_path / f"own{seed}", tmp_path / f"cut{seed}"
        for folder, parts in zip(folders, (None, tmp_path / "parts.npz"), strict=True):
            trace = run_drive(**given, folder=folder, soil=SoilOptions(), seed=seed, parts=parts)
        assert trace.drive["rock_shapes"]
        assert files_of(folders[0]) == files_of(folders[1])
    wide, options = tmp_path / "wide.npz", AutonomyOptions(width_m=2.0)
    cut_rocks(**given, parts=wide, autonomous_width_m=options.width_m)
    job = job_for(**given, soil=SoilOptions(), options=options, seed=3, parts=wide)
    assert [part.rock for part in job.rock_parts] == [part.rock for part in rock_parts(job.world)]
