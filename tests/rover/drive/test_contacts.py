"""Contacts of the rover with rocks and ground are those of all physics steps, and they stop it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

import mujoco

from polarsim.rover.drive import ride
from polarsim.rover.drive.control import Command
from polarsim.rover.drive.job import DriveJob
from polarsim.rover.drive.mjcf import compile_model
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import RunningDrive
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import Start
from polarsim.rover.drive.trace import CONTACT_COLUMNS, GROUND
from polarsim.rover.soil.law import Soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.surface import PlacedRock, World, bare_world, with_rocks

VIPER = read_vehicle(Path(__file__).parents[3] / "config/viper.yaml")
FIRM = SoilOptions(slip_sinkage=False, step_s=0.002)
CHUNK = 150  # steps per call
BODY_FRONT, BODY_BOTTOM = 0.65, 0.40 - 0.55 / 2 + 0.275  # m: x in base_link, height above level ground before sinking


def flat() -> World:
    return bare_world(np.zeros((121, 221)), 0.02, -1.6, -1.2)


def with_boxes(*boxes: tuple[float, float, float, float], ground: World | None = None) -> World:
    """Return level ground (or `ground`) with boxes of a side at x, y, and a height above the ground."""
    rocks = []
    for number, (x, y, side, height) in enumerate(boxes, 1):
        box = trimesh.creation.box((side, side, 2 * height))
        rocks.append(PlacedRock(4, number, np.asarray(box.vertices) + np.array([x, y, 0.0]), np.asarray(box.faces)))
    return with_rocks(ground or flat(), rocks)


def made(world: World, lunar: Soil, settle_s: float = 0.0, start: Start | None = None) -> Simulation:
    simulation = Simulation(world, VIPER, lunar, FIRM, start)
    if settle_s:
        simulation.advance(settle_s)
    simulation.zero()
    return simulation


def by_mujoco(simulation: Simulation, steps: int) -> dict[tuple[int, str], list[float]]:
    """Return time, duration and impulse by rock and link, from MuJoCo's list of contacts at each step."""
    model, data, found = simulation.model, simulation.data, {}
    ahead, force = mujoco.MjData(model), np.zeros(6)
    for step in range(steps):
        if step % CHUNK == 0:
            simulation._steer(CHUNK * simulation.dt)  # as `advance` does, once for all steps of a call
        simulation._run(1)
        forces = {}
        # After a step the list is that of the next step, so forces are computed for a copy of this state.
        mujoco.mj_copyData(ahead, model, data)
        mujoco.mj_step2(model, ahead)
        for number, contact in enumerate(ahead.contact):
            mujoco.mj_contactForce(model, ahead, number, force)
            bodies = [model.body(int(model.geom_bodyid[geom])).name for geom in contact.geom]
            (rock,) = (int(name.removeprefix("rock")) for name in bodies if name.startswith("rock"))
            (link,) = (name for name in bodies if not name.startswith("rock"))
            forces[rock, link] = forces.get((rock, link), 0.0) + contact.frame.reshape(3, 3).T @ force[:3]
        for key, total in forces.items():
            if not np.linalg.norm(total) > 0:
                continue
            entry = found.setdefault(key, [simulation.time, 0.0, 0.0])
            entry[1] += simulation.dt
            entry[2] += float(np.linalg.norm(total)) * simulation.dt
    return found


def test_all_contacts_are_recorded_for_any_number_of_steps_per_call(lunar):
    """Wheels pass over two small rocks within tenths of a second; a third rock is away from the path."""
    world = with_boxes((0.98, 0.55, 0.03, 0.03), (1.02, 0.66, 0.03, 0.03), (0.3, -1.0, 0.03, 0.03))
    seldom, often = made(world, lunar), made(world, lunar)
    for simulation in (seldom, often):
        simulation.apply(Command(0.3, 0.0))
    for _ in range(12):
        seldom.advance(CHUNK * seldom.dt)
    expected = by_mujoco(often, 12 * CHUNK)
    assert often.data.qpos.tobytes() == seldom.data.qpos.tobytes()
    contacts = seldom.contacts()
    assert tuple(contacts.columns) == CONTACT_COLUMNS
    assert set(contacts["part"]) <= {"tread", "flank"}
    both = contacts.groupby(["rock", "link"]).agg({"time_s": "min", "duration_s": "sum", "impulse_n_s": "sum"})
    assert {rock for rock, _ in both.index} == {0, 1}
    assert set(both.index) == set(expected)
    for key, (time_s, duration_s, impulse) in expected.items():
        assert both.loc[key].tolist() == [
            pytest.approx(time_s, abs=1.5 * FIRM.step_s), pytest.approx(duration_s, abs=2.5 * FIRM.step_s),
            pytest.approx(impulse, rel=0.01),
        ]  # fmt: skip
    assert seldom.rocks_touched_since(0) == {0, 1}
    assert seldom.rocks_touched_since(seldom.steps) == frozenset()


