"""Displaced soil: how much of it there is, and how it looks."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import RoverError
from polarsim.rover.soil import published
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.bulldozing_numba import settle
from polarsim.rover.soil.nodes import FLOW, PLASTIC, Ground, flat_ground, make_ground
from polarsim.rover.soil.shapes import Bodies, Wheel
from tests.support.rover_rigs import SoilBin

WHEEL = Wheel(0.25, 0.20)


def pressed_volume(ground: Ground) -> float:
    """All that wheels pressed down for good, m3."""
    return float((ground.state[..., PLASTIC] / ground.normals[..., 2]).sum()) * ground.cell**2


def roll(bed: SoilBin, metres: float, start: float = 0.4, load: float = 174.15, speed: float = 0.2) -> None:
    """Roll a wheel along +x, its height held back by a damper, then lift it off."""
    cell, dt, height, sinking = bed.ground.cell, 1e-3, WHEEL.radius, 0.0
    spin = np.array([[0.0, speed / WHEEL.radius, 0.0]])
    for step in range(round(metres / (0.95 * speed * dt))):
        centre = np.array([[start + 0.95 * speed * dt * step, 0.003, height]])
        velocity = np.array([[0.95 * speed, 0.0, sinking]])
        bodies = Bodies(WHEEL.numbers(cell)[None], centre, np.eye(3)[None], velocity, spin)
        force = bed.step(bodies, dt).forces[0, 2]
        sinking = (sinking + dt * (force - load) / 20) / (1 + dt * 1500 / 20)
        height += dt * sinking
    centre = centre + np.array([0, 0, 0.2])
    for _ in range(bed.bulldozing.every if bed.bulldozing else 1):
        bed.step(Bodies(WHEEL.numbers(cell)[None], centre, np.eye(3)[None], velocity, spin), dt)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_share_of_what_is_pressed_moves_aside_and_no_more(lunar, share):
    bed = SoilBin(flat_ground(1.5, 0.8, 0.02), lunar.law(), bulldozing_rule=Bulldozing(share=share))
    roll(bed, 0.5)
    pressed = pressed_volume(bed.ground)
    assert pressed > 1e-3
    assert bed.ground.volume() == pytest.approx(-(1 - share) * pressed, abs=1e-9 * pressed)
    assert not bed.ground.state[..., FLOW].any()


@pytest.mark.parametrize("cell", [0.01, 0.02])
def test_berms_have_no_teeth(lunar, cell):
    """What alternates from node to node along a rut, against the berm's height."""
    bed = SoilBin(flat_ground(1.8, 0.7, cell), lunar.law(), bulldozing_rule=Bulldozing())
    roll(bed, 0.9)
    level = bed.ground.level[:, round(0.7 / cell) : round(1.1 / cell)]
    teeth = np.abs(level[:, 2:] - 2 * level[:, 1:-1] + level[:, :-2]).max() / 4
    assert level.max() > 0.008
    assert teeth < 0.02 * level.max()


def test_berms_stand_on_both_sides_of_a_rut(lunar):
    bed = SoilBin(flat_ground(1.5, 0.8, 0.02), lunar.law(), bulldozing_rule=Bulldozing())
    roll(bed, 0.6)
    profile = bed.ground.level[:, round(0.7 / 0.02)]
    y = bed.ground.y
    assert profile[(y > 0.1) & (y < 0.16)].max() > 0.005
    assert profile[(y < -0.1) & (y > -0.16)].max() > 0.005
    assert profile[np.abs(y) < 0.06].max() < -0.01
    assert np.abs(profile[np.abs(y) > 0.3]).max() < 1e-5


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 999), angle_deg=st.floats(20, 45))
def test_settled_soil_rests_and_keeps_its_volume(seed, angle_deg):
    ground = make_ground(np.zeros((30, 30)), 0.02)
    pushed = np.random.default_rng(seed).uniform(-0.03, 0.03, (30, 30))
    ground.state[..., 1] += pushed
    ground.state[..., 2] += pushed
    settle(ground, angle_deg, sweeps=20_000, still_m=1e-8)
    assert ground.volume() == pytest.approx(pushed.sum() * 0.02**2, abs=1e-12)
    assert published.steepest_between(ground) < math.tan(math.radians(angle_deg)) * 1.001


def test_ground_that_no_wheel_touched_does_not_slide():
    steep = np.tile(np.arange(30) * 0.05, (30, 1))
    ground = make_ground(steep, 0.02)
    settle(ground)
    np.testing.assert_array_equal(ground.level, steep)


def test_two_runs_leave_the_same_ground(lunar):
    grounds = []
    for _ in range(2):
        bed = SoilBin(flat_ground(1.2, 0.6, 0.02), lunar.law(), bulldozing_rule=Bulldozing())
        roll(bed, 0.2)
        grounds.append(bed.ground.state.tobytes())
    assert grounds[0] == grounds[1]


def test_a_wheel_that_leaves_the_ground_is_named(lunar):
    bed = SoilBin(flat_ground(1.2, 0.6, 0.02), lunar.law())
    with pytest.raises(RoverError, match=r"a wheel at \(0\.93, 0\.00\) m leaves the ground, x 0\.00 to 1\.20 m"):
        roll(bed, 0.6)
