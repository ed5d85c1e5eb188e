"""The contact against plates and the limit of its law, and its two engines against each other."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

from polarsim.errors import RoverError
from polarsim.rover.soil import bulldozing, bulldozing_numba, contact, contact_numba, shapes_numba
from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.check import Rig, drive
from polarsim.rover.soil.contact import Rule
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.limit import steady_wheel
from polarsim.rover.soil.nodes import FREE, ROCK, SHEAR_X, SHEAR_Z, START, flat_ground, make_ground
from polarsim.rover.soil.shapes import MGRU3, Bodies, Plate, Wheel, intersect
from tests.support.rover_rigs import park, patch_inverse_width, rest_plate

SOILS = Path(__file__).parents[3] / "config" / "soils.csv"
WHEEL_A, WHEEL_B = Wheel(0.25, 0.20), Wheel(0.15735, 0.165)
ENGINES = pytest.mark.parametrize("press", [contact.press, contact_numba.press], ids=["numpy", "numba"])


def _lunar_law():
    return read_soil(SOILS, "lunar").law()


def rotated(yaw: float, lean: float, rolled: float) -> np.ndarray:
    """World from a wheel that heads to `yaw`, leans and has rolled."""
    c, s = math.cos(yaw), math.sin(yaw)
    heading = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    c, s = math.cos(lean), math.sin(lean)
    leaning = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    c, s = math.cos(rolled), math.sin(rolled)
    return heading @ leaning @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def one_wheel(wheel, cell, centre, velocity=(0.0, 0.0, 0.0), rim_speed=0.0, yaw=0.0, lean=0.0, rolled=0.0) -> Bodies:
    rotation = rotated(yaw, lean, rolled)
    spin = rotation[:, 1] * rim_speed / wheel.radius
    return Bodies(
        wheel.numbers(cell)[None], np.array([centre]), rotation[None], np.array([velocity], float), spin[None]
    )


@ENGINES
@pytest.mark.parametrize(
    ("load", "plate", "depth_mm"),
    [
        (174.15, Plate(0.2, 0.2), 5.2645),
        (174.15, Plate(0.3, 0.1), 6.9604),
        (1054.6, Plate(0.2, 0.2), 31.8803),
        (174.15, Plate(0.2, 0.2, patch_inverse_width(0.2, 0.2)), 5.2203),
        (174.15, Plate(0.3, 0.1, patch_inverse_width(0.3, 0.1)), 6.9217),
        (1054.6, Plate(0.2, 0.2, patch_inverse_width(0.2, 0.2)), 31.6127),
    ],
)
def test_a_plate_rests_where_bekkers_curve_bears_it(lunar, press, load, plate, depth_mm):
    """z = (p / (K_c / b + K_phi))^(1/n), by hand."""
    assert 1000 * rest_plate(plate, lunar.law(), load, 0.02, press) == pytest.approx(depth_mm, rel=1e-4)


@pytest.mark.parametrize("slip", [0.0, 0.2, 0.4])
@pytest.mark.parametrize(("wheel", "load", "name"), [(WHEEL_A, 174.15, "lunar"), (WHEEL_B, 80.0, "hit")])
def test_a_wheel_on_fine_cells_meets_the_limit(request, wheel, load, name, slip):
    law = replace(request.getfixturevalue(name), K_e=4e9, R=0.0).law(slip_sinkage=False)
    limit, driven = (
        steady_wheel(wheel, law, load, slip),
        drive(wheel, law, load, slip, 0.005, Rig(), Rule(), contact_numba.press),
    )
    assert driven.sinkage == pytest.approx(limit.sinkage, rel=0.01)
    assert driven.torque == pytest.approx(limit.torque, rel=0.01)
    assert driven.pull == pytest.approx(limit.pull, rel=0.02, abs=1.0)


@pytest.mark.parametrize("terrain", [False, True], ids=["contact", "terrain"])
@pytest.mark.parametrize("slip", [0.0, 0.05, 0.2, 0.6])
@pytest.mark.parametrize(("wheel", "load", "name"), [(WHEEL_A, 174.15, "lunar"), (WHEEL_B, 80.0, "hit")])
def test_a_wheel_on_cells_of_2_cm_meets_the_limit(request, wheel, load, name, slip, terrain):
    law = replace(request.getfixturevalue(name), R=0.0).law(slip_sinkage=False)
    limit = steady_wheel(wheel, law, load, slip, terrain)
    driven = drive(wheel, law, load, slip, 0.02, Rig(), Rule(normal_of_terrain=terrain), contact_numba.press)
    assert driven.sinkage == pytest.approx(limit.sinkage, rel=0.03)
    assert driven.torque == pytest.approx(limit.torque, rel=0.04)
    assert driven.pull == pytest.approx(limit.pull, rel=0.08, abs=1.0)


def test_slip_digs_a_wheel_in_as_its_law_says(lunar):
    law = lunar.law()
    driven = drive(WHEEL_A, law, 174.15, 0.6, 0.02, Rig(run_in=0.4), Rule(), contact_numba.press)
    assert driven.sinkage == pytest.approx(steady_wheel(WHEEL_A, law, 174.15, 0.6).sinkage, rel=0.05)


def test_a_rig_sinks_equally_deep_on_moon_and_earth(lunar):
    depths = [
        drive(
            WHEEL_A,
            lunar.at_gravity(g).law(),
            107.5 * g,
            0.1,
            0.02,
            Rig(damper=1500 * g / 1.62),
            Rule(),
            contact_numba.press,
        )
        for g in (1.62, 9.81)
    ]
    assert depths[1].sinkage == pytest.approx(depths[0].sinkage, rel=0.05)


@pytest.mark.parametrize("slope_deg", [10, 15])
def test_a_locked_wheel_on_a_slope_does_not_creep(lunar, slope_deg):
    parked = park(WHEEL_A, lunar.law(), 107.5, 1.62, slope_deg, 0.02, 12.0, contact_numba.press)
    assert abs(parked.creep(2, 12)) < 0.0005
    assert 0 < parked.slid[-1] < 0.02  # the soil had to be sheared to hold it


def test_a_wheel_slides_down_a_slope_steeper_than_friction(stiff):
    law = replace(stiff, c=0.0).law()
    parked = park(WHEEL_A, law, 107.5, 1.62, 40, 0.02, 1.5, contact_numba.press, Rule(normal_of_terrain=True))
    assert parked.slid[-1] > 0.08


@settings(max_examples=10, deadline=None, phases=(Phase.explicit, Phase.generate))
@given(
    yaw=st.floats(-math.pi, math.pi),
    lean=st.floats(-0.3, 0.3),
    slip=st.floats(-0.5, 0.9),
    terrain=st.booleans(),
    grousers=st.booleans(),
    seed=st.integers(0, 99),
)
# Where a leaning wheel's grouser was met from its side, rounding told whether it was met at all.
@example(yaw=-2.471758272229986, lean=0.29999999999999993, slip=1.9e-195, terrain=True, grousers=True, seed=67)
def test_both_engines_give_the_same_numbers(yaw, lean, slip, terrain, grousers, seed):
    """Over steps of a drive across rough ground with a rock in it, displaced soil included."""
    noise = np.random.default_rng(seed).normal(0, 0.004, (70, 80))
    rock = np.zeros((70, 80), bool)
    rock[30:33, 45:48] = True
    one = make_ground(noise, 0.01, y0=-0.35, rock=rock)
    two, wheel, rule = one.copy(), MGRU3 if grousers else WHEEL_A, Rule(normal_of_terrain=terrain)
    law, borne, worked = _lunar_law(), 0.0, (np.zeros(1), np.zeros(1))
    for step in range(12):
        at = 0.4 + 0.004 * step
        bodies = one_wheel(
            wheel,
            0.01,
            (at, 0.0, 0.235 - 0.001 * step + 0.003 * (step % 3)),
            (0.4 * (1 - slip), 0.02, -0.1),
            0.4,
            yaw,
            lean,
            step / 40,
        )
        found = [
            press(ground, replace(bodies, slips=slips), law, rule, 0.01)
            for press, ground, slips in zip((contact.press, contact_numba.press), (one, two), worked, strict=True)
        ]
        for a, b in (
            (found[0].forces, found[1].forces),
            (found[0].torques, found[1].torques),
            (found[0].readings, found[1].readings),
        ):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * max(np.abs(a).max(), 1))
        if step % 4 == 3:
            bulldozing.bulldoze(one, bodies, Bulldozing())
            bulldozing_numba.bulldoze(two, bodies, Bulldozing())
        borne = max(borne, found[0].forces[0, 2])
    assert worked[0] == pytest.approx(worked[1], rel=1e-12)
    assert borne > 0
    np.testing.assert_allclose(one.state, two.state, rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(one.owner, two.owner)
    assert (one.state[rock] == make_ground(noise, 0.01, rock=rock).state[rock]).all()


@ENGINES
def test_a_rotated_wheel_has_rotated_forces(lunar, press):
    """On level ground +y is as good as +x."""
    cell, law, forces = 0.02, lunar.law(), []
    for yaw in (0.0, math.pi / 2):
        ground = make_ground(np.zeros((61, 61)), cell, -0.6, -0.6)
        ahead = np.array([math.cos(yaw), math.sin(yaw), 0])
        for step in range(20):
            bodies = one_wheel(WHEEL_A, cell, 0.002 * step * ahead + (0, 0, 0.235), 0.2 * ahead, 0.25, yaw)
            loads = press(ground, bodies, law, Rule(), 0.01)
        forces.append((loads.forces[0] @ ahead, loads.forces[0, 2], loads.torques[0] @ (-ahead[1], ahead[0], 0)))
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-9)


@ENGINES
def test_shear_starts_anew_once_a_node_was_clear(lunar, press):
    ground, law = flat_ground(1.2, 0.4, 0.02), lunar.law()
    low = one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.235), rim_speed=0.2)
    for _ in range(20):
        press(ground, low, law, Rule(), 0.01)
    sheared = ground.state[..., SHEAR_X : SHEAR_Z + 1].copy()
    assert np.abs(sheared).max() > 0.01
    press(ground, one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.2365), rim_speed=0.2), law, Rule(), 0.01)  # a hop
    assert np.abs(ground.state[..., SHEAR_X : SHEAR_Z + 1]).max() > 0.01
    press(ground, one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.26), rim_speed=0.2), law, Rule(), 0.01)
    assert not ground.state[..., SHEAR_X : SHEAR_Z + 1].any()
    assert (ground.owner == FREE).all()


@ENGINES
def test_nothing_pulls_a_wheel_down(lunar, press):
    """A damper must not hold a wheel that is lifted fast."""
    ground, law = flat_ground(1.2, 0.4, 0.02), lunar.law()
    press(ground, one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.235)), law, Rule(), 1e-3)
    loads = press(ground, one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.23501), velocity=(0, 0, 5.0)), law, Rule(), 1e-3)
    assert loads.forces[0, 2] > -1  # cohesion on the sloping rim; a damper that pulls would take 30 kN


@ENGINES
def test_soil_under_a_rock_does_not_bear(lunar, press):
    rock = np.ones((40, 60), bool)
    ground = make_ground(np.zeros((40, 60)), 0.02, y0=-0.4, rock=rock)
    loads = press(ground, one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.23)), lunar.law(), Rule(), 1e-3)
    assert not loads.forces.any()
    assert (ground.owner == ROCK).all()


def test_grousers_reach_deeper_than_the_rim(lunar):
    depths = []
    for wheel in (WHEEL_A, MGRU3):
        ground = flat_ground(1.2, 0.4, 0.005)
        contact_numba.press(
            ground, one_wheel(wheel, 0.005, (0.6, 0, 0.24), rolled=math.pi / 24), lunar.law(), Rule(), 1e-3
        )
        depths.append(ground.rut.max())
    np.testing.assert_allclose(depths[0], 0.01, atol=1e-4)
    assert 0.02 < depths[1] < 0.035


@given(yaw=st.floats(-math.pi, math.pi), lean=st.floats(0.01, 0.3), rolled=st.floats(0, 0.26))
@settings(max_examples=20, deadline=None)
def test_a_leaning_wheel_covers_more_than_a_rounding_of_each_cell_that_it_meets(yaw, lean, rolled):
    """A line that meets a grouser from its side meets nothing of the wheel's width."""
    wheel, axes = MGRU3.numbers(0.01), rotated(yaw, lean, rolled)
    x, y = (side.ravel() for side in np.meshgrid(np.arange(-0.3, 0.3, 0.007), np.arange(-0.3, 0.3, 0.007)))
    hits = intersect(wheel, np.zeros(3), axes, x, y, 0.01)
    compiled = np.array([shapes_numba.intersect(wheel, axes, *node, 0.01)[0] for node in zip(x, y, strict=True)])
    for weight in (hits.weight[hits.hit], compiled[compiled > 0]):
        assert weight.min() > 1e-9


