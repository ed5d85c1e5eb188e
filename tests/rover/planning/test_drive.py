"""Autonomous drives around two boxes on flat ground, from pictures to wheels."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import trimesh
from PIL import Image
from scipy import ndimage

pytest.importorskip("mujoco", reason="mujoco is not installed")

from polarsim.geometry.poses import Pose
from polarsim.report.figures.autonomy_maps import picture_times, shown_pictures
from polarsim.rover.cameras.options import PACKAGED_FILES, CameraSuiteOptions, ImagingCondition, lights_ahead
from polarsim.rover.drive import ride as ride_module
from polarsim.rover.drive.job import DriveJob
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import RunningDrive
from polarsim.rover.localisation.localiser import ESTIMATE_COLUMNS
from polarsim.rover.localisation.motion import Motion
from polarsim.rover.localisation.sensors import SENSOR_COLUMNS
from polarsim.rover.perception.ground_view import ground_below
from polarsim.rover.perception.hazard_grid import PARTS, HazardGrid
from polarsim.rover.perception.observation import MAX_PAN_RAD, Observation, Perception
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.planning import drive as drive_module
from polarsim.rover.planning.drive import PICTURES, WIDTH_PX, autonomous_job, run_autonomous_drive, write_outcome
from polarsim.rover.planning.metrics import drive_metrics, event_table
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.pilot import Pilot
from polarsim.rover.planning.planner import Planner
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.mounts import pose_of_quaternion
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.surface import ROCK_COLUMNS, bare_world
from polarsim.schemas.rover import AUTONOMY_EVENTS, LOST_MOTIONS, REJECTED_MOTIONS
from tests.rover import driven

OPTIONS = AutonomyOptions(speed_m_s=0.4, longest_s=40)
CAMERAS = CameraSuiteOptions(scale=0.25)
BOXES = ((3.6, 0.6), (3.9, -0.6))  # in the path of the left and right wheels


@pytest.fixture(scope="module")
def job() -> DriveJob:
    relief = ndimage.gaussian_filter(np.random.default_rng(0).normal(size=(101, 151)), 1.0)  # texture for stereo
    bare = bare_world(0.006 * relief / relief.std(), 0.06, -1.5, -3.0)
    rows, vertices, faces = [], [], []
    for number, (x, y) in enumerate(BOXES):
        box = trimesh.creation.box((0.24, 0.24, 0.30))
        vertices.append(np.asarray(box.vertices) + np.array([x, y, 0.05]))
        faces.append(np.asarray(box.faces) + 8 * number)
        rows.append((number, 1, number, x, y, 0.20, 0.34, 0.17, 12 * number, 12))
    world = replace(
        bare,
        rocks=pd.DataFrame(rows, columns=list(ROCK_COLUMNS)),
        vertices=np.concatenate(vertices).astype(np.float32),
        triangles=np.concatenate(faces).astype(np.int32),
    )
    line = DriveOptions(path_m=((0.0, 0.0), (5.8, 0.0)))
    soil = SoilOptions(slip_sinkage=False, step_s=0.002)
    return DriveJob(world, read_vehicle(line.vehicle), read_soil(soil.table, soil.soil), line, soil, WorldOptions(), 0)


@pytest.fixture(scope="module")
def moment(job) -> tuple[RunningDrive, Callable[..., Observation]]:
    """Return a ride at the start, and a function that returns the stereo observation there in a light."""
    ride = RunningDrive(autonomous_job(job, OPTIONS))
    ride.run_for(0.1)
    state, level = ride.simulation.state(), ride.simulation.ground.level

    def observe(light: ImagingCondition, threads: int = 1, mode: str = "stereo", **options: float) -> Observation:
        perception = Perception(
            job.world, job.vehicle, ride.route, mode, light, CAMERAS, 0,
            render=driven.RENDER, threads=threads, detector=OnboardDetector(weights=PACKAGED_FILES["packaged_rover"]),
        )  # fmt: skip
        return perception.observe(state, level, HazardGrid(job.world), **options)

    return ride, observe


def value(rows: pd.DataFrame, metric: str) -> float:
    return float(rows.loc[rows["metric"] == metric, "value"].iloc[0])


def test_contacts_of_a_wheel_are_as_deep_as_it_overlaps_the_edge_of_a_rock(job, rng):
    import mujoco

    simulation = RunningDrive(autonomous_job(job, OPTIONS)).simulation
    model, data = simulation.model, simulation.data
    rim = model.geom("lf_rim").id
    meshes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    start, wheel = data.qpos[:3].copy(), data.geom_xpos[rim].copy()
    depths = []
    for _ in range(200):
        front_edge = np.array([BOXES[0][0] - 0.12, BOXES[0][1], 0.2])
        aside = rng.uniform([-0.26, -0.1, 0.1], [-0.05, 0.1, 0.26])
        data.qpos[:3] = start + front_edge + aside - wheel
        mujoco.mj_forward(model, data)
        depth = -min(mujoco.mj_geomDistance(model, data, rim, mesh, 1.0, None) for mesh in meshes)
        touching = [-contact.dist for contact in data.contact if {rim} < {*contact.geom.tolist()} <= {rim, *meshes}]
        assert max(touching, default=0.0) == pytest.approx(max(depth, 0.0), abs=5e-4)
        depths.append(depth)
    assert np.sum(np.array(depths) > 0.002) > 20


@pytest.mark.slow
def test_a_drive_by_labels_avoids_rocks_that_a_blind_drive_hits(job):
    blind = run_autonomous_drive(job, "blind", ImagingCondition("3", 256), OPTIONS, CAMERAS, render=driven.RENDER)
    rows = drive_metrics(blind, job.vehicle, OPTIONS)
    assert value(rows, "collisions") == value(rows, "collisions of wheels") == 2
    assert value(rows, "collisions of legs") == value(rows, "collisions of the body") == 0
    assert abs(value(rows, "closest pass of a rock above 10 cm")) < 0.005
    hits = event_table(blind)
    assert tuple(hits.columns) == AUTONOMY_EVENTS.columns
    assert set(hits["what"]) == {"collision"}
    assert set(hits["part"]) <= {"tread", "flank"}
    assert sorted(set(zip(hits["x_m"], hits["y_m"], strict=True))) == sorted(BOXES)
    assert hits["time_s"].is_monotonic_increasing
    assert (hits.groupby("rock")["impulse_n_s"].sum() > 5).all()  # a single part may only brush a rock
    assert (hits["duration_s"] > 0).all()
    outcome = run_autonomous_drive(job, "truth", ImagingCondition("3", 256), OPTIONS, CAMERAS, render=driven.RENDER)
    rows = drive_metrics(outcome, job.vehicle, OPTIONS)
    assert value(rows, "success") == 1
    assert value(rows, "collisions") == 0
    assert value(rows, "closest pass of a rock above 10 cm") > 0.02
    assert value(rows, "rock map") > 270
    assert value(rows, "geometric map") > 285


def test_equal_drives_write_equal_bytes(job, tmp_path):
    brief = OPTIONS.model_copy(update={"longest_s": 2.0})
    for name in ("a", "b"):
        outcome = run_autonomous_drive(
            job, "truth", ImagingCondition("3", 256), brief, CAMERAS, render=driven.RENDER, pose="odometry"
        )
        write_outcome(tmp_path / name, outcome, brief)
    files = sorted(path.relative_to(tmp_path / "a") for path in (tmp_path / "a").rglob("*") if path.is_file())
    assert len(files) == 9
    for file in files:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes(), file


def test_a_rover_on_odometry_drives_to_where_it_believes_the_goal(job):
    short = replace(job, drive=job.drive.model_copy(update={"path_m": ((0.0, 0.0), (1.6, 0.0))}))
    outcome = run_autonomous_drive(
        short, "blind", ImagingCondition("3", 256), OPTIONS, CAMERAS, render=driven.RENDER, pose="odometry"
    )
    estimate, readings, true = outcome.localiser.estimate(), outcome.localiser.readings(), outcome.trace.table
    assert tuple(estimate) == ESTIMATE_COLUMNS
    assert tuple(readings) == SENSOR_COLUMNS
    assert np.diff(readings["time_s"]) == pytest.approx(0.01)
    np.testing.assert_array_equal(estimate["time_s"], true["time_s"])
    rows = drive_metrics(outcome, short.vehicle, OPTIONS)
    places = [table[["x_m", "y_m", "z_m"]].to_numpy() for table in (estimate, true)]
    end = np.linalg.norm((places[0] - places[0][0] - places[1] + places[1][0])[-1])  # aligned at the start
    assert value(rows, "position error at the end") == pytest.approx(end, abs=1e-3)
    assert value(rows, "position error at the end, of the path") == pytest.approx(100 * end / 1.6, rel=0.3)  # %
    assert not set(rows["metric"]) & {LOST_MOTIONS, REJECTED_MOTIONS}  # no camera
    start, end = estimate.iloc[0], estimate.iloc[-1]
    assert start[["x_m", "y_m", "z_m"]].tolist() == true.iloc[0][["x_m", "y_m", "z_m"]].tolist()
    assert outcome.trace.drive["ended"] == "finished"
    assert 1.6 - OPTIONS.speed_m_s * 0.05 <= end["x_m"] < 1.6  # last row, a row every 0.05 s
    slipped = end["x_m"] - true["x_m"].iloc[-1]
    assert 0.02 < slipped < 3 * end["x_sd_m"]
    error = np.abs(estimate[["y_m", "z_m"]] - true[["y_m", "z_m"]]).iloc[-1]
    assert (error < 3 * end[["y_sd_m", "z_sd_m"]].to_numpy(float)).all()


def test_lost_and_rejected_stereo_motions_are_counted_from_the_second_pair_on(job, monkeypatch):
    wrong = Pose.from_rotvec(np.array([0.0, 0.5, 0.0]), np.zeros(3))  # of the camera, rad

    class StereoWithFaults:
        def __init__(self, rig):
            self.pairs = 0

        def add(self, left, right, predicted=None):
            self.pairs += 1
            motions = {2: None, 3: wrong, 4: predicted, 5: None}
            found = motions.get(self.pairs)
            return None if found is None else Motion(found, 1e-6 * np.eye(6), 100)

    monkeypatch.setattr(drive_module, "StereoMotion", StereoWithFaults)
    brief = OPTIONS.model_copy(update={"longest_s": 4.5})
    outcome = run_autonomous_drive(
        job, "truth", ImagingCondition("3", 256), brief, CAMERAS, render=driven.RENDER, pose="fused"
    )
    assert outcome.localiser.stereo.pairs == 5
    assert outcome.pilot.observations[0][1].shown is not None  # pictures for the pose are stored
    rows = drive_metrics(outcome, job.vehicle, brief)
    assert value(rows, LOST_MOTIONS) == 2
    assert value(rows, REJECTED_MOTIONS) == 1


def test_a_map_lies_where_the_rover_believes_itself(job):
    ride = RunningDrive(autonomous_job(job, OPTIONS))
    ride.run_for(0.1)
    state, grid = ride.simulation.state(), HazardGrid(job.world)
    perception = Perception(
        job.world, job.vehicle, ride.route, "truth", ImagingCondition("3", 256), CAMERAS, 0, render=driven.RENDER
    )
    moved = Pose(np.eye(3), np.array([-2 * grid.cell_m, grid.cell_m, 0.05]))  # by cells, and upwards
    believed = SimpleNamespace(pose=moved @ pose_of_quaternion(state.position, state.rotation))
    here, there = (
        perception.observe(state, ride.simulation.ground.level, grid, localiser).updates[0]
        for localiser in (None, believed)
    )
    expected, found = here.rock[:-1, 2:], there.rock[1:, :-2]
    assert (expected > 0).sum() >= 6
    assert (found != expected).mean() < 0.01  # cells whose border a pixel crosses by rounding
    same = (found > 0) & (expected > 0)
    np.testing.assert_allclose(there.height[1:, :-2][same], here.height[:-1, 2:][same], atol=0.01)  # above the ground
    rise = there.surface[PARTS:, : -2 * PARTS] - here.surface[:-PARTS, 2 * PARTS :]
    assert np.nanmedian(rise) == pytest.approx(0.05)


@pytest.mark.parametrize(("torque_n_m", "ended"), [(None, "out of time"), (1.0, "stuck")])
def test_a_path_across_the_line_is_progress_and_spinning_in_place_is_not(job, monkeypatch, torque_n_m, ended):
    monkeypatch.setattr(ride_module, "STUCK_S", 2.0)
    across = np.column_stack([np.full(27, 1.2), np.linspace(0, 2.6, 27), np.full(27, np.pi / 2)])
    monkeypatch.setattr(Planner, "plan", lambda *_: across)
    monkeypatch.setattr(Pilot, "_still_free", lambda *_: None)
    motors = job.vehicle.drive.model_copy(update={"torque_limit_n_m": torque_n_m} if torque_n_m else {})
    slow = replace(job, vehicle=job.vehicle.model_copy(update={"drive": motors}))
    brief = OPTIONS.model_copy(update={"longest_s": 11.0})
    outcome = run_autonomous_drive(slow, "truth", ImagingCondition("3", 256), brief, CAMERAS, render=driven.RENDER)
    assert outcome.trace.drive["ended"] == ended
    if torque_n_m is None:
        late = outcome.trace.table[outcome.trace.table["time_s"] > 8]
        assert np.ptp(late["y_m"]) > 0.6
        assert np.ptp(late["x_m"]) < 0.2


@pytest.mark.slow
def test_stereo_maps_the_boxes_and_finds_the_pose_of_the_rover(job, tmp_path):
    short = replace(job, drive=job.drive.model_copy(update={"path_m": ((0.0, 0.0), (1.6, 0.0))}))
    outcome = run_autonomous_drive(
        short, "stereo", ImagingCondition("3", "auto"), OPTIONS, CameraSuiteOptions(scale=0.5),
        render=driven.RENDER, pose="fused",
    )  # fmt: skip
    grid = outcome.pilot.grid
    x, y = np.meshgrid(grid.x, grid.y)
    near = np.any([np.hypot(x - bx, y - by) < 0.35 for bx, by in BOXES], axis=0)
    assert (grid.rock & near).sum() >= 4
    assert (grid.rock & ~near).sum() < 0.06 * grid.seen.sum()
    rows = drive_metrics(outcome, job.vehicle, OPTIONS)
    assert value(rows, "odometry: absolute error") < 0.2
    names = ["x_m", "y_m", "z_m"]
    estimate = outcome.localiser.estimate()
    error, sd = estimate[names] - outcome.trace.table[names], estimate[["x_sd_m", "y_sd_m", "z_sd_m"]]
    assert np.abs(error.iloc[-1]).max() < 0.01
    assert (np.abs(error.to_numpy()) < 4 * sd.to_numpy() + 1e-3).all()
    write_outcome(tmp_path, outcome, OPTIONS)
    pictures = picture_times(tmp_path / PICTURES)
    assert list(pictures) == [0.0, 4.0]
    with Image.open(pictures[4.0]) as picture:
        assert picture.width == WIDTH_PX


def test_pictures_before_contacts_have_priority_over_those_before_stops():
    pictures = {float(time_s): Path(f"{time_s}.jpg") for time_s in range(0, 60, 4)}
    happened = [("touch", 11.0), ("stop", 31.0), ("collision", 45.0)]
    found = pd.DataFrame(happened, columns=["what", "time_s"])
    assert list(shown_pictures(pictures, found)) == [24.0, 40.0]
    assert list(shown_pictures(pictures, found.iloc[:0])) == [16.0, 36.0]
    assert list(shown_pictures({0.0: Path("0.jpg")}, found)) == [0.0]
    assert shown_pictures({}, found) == {}


def test_headlights_illuminate_the_ground_at_night_and_noise_in_the_dark_is_not_observed_ground(moment):
    ride, observe = moment
    ahead = lights_ahead(ride.job.vehicle)
    assert set(ahead) == {"navlight_left", "navlight_right", "hazlight_fore_port", "hazlight_fore_starboard"}
    dark, lit = (
        observe(ImagingCondition("night", 1024.0, lights), threads) for lights, threads in (((), 1), (ahead, 3))
    )
    assert lit.pair[0].mean() > dark.pair[0].mean() + 20
    assert dark.pair[0].std() > 0
    assert not (dark.updates[0].weight > 0).any()
    np.testing.assert_array_equal(lit.pair, observe(ImagingCondition("night", 1024.0, ahead)).pair)  # any threads


def test_both_cameras_of_the_stereo_pair_see_the_ground_ahead_of_the_wheels_of_both_sides(job):
    light = ImagingCondition("3", 256.0)
    perception = Perception(job.world, job.vehicle, job.route, "stereo", light, CAMERAS, 0, render=driven.RENDER)
    pair = [mount.at(Pose.identity()) for mount in (perception.left, perception.right)]
    x, y = np.meshgrid(np.linspace(1.0, 5.0, 81), np.linspace(0.0, 2.0, 81))

    def seen(side: int) -> np.ndarray:
        ground = np.stack([x, side * y, np.full(x.shape, ground_below(job.vehicle))], axis=-1)
        return np.all([camera.inside(camera.project(ground)) for camera in pair], axis=0)

    np.testing.assert_array_equal(seen(1), seen(-1))
    wheel = job.vehicle.wheels[0]
    assert seen(1)[(x > 2.9) & (y < wheel.position_m[1] + 0.15)].all()  # the planner's gap of 0.15 m


def test_the_pair_also_looks_to_the_side_to_which_the_path_bends(job, moment):
    _, observe = moment
    grid, light = HazardGrid(job.world), ImagingCondition("3", 256.0)
    ahead = observe(light)
    for side in (1, -1):
        turned = observe(light, pan=side * 0.6)
        same, aside = turned.updates
        np.testing.assert_array_equal(same.weight, ahead.updates[0].weight)
        np.testing.assert_array_equal(turned.pair, ahead.pair)  # the localiser has the pair that looks ahead
        new = (aside.weight > 0) & (same.weight == 0)
        assert new.sum() > 30
        assert (side * grid.y[np.nonzero(new)[0]] > 0.3).mean() > 0.9
        heights = aside.surface[np.isfinite(aside.surface)]
        assert np.median(np.abs(heights)) < 0.02  # the ground, where it is
    assert len(observe(light, pan=0.1).updates) == 1
    for mode in ("detector", "truth"):
        assert len(observe(light, mode=mode, pan=0.6).updates) == 1


def test_the_pair_turns_to_the_plan_and_to_both_sides_at_a_stop(job):
    pilot = Pilot(job.route, perception=None, options=OPTIONS)
    pilot.attach(SimpleNamespace(world=job.world, vehicle=job.vehicle))
    assert pilot._pan(0.0, 0.0, 0.0) == 0
    bend = np.linspace(0, 1.2, 30)
    for side in (1, -1):
        pilot._plan = np.column_stack([4 * np.sin(bend), side * 4 * (1 - np.cos(bend)), side * bend])
        for heading in (0.0, 0.2):
            angle = side * np.arcsin(2.5 / 8)  # of a chord of 2.5 m in a circle of radius 4 m
            assert pilot._pan(0.0, 0.0, heading) == pytest.approx(angle - heading, abs=0.02)
    pilot._plan = None
    angles = []
    for pilot._at_rest in (1, 2):
        angles.append(pilot._pan(0.0, 0.0, 0.0))
    assert sorted(angles) == [-MAX_PAN_RAD, MAX_PAN_RAD]