def test_the_body_stops_at_a_rock_that_is_higher_than_its_bottom(lunar):
    distance = 0.3
    simulation = made(with_boxes((BODY_FRONT + distance + 0.1, 0.0, 0.2, 0.5)), lunar, 0.5)
    simulation.apply(Command(0.3))
    for _ in range(400):
        simulation.advance(0.01)
    state, contacts = simulation.state(), simulation.contacts()
    assert state.position[0] == pytest.approx(distance, abs=0.01)  # nothing passes through the rock
    assert (state.wheel("slip") > 0.9).all()
    assert contacts["part"].tolist() == ["body"]
    assert contacts["link"].tolist() == ["base_link"]
    # At 0.3 m/s, 1.5 s after the acceleration; the impulse is at least the momentum.
    assert contacts["time_s"].item() == pytest.approx(distance / 0.3 + 1.5, abs=0.3)
    assert contacts["impulse_n_s"].item() > 0.5 * 430 * 0.3
    assert simulation.rocks_touched_since(simulation.steps - 1) == {0}


def test_rocks_lower_than_the_body_pass_between_the_wheels(lunar):
    simulation = made(with_boxes((0.8, 0.0, 0.1, BODY_BOTTOM - 0.04)), lunar, 0.5)  # wheels sink by 2 cm
    simulation.apply(Command(0.4))
    for _ in range(350):
        simulation.advance(0.01)
    assert simulation.state().position[0] > 0.45
    assert simulation.contacts().empty


def test_a_leg_touches_a_rock_beside_the_wheel(lunar):
    simulation = made(with_boxes((1.0, 0.42, 0.1, 0.32)), lunar, 0.5)
    simulation.apply(Command(0.3))
    for _ in range(300):
        simulation.advance(0.01)
    assert set(simulation.contacts()["part"]) == {"leg"}
    assert set(simulation.contacts()["link"]) == {"lf_arm"}


def ridge(height: float) -> World:
    """Return a ridge along x between the wheels, which rises to its height over half a metre."""
    bare = flat()
    x, y = np.meshgrid(bare.x, bare.y)
    return replace(bare, level=height * np.clip((x - 0.8) / 0.5, 0, 1) * np.exp(-((y / 0.15) ** 2)))


def test_a_rover_on_a_ridge_is_stuck_with_its_body_on_the_ground(lunar, monkeypatch):
    monkeypatch.setattr(ride, "STUCK_S", 2.0)
    line = DriveOptions(path_m=((-0.5, 0.0), (1.2, 0.0)), speed_m_s=0.4, spread=0)
    ended = []
    for height in (0.30, 0.45):
        running = RunningDrive(DriveJob(ridge(height), VIPER, lunar, line, FIRM, WorldOptions(), 0))
        running.run_for(12.0)
        ended.append(running.ended)
        touched = [(row["rock"], row["part"]) for row in running.trace().drive["contacts"]]
        assert touched == ([] if height < BODY_BOTTOM else [(GROUND, "body")])
    assert ended == ["finished", "stuck"]
    assert running.simulation.state().position[0] > 0.1


def test_body_and_ground_collide_at_the_heights_of_the_world():
    x, y = np.meshgrid(-2 + 0.02 * np.arange(204), -1.2 + 0.02 * np.arange(124))
    world = bare_world(0.2 * np.sin(2 * x) + 0.1 * y * y + 0.1 * y, 0.02, -2.0, -1.2)
    model = compile_model(VIPER, world, [], 1.62, 1e-3)
    data = mujoco.MjData(model)
    data.qpos[2] = 50.0  # the rover is out of the way
    mujoco.mj_forward(model, data)
    points = np.random.default_rng(0).uniform([-1.95, -1.15], [1.95, 1.1], (50, 2))
    down, hit = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
    heights = [5 - mujoco.mj_ray(model, data, np.array([*point, 5.0]), down, None, 1, -1, hit) for point in points]
    np.testing.assert_allclose(heights, world.height_at(*points.T), atol=6e-4)  # triangles of 6 cm