def test_grousers_thinner_than_a_cell_are_refused():
    with pytest.raises(RoverError, match="fall between nodes 20 mm apart"):
        MGRU3.numbers(0.02)


def test_an_axle_a_rounding_longer_than_one_still_bears(lunar):
    """The rotation of a rover's wheel is never exact: along y its axle may be 1 + 2e-16."""
    axes = np.eye(3)
    axes[1, 1] = np.nextafter(1.0, 2.0)
    wheel, still = Wheel(0.25, 0.20), np.zeros((1, 3))
    for press in (contact.press, contact_numba.press):
        ground = flat_ground(1.0, 0.4, 0.02)
        bodies = Bodies(wheel.numbers(0.02)[None], np.array([[0.5, 0.0, 0.24]]), axes[None], still, still)
        assert press(ground, bodies, lunar.law(), Rule(), 1e-3).forces[0, 2] > 10


def test_soil_that_bore_a_load_still_does_when_slip_sets_in(lunar):
    wheel, still = Wheel(0.25, 0.20), np.zeros((1, 3))
    ground = flat_ground(1.0, 0.4, 0.02)
    spun = np.array([[0.0, 1.0, 0.0]])  # on the spot: slip 1
    loads = []
    for spin in (still, spun):
        bodies = Bodies(wheel.numbers(0.02)[None], np.array([[0.5, 0.0, 0.235]]), np.eye(3)[None], still, spin)
        loads.append(contact.press(ground, bodies, lunar.law(), Rule(), 1e-6).forces[0, 2])
    assert loads[1] == pytest.approx(loads[0], rel=1e-3)


