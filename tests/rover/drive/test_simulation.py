"""Statics and energy of a rover on soft ground."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.ndimage import gaussian_filter

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")

from polarsim.errors import RoverError
from polarsim.rover.drive.control import Command
from polarsim.rover.drive.energy import EnergyError, largest_step
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import OffGridError, Start
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.surface import PlacedRock, bare_world, with_rocks

CONFIG = Path(__file__).parents[3] / "config"
VIPER = read_vehicle(CONFIG / "viper.yaml")


def flat(length: float = 4.0, slope_deg: float = 0.0):
    """Return ground that rises along x, with the centre at x = y = 0."""
    columns, rows = round(length / 0.02) + 1, 121
    x = -length / 2 + 0.02 * np.arange(columns)
    return bare_world(np.tile(math.tan(math.radians(slope_deg)) * x, (rows, 1)), 0.02, -length / 2, -1.2)


def run(simulation: Simulation, seconds: float, command: Command | None = None) -> list:
    """Return the states every 10 ms."""
    if command:
        simulation.apply(command)
    states = []
    for _ in range(round(seconds / 0.01)):
        simulation.advance(0.01)
        states.append(simulation.state())
    return states


@pytest.mark.parametrize(("gravity", "step_s"), [(1.62, 0.001), (9.81, 0.0005)])
def test_at_rest_the_soil_carries_the_weight_with_the_same_sinkage_at_any_gravity(lunar, gravity, step_s):
    last = run(Simulation(flat(), VIPER, lunar, SoilOptions(gravity_m_s2=gravity, step_s=step_s)), 2.5)[-1]
    np.testing.assert_allclose(last.wheel("load_n"), 430 * gravity / 4, rtol=2e-3)
    np.testing.assert_allclose(last.acceleration, [0, 0, gravity], atol=2e-3)
    assert np.abs(last.velocity).max() < 1e-4 * gravity / 1.62
    assert set(last.wheel("contact")) == {1}
    # Bekker's wheel at rest, theta_1 = theta_2, has twice the contact of a rolling wheel, so it sinks less than 17 mm.
    assert (last.wheel("sinkage_first_m") > 0.008).all()
    assert (last.wheel("sinkage_first_m") < 0.017).all()
    tips = [wheel.radius_m + wheel.grouser_height_m for wheel in VIPER.wheels]
    np.testing.assert_allclose(last.wheel("z_m") + last.wheel("sinkage_first_m"), tips, atol=5e-4)


def test_a_rover_lowered_onto_rough_ground_sinks_as_on_level_ground(lunar):
    """Braked wheels that touch down one by one turn by hundredths of a millimetre, without slip sinkage."""
    rng = np.random.default_rng(0)
    bumps = gaussian_filter(rng.normal(size=flat().level.shape), 5.0)
    world = replace(flat(), level=bumps * (0.008 / bumps.std()))
    last = run(Simulation(world, VIPER, lunar, start=Start(0.0, 0.0, math.pi)), 2.0)[-1]
    assert (last.wheel("sinkage_first_m") > 0.008).all()
    assert (last.wheel("sinkage_first_m") < 0.025).all()


def test_a_flat_drive_has_little_ripple_and_closes_the_energy_balance(lunar):
    simulation = Simulation(flat(5.0), VIPER, lunar, start=Start(-1.2))
    run(simulation, 2.0)
    simulation.zero()
    states = run(simulation, 7.0, Command(0.2))
    loads = np.array([state.wheel("load_n") for state in states[300:]])
    assert loads.sum(axis=1).mean() == pytest.approx(430 * 1.62, rel=5e-3)
    assert loads.sum(axis=1).std() / loads.sum(axis=1).mean() <= 0.04
    assert all((state.wheel("contact") == 1).all() for state in states)
    assert abs(simulation.account.open) < 0.003
    assert abs(states[-1].position[1]) < 0.002
    slips = np.mean([state.wheel("slip") for state in states[400:]], axis=0)
    assert (slips > 0).all()
    assert (slips < 0.12).all()


def test_a_rover_without_grousers_slips_on_a_slope_that_one_with_grousers_climbs(lunar):
    bare = {"grousers": 0, "grouser_height_m": 0.0}
    smooth = VIPER.model_copy(update={"wheels": [wheel.model_copy(update=bare) for wheel in VIPER.wheels]})
    climbed = []
    for vehicle in (VIPER, smooth):
        simulation = Simulation(flat(slope_deg=12), vehicle, lunar, start=Start(-0.5))
        before = run(simulation, 0.5)[-1].position[0]
        climbed.append(run(simulation, 2.5, Command(0.2))[-1].position[0] - before)
    assert climbed[0] > 0.15
    assert climbed[1] < 0.01


def test_rovers_with_locked_wheels_do_not_creep_down_a_slope(lunar):
    """5 s after settling here, 10 s in the benchmark."""
    simulation = Simulation(flat(slope_deg=15), VIPER, lunar)
    run(simulation, 2.0)
    before = simulation.state().position
    after = run(simulation, 5.0)[-1].position
    assert np.linalg.norm(after - before) < 0.0005


def test_equal_commands_give_equal_bytes(lunar):
    ends = []
    for _ in range(2):
        simulation = Simulation(flat(), VIPER, lunar, start=Start(0.0, 0.013, 0.02))
        run(simulation, 0.3)
        run(simulation, 0.7, Command(0.2, 0.1))
        ends.append(
            (simulation.data.qpos.tobytes(), simulation.ground.state.tobytes(), simulation.state().wheels.tobytes())
        )
    assert ends[0] == ends[1]


def test_a_bend_has_the_commanded_radius(lunar):
    simulation = Simulation(flat(5.0), VIPER, lunar)
    run(simulation, 1.0)
    states = run(simulation, 4.0, Command(0.2, 0.3))
    turned = states[-1].heading - states[-150].heading
    path = sum(
        np.linalg.norm(two.position - one.position) for one, two in zip(states[-150:], states[-149:], strict=False)
    )
    # Slip angles on soft soil change the radius of a bend by a few per cent.
    assert turned / path == pytest.approx(2 * math.tan(0.3) / VIPER.wheelbase, rel=0.12)


def test_a_point_turn_turns_left_in_place(lunar):
    simulation = Simulation(flat(), VIPER, lunar)
    run(simulation, 1.0)
    states = run(simulation, 3.5, Command(0.15, 0.0, "turn"))
    assert states[-1].heading > 0.2
    assert np.hypot(*states[-1].position[:2]) < 0.05


def test_a_step_too_large_for_the_stiffness_is_an_error(lunar):
    with pytest.raises(RoverError):
        Simulation(flat(), VIPER, lunar, SoilOptions(step_s=0.004))
    softer = replace(lunar, K_e=2e7)
    assert largest_step(VIPER, softer.law(), 1.62) > 0.004


def test_an_external_push_ends_a_run(lunar):
    simulation = Simulation(flat(), VIPER, lunar)
    run(simulation, 0.5)
    simulation.zero()
    run(simulation, 2.0, Command(0.2))
    simulation.data.qvel[0] += 1.0  # a push without motor work
    simulation._mujoco.mj_step1(simulation.model, simulation.data)
    with pytest.raises(EnergyError):
        run(simulation, 0.1)


def test_a_rover_stops_before_it_leaves_the_ground(lunar):
    with pytest.raises(OffGridError):
        Simulation(flat(), VIPER, lunar, start=Start(1.9))
    simulation = Simulation(flat(2.6), VIPER, lunar)
    with pytest.raises(OffGridError):
        run(simulation, 9.0, Command(0.3))


def test_a_wheel_on_a_rock_has_contact_with_the_rock(lunar):
    box = trimesh.creation.box((0.5, 0.5, 0.2)).subdivide()
    rock = np.asarray(box.vertices) + np.array([0.642, 0.61, -0.08]), np.asarray(box.faces)
    world = with_rocks(flat(), [PlacedRock(4, 1, *rock)])
    last = run(Simulation(world, VIPER, lunar), 3.0)[-1]
    assert list(last.wheel("contact")) == [2, 1, 1, 1]
    assert last.wheel("load_n").sum() == pytest.approx(430 * 1.62, rel=0.01)
    # The wheel is on top of the box, 2 cm above the ground.
    assert last.wheel("z_m")[0] == pytest.approx(0.295, abs=0.003)
