"""Volume and shape of displaced soil."""

import math

import numpy as np
import pytest

from polarsim.rover.soil.bulldozing import Bulldozing, settle
from polarsim.rover.soil.nodes import FLOW, LEVEL, PLASTIC, START, SoilGround, make_soil_ground
from polarsim.rover.soil.shapes import Bodies
from tests.reference import soil as reference
from tests.reference.soil_rig import LOAD_A, WHEEL_A, SoilBin, flat_ground, volume


def pressed_volume(ground: SoilGround) -> float:
    """Return the volume that wheels compressed permanently, m3."""
    return float((ground.state[..., PLASTIC] / ground.normals[..., 2]).sum()) * ground.cell**2


def roll(bed: SoilBin, metres: float, start: float = 0.4, load: float = LOAD_A, speed: float = 0.2) -> None:
    """Roll a wheel along +x with damped height, then lift it."""
    dt, height, sinking = 1e-3, WHEEL_A.radius, 0.0
    spin = np.array([[0.0, speed / WHEEL_A.radius, 0.0]])
    for step in range(round(metres / (0.95 * speed * dt))):
        centre = np.array([[start + 0.95 * speed * dt * step, 0.003, height]])
        velocity = np.array([[0.95 * speed, 0.0, sinking]])
        bodies = Bodies(WHEEL_A.numbers()[None], centre, np.eye(3)[None], velocity, spin)
        force = bed.step(bodies, dt).forces[0, 2]
        sinking = (sinking + dt * (force - load) / 20) / (1 + dt * 1500 / 20)
        height += dt * sinking
    centre = centre + np.array([0, 0, 0.2])
    for _ in range(bed.bulldozing.every if bed.bulldozing else 1):
        bed.step(Bodies(WHEEL_A.numbers()[None], centre, np.eye(3)[None], velocity, spin), dt)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_a_share_of_the_pressed_volume_moves_aside(lunar, share):
    bed = SoilBin(flat_ground(1.5, 0.8, 0.02), lunar.law(), bulldozing=Bulldozing.on(0.02, share=share))
    roll(bed, 0.5)
    pressed = pressed_volume(bed.ground)
    assert pressed > 1e-3
    assert volume(bed.ground) == pytest.approx(-(1 - share) * pressed, abs=1e-9 * pressed)
    assert not bed.ground.state[..., FLOW].any()


@pytest.mark.parametrize("cell", [0.01, 0.02])
def test_berms_are_at_both_sides_of_a_rut_without_sawtooth(lunar, cell):
    """Alternation between adjacent nodes along a rut, relative to the height of the berm."""
    bed = SoilBin(flat_ground(1.8, 0.7, cell), lunar.law(), bulldozing=Bulldozing.on(cell))
    roll(bed, 0.9)
    level, y = bed.ground.level[:, round(0.7 / cell) : round(1.1 / cell)], bed.ground.y
    for side in (-1, 1):
        assert level[(side * y > 0.1) & (side * y < 0.16)].max() > 0.005
    assert level[np.abs(y) < 0.06].max() < -0.01
    assert np.abs(level[np.abs(y) > 0.3]).max() < 1e-5
    teeth = np.abs(level[:, 2:] - 2 * level[:, 1:-1] + level[:, :-2]).max() / 4
    assert level.max() > 0.008
    assert teeth < 0.02 * level.max()


def heap(angle_deg: float) -> SoilGround:
    """Return poured soil: a cone of twice the stable slope, and random heaps and pits next to it."""
    ground = make_soil_ground(np.zeros((81, 81)), 0.02)
    x, y = np.meshgrid(ground.x - 0.6, ground.y - 0.8)
    poured = np.maximum(0.2 - 2 * math.tan(math.radians(angle_deg)) * np.hypot(x, y), 0.0)
    poured += (x > 0.5) * np.random.default_rng(0).uniform(-0.03, 0.03, poured.shape)
    for field in (START, LEVEL):
        ground.state[..., field] += poured
    return ground


def steepest(ground: SoilGround) -> tuple[float, float]:
    """Return the maximum slope between adjacent nodes in eight directions, and of planes of cells, as tangents."""
    level, root = ground.level, math.sqrt(2)
    corners = level[1:, 1:] - level[:-1, :-1], level[1:, :-1] - level[:-1, 1:]
    straight = np.diff(level, axis=0), np.diff(level, axis=1)
    between = max(*(np.abs(step).max() for step in straight), *(np.abs(step).max() / root for step in corners))
    return float(between / ground.cell), float(np.hypot(*corners).max() / root / ground.cell)


@pytest.mark.parametrize("angle_deg", [25.0, 36.0])
def test_poured_soil_slides_to_the_angle_of_repose_and_keeps_its_volume(angle_deg):
    ground = heap(angle_deg)
    tangent, before = math.tan(math.radians(angle_deg)), volume(ground)
    assert steepest(ground)[0] > 1.9 * tangent
    settle(ground, angle_deg, sweeps=50_000, still_m=1e-8)
    between, plane = steepest(ground)
    assert between < tangent * 1.0001
    assert plane < tangent / math.cos(math.pi / 8) * 1.001
    assert volume(ground) == pytest.approx(before, rel=1e-10)


def test_both_engines_settle_equally():
    grounds = [heap(30.0) for _ in range(2)]
    for engine, ground in zip((reference.settle, settle), grounds, strict=True):
        engine(ground, 30.0, sweeps=50)
    np.testing.assert_allclose(grounds[0].state, grounds[1].state, atol=1e-12)


def test_undisturbed_ground_does_not_slide():
    steep = np.tile(np.arange(30) * 0.05, (30, 1))
    ground = make_soil_ground(steep, 0.02)
    settle(ground)
    np.testing.assert_array_equal(ground.level, steep)
