"""Contacts of rocks are those of all physics steps."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

from polarsim.rover.drive.control import Command
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.soil.law import Soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.surface import PlacedRock, World, bare_world, with_rocks

VIPER = read_vehicle(Path(__file__).parents[3] / "config/viper.yaml")
FIRM = SoilOptions(slip_sinkage=False, step_s=0.002)
CHUNK = 150  # steps per call


def pebbles() -> World:
    """Return level ground with small rocks in front of the left wheels, and a rock away from the path.

    The wheels pass over each rock within tenths of a second.
    """
    rocks = []
    for number, (x, y) in enumerate([(0.98, 0.55), (1.02, 0.66), (0.3, -1.0)], 1):
        box = trimesh.creation.box((0.03, 0.03, 0.06))
        rocks.append(PlacedRock(4, number, np.asarray(box.vertices) + np.array([x, y, 0.0]), np.asarray(box.faces)))
    return with_rocks(bare_world(np.zeros((121, 161)), 0.02, -1.6, -1.2), rocks)


def made(lunar: Soil) -> Simulation:
    simulation = Simulation(pebbles(), VIPER, lunar, FIRM)
    simulation.zero()
    return simulation


def by_mujoco(simulation: Simulation, steps: int) -> dict[int, float]:
    """Return the times of the first contact of each rock, from MuJoCo's list after each step."""
    model, times = simulation.model, {}
    rims = {model.geom(f"{code}_rim").id for code in ("lf", "rf", "lr", "rr")}
    for step in range(steps):
        if step % CHUNK == 0:
            simulation._steer(CHUNK * simulation.dt)  # as `advance` does, once for all steps of a call
        simulation._run(1)
        for contact in simulation.data.contact:
            geoms = {int(contact.geom1), int(contact.geom2)}
            if geoms & rims and not contact.exclude:
                (rock,) = geoms - rims
                name = model.body(int(model.geom_bodyid[rock])).name
                times.setdefault(int(name.removeprefix("rock")), simulation.time)
    return times


def test_all_contacts_are_counted_for_any_number_of_steps_per_call(lunar):
    seldom, often = made(lunar), made(lunar)
    for simulation in (seldom, often):
        simulation.apply(Command(0.3, 0.0))
    for _ in range(12):
        seldom.advance(CHUNK * seldom.dt)
    expected = by_mujoco(often, 12 * CHUNK)
    assert often.data.qpos.tobytes() == seldom.data.qpos.tobytes()
    contacts = seldom.wheel_contacts()
    assert dict(contacts.groupby("rock")["time_s"].min()) == pytest.approx(expected, abs=1.5 * FIRM.step_s)
    assert len(expected) == 2
    assert seldom.rocks_touched_since(0) == frozenset(expected)
    assert seldom.rocks_touched_since(seldom.steps) == frozenset()
    assert set(contacts["part"]) <= {"tread", "flank"}