@ENGINES
def test_slip_digs_only_as_it_carries_soil_away(lunar, press):
    """A wheel that has slipped by 0.2 mm is borne as one that rolls; after a metre it digs."""
    loads = {}
    for steps, slip in ((1, 0.0), (1, 0.9), (5000, 0.9)):
        ground, slips = flat_ground(1.2, 0.4, 0.02), np.zeros(1)
        wheel = one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.26), (0.2 * (1 - slip), 0, 0), 0.2)
        for _ in range(steps):  # above the ground
            press(ground, replace(wheel, slips=slips), lunar.law(), Rule(), 1e-3)
        low = replace(wheel, centres=np.array([[0.6, 0.0, 0.235]]), slips=slips)
        loads[steps, slip] = press(ground, low, lunar.law(), Rule(), 1e-9).forces[0, 2]
    assert loads[1, 0.9] == pytest.approx(loads[1, 0.0], rel=0.02)
    steady = one_wheel(WHEEL_A, 0.02, (0.6, 0, 0.235), (0.02, 0, 0), 0.2)  # its own slip, at once
    dug = press(flat_ground(1.2, 0.4, 0.02), steady, lunar.law(), Rule(), 1e-9).forces[0, 2]
    assert loads[5000, 0.9] == pytest.approx(dug, rel=0.01)
    assert dug < 0.1 * loads[1, 0.0]


