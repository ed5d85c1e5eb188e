"""Soil contact: the analytic limit, and agreement of the two engines."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.nodes import FREE, ROCK, SHEAR_X, SHEAR_Z, make_soil_ground
from polarsim.rover.soil.shapes import Bodies
from tests.reference import soil as reference
from tests.reference.soil_limit import steady_wheel
from tests.reference.soil_rig import (
    LOAD_A,
    LOAD_B,
    WHEEL_A,
    WHEEL_B,
    Rig,
    bulldoze,
    copied,
    drive,
    flat_ground,
    park,
    press,
)
from tests.rover.conftest import SOILS


def one_wheel(centre, velocity=(0.0, 0.0, 0.0), rim_speed=0.0, yaw=0.0, lean=0.0, rolled=0.0) -> Bodies:
    rotation = Rotation.from_euler("ZXY", [yaw, lean, rolled]).as_matrix()
    spin = rotation[:, 1] * rim_speed / WHEEL_A.radius
    return Bodies(
        WHEEL_A.numbers()[None], np.array([centre], float), rotation[None], np.array([velocity], float), spin[None]
    )


@pytest.mark.parametrize(
    ("cell", "K_e", "within"),
    [(0.005, 4e9, (0.01, 0.01, 0.02)), (0.02, 2e8, (0.03, 0.04, 0.08))],
    ids=["fine", "coarse"],
)
@pytest.mark.parametrize("slip", [0.0, 0.2, 0.6])
@pytest.mark.parametrize(("wheel", "load", "name"), [(WHEEL_A, LOAD_A, "lunar"), (WHEEL_B, LOAD_B, "hit")])
def test_a_wheel_reaches_the_limit_of_its_law(request, wheel, load, name, slip, cell, K_e, within):
    law = replace(request.getfixturevalue(name), K_e=K_e, R=0.0).law(slip_sinkage=False)
    limit, driven = steady_wheel(wheel, law, load, slip), drive(wheel, law, load, slip, cell, Rig())
    assert driven.sinkage == pytest.approx(limit.sinkage, rel=within[0])
    assert driven.torque == pytest.approx(limit.torque, rel=within[1])
    assert driven.pull == pytest.approx(limit.pull, rel=within[2], abs=1.0)


def test_slip_sinkage_agrees_with_the_law(lunar):
    law = lunar.law()
    driven = drive(WHEEL_A, law, LOAD_A, 0.6, 0.02, Rig(run_in=0.4))
    assert driven.sinkage == pytest.approx(steady_wheel(WHEEL_A, law, LOAD_A, 0.6).sinkage, rel=0.05)


def test_a_locked_wheel_on_a_slope_does_not_creep(lunar):
    slid = park(WHEEL_A, lunar.law(), 107.5, 1.62, 15, 0.02, 12.0)
    assert abs(slid[-1] - slid[2000]) < 0.0005  # in 10 s
    assert 0 < slid[-1] < 0.02  # mobilised shear


def test_a_wheel_slides_down_a_slope_steeper_than_friction(lunar):
    law = replace(lunar, K_e=4e9, R=0.0, c=0.0).law()
    assert park(WHEEL_A, law, 107.5, 1.62, 40, 0.02, 1.5)[-1] > 0.08


@settings(max_examples=10, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(yaw=st.floats(-math.pi, math.pi), lean=st.floats(-0.3, 0.3), slip=st.floats(-0.5, 0.9), seed=st.integers(0, 99))
def test_both_engines_agree(yaw, lean, slip, seed):
    """On steps over rough ground with a rock, including displaced soil."""
    noise = np.random.default_rng(seed).normal(0, 0.004, (70, 80))
    rock = np.zeros((70, 80), bool)
    rock[30:33, 45:48] = True
    one = make_soil_ground(noise, 0.01, y0=-0.35, rock=rock)
    two, law, borne, slips = copied(one), read_soil(SOILS, "lunar").law(), 0.0, (np.zeros(1), np.zeros(1))
    for step in range(12):
        centre = (0.4 + 0.004 * step, 0.0, 0.235 - 0.001 * step + 0.003 * (step % 3))
        bodies = one_wheel(centre, (0.4 * (1 - slip), 0.02, -0.1), 0.4, yaw, lean, step / 40)
        found = [
            press(ground, bodies._replace(slips=own), law, 0.01)
            for press, ground, own in zip((reference.press, press), (one, two), slips, strict=True)
        ]
        for a, b in zip(*found, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * max(np.abs(a).max(), 1))
        if step % 4 == 3:
            reference.bulldoze(one, bodies, Bulldozing.on(0.01))
            bulldoze(two, bodies, Bulldozing.on(0.01))
        borne = max(borne, found[0].forces[0, 2])
    assert slips[0] == pytest.approx(slips[1], rel=1e-12)
    assert borne > 0
    np.testing.assert_allclose(one.state, two.state, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(one.owner, two.owner)
    assert (one.state[rock] == make_soil_ground(noise, 0.01, rock=rock).state[rock]).all()


def test_a_rotated_wheel_has_rotated_forces(lunar):
    """Level ground is isotropic."""
    cell, law, forces = 0.02, lunar.law(), []
    for yaw in (0.0, math.pi / 2):
        ground = make_soil_ground(np.zeros((61, 61)), cell, -0.6, -0.6)
        ahead = np.array([math.cos(yaw), math.sin(yaw), 0])
        for step in range(20):
            bodies = one_wheel(0.002 * step * ahead + (0, 0, 0.235), 0.2 * ahead, 0.25, yaw)
            loads = press(ground, bodies, law, 0.01)
        forces.append((loads.forces[0] @ ahead, loads.forces[0, 2], loads.torques[0] @ (-ahead[1], ahead[0], 0)))
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-9)


@pytest.mark.parametrize("roll", [1, -1])
@pytest.mark.parametrize(
    ("slip", "drift", "rut"), [(1.0, 0.0, 0.0), (0.7, 0.0, 0.0), (0.9, 0.1, 0.0), (0.7, 0.0, 0.012)]
)
def test_shear_of_a_slipping_wheel_is_that_of_its_rim(lunar, slip, drift, rut, roll):
    """Wong and Reece (1967): R ((entry - angle) - (1 - slip) (sin entry - sin angle)); beside, speed times time.

    In a rut of an earlier wheel the rim enters at the bottom of the rut.
    """
    law, rim, sinkage, radius = replace(lunar, K_e=4e9).law(), 0.2, 0.018, WHEEL_A.radius
    ground, speed = flat_ground(1.6, 0.5, 0.02), (1 - slip) * rim * roll
    for step in range(4001 if rut else 0):
        height = radius - rut + 0.1 * (step == 4000)  # lifted at the end
        press(ground, one_wheel((0.4 + 2e-4 * step, 0, height), (rim, 0, 0), rim), law, 1e-3)
    for step in range(2000):
        at = (0.8 + speed * (step - 1999) * 1e-3, drift * (step - 1999) * 1e-3, radius - sinkage)
        press(ground, one_wheel(at, (speed, drift, 0), roll * rim), law, 1e-3)
    rows, columns = np.nonzero(ground.owner == 0)
    angle = np.arcsin(roll * (ground.x[columns] - 0.8) / radius)
    entry = math.acos(1 - (sinkage - rut) / radius)
    along = radius * (entry - angle - (1 - slip) * (math.sin(entry) - np.sin(angle)))
    beside = drift * (entry - angle) * radius / rim
    front = (angle > 0) & (ground.y[rows] < 0.05)  # nodes at the leading edge of a drifting wheel are new
    shear = np.linalg.norm(ground.state[rows, columns, SHEAR_X : SHEAR_Z + 1], axis=-1)[front]
    np.testing.assert_allclose(shear, np.hypot(along, beside)[front], rtol=1e-3, atol=1e-5)
    assert shear.max() > 0.01
    assert len(set(columns[front])) >= 2


def test_a_wheel_that_turns_by_tiny_motions_of_its_brake_keeps_the_shear_that_holds_it(lunar):
    """Rims below 1 mm/s count as locked, so that small motions of a brake do not let a wheel creep."""
    ground, law = flat_ground(1.2, 0.4, 0.02), replace(lunar, R=0.0).law()
    for step in range(500):  # dragged along its axle
        press(ground, one_wheel((0.6, 1e-4 * step - 0.05, 0.235), (0, 0.1, 0)), law, 1e-3)
    held = press(ground, one_wheel((0.6, 0, 0.235)), law, 1e-3).forces[0, 1]
    assert held < -10
    for rim_speed in (0.9e-3, -0.9e-3):
        bodies = one_wheel((0.6, 0, 0.235), rim_speed=rim_speed)
        assert press(ground, bodies, law, 1e-3).forces[0, 1] == pytest.approx(held, rel=1e-3)


def test_shear_is_reset_after_a_node_was_clear(lunar):
    ground, law = flat_ground(1.2, 0.4, 0.02), lunar.law()
    low = one_wheel((0.6, 0, 0.235), rim_speed=0.2)
    for _ in range(20):
        press(ground, low, law, 0.01)
    sheared = ground.state[..., SHEAR_X : SHEAR_Z + 1].copy()
    assert np.abs(sheared).max() > 0.01
    press(ground, one_wheel((0.6, 0, 0.2365), rim_speed=0.2), law, 0.01)  # a small hop
    assert np.abs(ground.state[..., SHEAR_X : SHEAR_Z + 1]).max() > 0.01
    press(ground, one_wheel((0.6, 0, 0.26), rim_speed=0.2), law, 0.01)
    assert not ground.state[..., SHEAR_X : SHEAR_Z + 1].any()
    assert (ground.owner == FREE).all()


def test_soil_does_not_pull_a_wheel_down(lunar):
    """The damper must not hold a wheel that is lifted fast."""
    ground, law = flat_ground(1.2, 0.4, 0.02), lunar.law()
    press(ground, one_wheel((0.6, 0, 0.235)), law, 1e-3)
    loads = press(ground, one_wheel((0.6, 0, 0.23501), velocity=(0, 0, 5.0)), law, 1e-3)
    assert loads.forces[0, 2] > -1  # cohesion on the sloping rim; a pulling damper would give 30 kN


def test_soil_under_a_rock_carries_no_load(lunar):
    rock = np.ones((40, 60), bool)
    ground = make_soil_ground(np.zeros((40, 60)), 0.02, y0=-0.4, rock=rock)
    loads = press(ground, one_wheel((0.6, 0, 0.23)), lunar.law(), 1e-3)
    assert not loads.forces.any()
    assert (ground.owner == ROCK).all()


def test_an_axle_longer_than_one_by_rounding_still_has_contact(lunar):
    """Rotations of wheels are not exact: an axle along y may have 1 + 2e-16."""
    axes = np.eye(3)
    axes[1, 1] = np.nextafter(1.0, 2.0)
    bodies = one_wheel((0.5, 0.0, 0.24))._replace(rotations=axes[None])
    assert press(flat_ground(1.0, 0.4, 0.02), bodies, lunar.law(), 1e-3).forces[0, 2] > 10


def test_soil_keeps_the_pressure_that_it_carried_when_slip_starts(lunar):
    ground, still = flat_ground(1.0, 0.4, 0.02), one_wheel((0.5, 0.0, 0.235))
    spun = still._replace(spins=np.array([[0.0, 1.0, 0.0]]))  # spins in place: slip 1
    loads = [press(ground, bodies, lunar.law(), 1e-6).forces[0, 2] for bodies in (still, spun)]
    assert loads[1] == pytest.approx(loads[0], rel=1e-3)


def test_slip_sinkage_needs_travel(lunar):
    """A wheel with 0.2 mm of travel is carried like a rolling wheel; after a metre, slip sinkage is complete."""
    loads = {}
    for steps, slip in ((1, 0.0), (1, 0.9), (250, 0.9)):
        ground, slips = flat_ground(1.2, 0.4, 0.02), np.zeros(1)
        wheel = one_wheel((0.6, 0, 0.26), (0.2 * (1 - slip), 0, 0), 0.2)
        for _ in range(steps):  # above the ground
            press(ground, wheel._replace(slips=slips), lunar.law(), 1e-3 if steps == 1 else 0.02)
        low = wheel._replace(centres=np.array([[0.6, 0.0, 0.235]]), slips=slips)
        loads[steps, slip] = press(ground, low, lunar.law(), 1e-9).forces[0, 2]
    assert loads[1, 0.9] == pytest.approx(loads[1, 0.0], rel=0.02)
    steady = one_wheel((0.6, 0, 0.235), (0.02, 0, 0), 0.2)  # present slip, without delay
    dug = press(flat_ground(1.2, 0.4, 0.02), steady, lunar.law(), 1e-9).forces[0, 2]
    assert loads[250, 0.9] == pytest.approx(dug, rel=0.01)
    assert dug < 0.1 * loads[1, 0.0]
