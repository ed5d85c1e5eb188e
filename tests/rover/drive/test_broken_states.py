"""States with NaN or infinity are never used as an index, and end an episode with finite values."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("mujoco", reason="the rover drives with MuJoCo")
pytest.importorskip("gymnasium", reason="gymnasium is not installed")

from polarsim.errors import RoverError
from polarsim.rover.drive.energy import Account, EnergyError, require_closed
from polarsim.rover.drive.mujoco_kernels import DOFS, FIRST_DOF, WHEELS, Physics, describe
from polarsim.rover.learn.courses import PracticeCourse
from polarsim.rover.learn.environment import TraverseEnvironment
from polarsim.rover.learn.observation import STATE
from polarsim.rover.soil.contact import Loads
from polarsim.rover.soil.nodes import make_soil_ground
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.soil.shapes import Wheel, wheel_window
from polarsim.rover.world.practice import PracticeGround

ROWS, COLUMNS = 7, 9
GRID = make_soil_ground(np.arange(1.0, ROWS * COLUMNS + 1).reshape(ROWS, COLUMNS), 0.1, -0.3, -0.2)
SHAPE = Wheel(0.25, 0.2).numbers()
GROUND = PracticeGround(length_m=5.0, width_m=4.0, cell_m=0.04, rocks=0)
FIRM = SoilOptions(slip_sinkage=False, step_s=0.002)
any_number = st.floats(allow_nan=True, allow_infinity=True)


@given(any_number, any_number, any_number)
def test_the_window_of_a_body_is_inside_the_grid_for_any_pose(x, y, tilt):
    rotation = np.eye(3)
    rotation[0, 1] = tilt
    bounds = wheel_window(GRID, SHAPE, np.array([x, y, 0.0]), rotation)
    assert 0 <= bounds[0] <= bounds[1] <= ROWS
    assert 0 <= bounds[2] <= bounds[3] <= COLUMNS


@given(any_number, any_number, st.just(0.0) | any_number)
def test_a_wheel_can_be_described_at_any_position(x, y, axle):
    """Run the kernel in Python, where an invalid index is an error; outside the grid the nearest nodes are used."""
    dofs = FIRST_DOF + DOFS * WHEELS
    xmat = np.tile(np.eye(3).ravel(), (WHEELS, 1))
    xmat[:, 1] = axle
    physics = Physics(
        model=0, data=0, xpos=np.full((WHEELS, 3), [x, y, 0.2]), xmat=xmat, xquat=np.zeros((WHEELS, 4)),
        cvel=np.zeros((WHEELS, 6)), subtree_com=np.zeros((2, 3)), xfrc_applied=np.zeros((WHEELS, 6)),
        qpos=np.zeros(dofs + 1), qvel=np.zeros(dofs), qfrc_constraint=np.zeros(dofs),
        actuator_force=np.zeros(2 * WHEELS), contacts=np.zeros(0), wheels=np.arange(WHEELS),
    )  # fmt: skip
    table = np.zeros((WHEELS, 17))
    with np.errstate(all="ignore"):
        describe.py_func(physics, GRID, np.tile(SHAPE, (WHEELS, 1)), Loads.zeros(WHEELS), table)
    sinkage = table[:, 12]  # the value of a node minus the height of the wheel's lowest point
    if np.isnan([x, y]).any():
        assert np.isnan(sinkage).all()
    elif axle == 0:
        assert ((sinkage > 1.0) & (sinkage < ROWS * COLUMNS + 0.1)).all()


@pytest.mark.parametrize("missing", [np.nan, np.inf])
def test_an_energy_balance_that_is_not_finite_is_open(missing):
    account = Account(missing, 0.0, 0.0, 0.0, 0.0, (0.0,) * 4, (0.0,) * 4, 0.0)
    with pytest.raises(EnergyError):
        require_closed(account, 1.0)


@pytest.fixture
def environment():
    return TraverseEnvironment(course=PracticeCourse(GROUND, soil=FIRM), mode="blind")


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_broken_physics_ends_an_episode_with_finite_numbers(environment, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings here
    environment.reset(seed=1)
    observed, *_ = environment.step(np.float32([0.2, 0.1]))
    environment.simulation.data.qvel[0] = value
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # NumPy warns about invalid values
        last, reward, terminated, truncated, info = environment.step(np.float32([0.2, 0.1]))
    assert (terminated, truncated, bool(info["ended"])) == (True, False, True)
    assert np.isfinite(reward)
    assert np.isfinite(info["energy_j"])
    assert np.isfinite(info["along_m"])
    assert environment.observation_space.contains(last)
    assert all(np.isfinite(values).all() for values in last.values())
    same = np.arange(len(last["state"])) != list(STATE).index("look_age")
    np.testing.assert_array_equal(last["state"][same], observed["state"][same])
    again, reward, terminated, *_ = environment.step(np.float32([0.2, 0.1]))  # without a reset
    assert terminated
    assert np.isfinite(reward)
    assert all(np.isfinite(values).all() for values in again.values())


@pytest.mark.parametrize("action", [[np.nan, 0.0], [0.1, np.inf]])
def test_an_action_that_is_not_finite_is_an_error(environment, action):
    environment.reset(seed=1)
    with pytest.raises(RoverError):
        environment.step(np.float32(action))