@settings(max_examples=15, deadline=None)
@given(yaw=st.floats(-math.pi, math.pi), lean=st.floats(-0.4, 0.4), seed=st.integers(0, 99))
def test_what_is_left_out_of_a_wheels_window_has_no_part_in_it(yaw, lean, seed):
    """The same bytes with and without a bound to where a wheel can touch, over a drive with a hop in it."""
    ground = make_ground(np.random.default_rng(seed).normal(0, 0.006, (60, 60)), 0.02, -0.6, -0.6)
    whole, ahead = ground.copy(), np.array([math.cos(yaw), math.sin(yaw), 0])
    for step in range(60):
        height = 0.235 + 0.012 * math.sin(step / 4)
        wheel = one_wheel(WHEEL_A, 0.02, 0.004 * step * ahead + (0, 0, height), 0.2 * ahead, 0.25, yaw, lean)
        tight = np.array([ground.state[..., START].max() + 0.013])
        for each, tops in ((ground, tight), (whole, np.array([np.inf]))):
            contact_numba._press(
                each.state, each.normals, each.owner, each.x0, each.y0, each.cell, wheel.numbers, wheel.centres,
                wheel.rotations, wheel.velocities, wheel.spins, np.zeros(1), tops, _lunar_law(), False, 0.003, 6.0,
                1e-3, np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((1, 4)),
            )  # fmt: skip
    assert ground.state.tobytes() == whole.state.tobytes()
    assert ground.owner.tobytes() == whole.owner.tobytes()
    assert ground.rut.max() > 0.005
