"""Rocks count as touched where physics has contacts, at every one of its steps."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

from polarsim.geometry.meshes import Mesh
from polarsim.rover.drive.control import Command
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import Start
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.stitch import Terrain, _with_rocks
from polarsim.rover.world.surface import World, bare_world
from tests.rover.made_world import plane

CONFIG = Path(__file__).parents[3] / "config"
VIPER = read_vehicle(CONFIG / "viper.yaml")
FIRM = SoilOptions(slip_sinkage=False, step_s=0.002)
CHUNK = 150  # steps of one call


def pebbles() -> World:
    """Level ground with small rocks before the left wheels, which pass over them within tenths of a second, and one
    that is never met.
    """
    level = np.zeros((121, 161))
    places = [(0.98, 0.55), (1.02, 0.66), (0.3, -1.0)]
    rocks = {}
    for number, (x, y) in enumerate(places, 1):
        box = trimesh.creation.box((0.03, 0.03, 0.06))
        rocks[number] = Mesh(np.asarray(box.vertices) + np.array([x, y, 0.0]), np.asarray(box.faces))
    ground = bare_world(level, 0.02, -1.6, -1.2)
    return _with_rocks(ground, [Terrain(4, plane(0.0), rocks)], WorldOptions(terrains=(4,)))


def made() -> Simulation:
    simulation = Simulation(
        pebbles(), VIPER, read_soil(CONFIG / "soils.csv", "lunar"), FIRM, Start(0.0, 0.0, 0.0)
    )  # fmt: skip
    simulation.zero()
    return simulation


def by_mujoco(simulation: Simulation, steps: int) -> dict[int, float]:
    """Times of the first contact of each rock, from MuJoCo's own list after each step."""
    model, found = simulation.model, {}
    rims = {model.geom(f"{code}_rim").id for code in ("lf", "rf", "lr", "rr")}
    for step in range(steps):
        if step % CHUNK == 0:
            simulation._steer(CHUNK * simulation.dt)  # as `advance` does, once for all its steps
        simulation._run(1)
        for contact in simulation.data.contact:
            geoms = {int(contact.geom1), int(contact.geom2)}
            if geoms & rims and not contact.exclude:
                (rock,) = geoms - rims
                name = model.body(int(model.geom_bodyid[rock])).name
                found.setdefault(int(name.removeprefix("rock")), simulation.time)
    return found


def test_every_contact_of_physics_counts_however_short_and_however_seldom_it_is_asked_for():
    seldom, often = made(), made()
    for simulation in (seldom, often):
        simulation.apply(Command(0.3, 0.0))
    for _ in range(12):
        seldom.advance(CHUNK * seldom.dt)
    expected = by_mujoco(often, 12 * CHUNK)
    assert often.data.qpos.tobytes() == seldom.data.qpos.tobytes()
    found = seldom.wheel_contacts()
    assert dict(found.groupby("rock")["time_s"].min()) == pytest.approx(expected, abs=1.5 * FIRM.step_s)
    assert len(expected) == 2
    assert seldom.rocks_touched_since(0) == frozenset(expected)
    assert seldom.rocks_touched_since(seldom.steps) == frozenset()
    assert set(found["part"]) <= {"tread", "flank"}


def test_a_state_that_is_saved_with_brakes_on_goes_on_to_the_same_bytes(tmp_path):
    """Brakes act in the half of a step that comes before the state is saved."""
    one, other = made(), made()
    one.apply(Command(0.2, 0.1))
    one.advance(0.3)
    one.apply(Command())
    for _ in range(40):
        one.advance(0.02)
    assert one.model.dof_frictionloss[8] > 0
    one.save(tmp_path / "state.npz")
    other.restore(tmp_path / "state.npz")
    for simulation in (one, other):
        simulation.advance(0.02)
    assert one.data.qvel.tobytes() == other.data.qvel.tobytes()
    assert one.data.qfrc_constraint.tobytes() == other.data.qfrc_constraint.tobytes()
    assert one.wheel_contacts().equals(other.wheel_contacts())
    assert math.isclose(one.time, other.time)
