"""Readings of the sensors: exact means without noise, statistics of the noise, and determinism."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from polarsim.rover.drive.control import Command
from polarsim.rover.drive.state import RoverState
from polarsim.rover.drive.trace import COLUMNS, WHEEL_COLUMNS, Trace
from polarsim.rover.localisation import sensors
from polarsim.rover.localisation.sensors import (
    ACCELERATION_COLUMNS,
    ACCELERATION_NOISE,
    GYRO_COLUMNS,
    GYRO_INSTABILITY,
    GYRO_NOISE,
    RATE_HZ,
    SPIN_COLUMNS,
    STEER_COLUMNS,
    Sensors,
)
from polarsim.rover.vehicle.table import WHEELS
from tests.rover import drives

G = 1.62
MOON = {"options": {"soil": {"gravity_m_s2": G}}}


@pytest.fixture
def exact(monkeypatch):
    """Sensors without noise and bias."""
    for name in (
        "GYRO_NOISE",
        "GYRO_WALK",
        "GYRO_BIAS",
        "ACCELERATION_NOISE",
        "ACCELERATION_WALK",
        "ACCELERATION_BIAS",
    ):
        monkeypatch.setattr(sensors, name, 0.0)
    return Sensors(0, G)


def trace_of(time, attitude: Rotation, velocity, **columns) -> Trace:
    table = pd.DataFrame({name: np.zeros(len(time)) for name in COLUMNS})
    table["time_s"] = time
    table[["qx", "qy", "qz", "qw"]] = attitude.as_quat()
    table[["vx_m_s", "vy_m_s", "vz_m_s"]] = velocity
    return Trace(table.assign(**columns), drives.straight_drive().world, drives.straight_drive().tracks, MOON)


def yaw(angle: np.ndarray) -> Rotation:
    return Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])


def at_rest(rows: int, hz: float = RATE_HZ) -> Trace:
    time = np.arange(rows) / hz
    return trace_of(time, yaw(np.zeros(rows)), np.zeros((rows, 3)))


def test_a_rover_on_a_slope_at_rest_measures_gravity_in_its_own_frame(exact):
    attitude = Rotation.from_euler("zyx", np.tile([0.4, 0.2, -0.1], (3, 1)))
    readings = exact.table(trace_of(np.arange(3) / RATE_HZ, attitude, np.zeros((3, 3))))
    assert readings[list(GYRO_COLUMNS)].to_numpy() == pytest.approx(np.zeros((3, 3)), abs=1e-12)
    expected = attitude[0].inv().apply([0, 0, G])
    assert readings[list(ACCELERATION_COLUMNS)].to_numpy() == pytest.approx(np.tile(expected, (3, 1)))


def test_a_circle_gives_its_yaw_rate_and_its_centripetal_acceleration(exact):
    time, rate, speed = np.arange(200) / RATE_HZ, 0.3, 0.2
    velocity = speed * np.column_stack([np.cos(rate * time), np.sin(rate * time), 0 * time])
    readings = exact.table(trace_of(time, yaw(rate * time), velocity)).iloc[1:]
    assert readings["gz_rad_s"].to_numpy() == pytest.approx(rate)
    assert readings["ay_m_s2"].to_numpy() == pytest.approx(rate * speed, rel=1e-5)
    assert readings["ax_m_s2"].to_numpy() == pytest.approx(0.0, abs=1e-9)
    assert readings["az_m_s2"].to_numpy() == pytest.approx(G)


def test_the_sum_of_wheel_speeds_is_the_angle_to_a_step_of_the_encoder(exact):
    time = np.arange(500) / RATE_HZ
    angle = 0.8 * time + 0.1 * np.sin(3 * time)
    still = yaw(0 * time)
    readings = exact.table(trace_of(time, still, np.zeros((500, 3)), lf_spin_rad=angle, rr_steer_rad=0.3 * time))
    assert readings[SPIN_COLUMNS[0]].cumsum().to_numpy() / RATE_HZ == pytest.approx(angle, abs=2 * np.pi / 2**16)
    assert readings[STEER_COLUMNS[3]].to_numpy() == pytest.approx(0.3 * time, abs=np.pi / 2**16)


def test_noise_has_the_data_sheet_s_random_walk_and_bias_instability():
    hz = 10.0  # the noise of a reading depends on the rate, the random walk does not
    readings = Sensors(3, G).table(at_rest(30_000, hz))
    for name, noise, level in (("gx_rad_s", GYRO_NOISE, 0.0), ("az_m_s2", ACCELERATION_NOISE, G)):
        values = readings[name].to_numpy()
        assert values.mean() == pytest.approx(level, abs=0.01)
        assert np.diff(values).std() / np.sqrt(2) == pytest.approx(noise * np.sqrt(hz), rel=0.03)
    gyro = readings[list(GYRO_COLUMNS)].to_numpy()
    seconds = (1, 40, 80, 160)
    deviation = [allan_deviation(gyro, int(s * hz)) for s in seconds]
    assert deviation[0] == pytest.approx(GYRO_NOISE, rel=0.05)
    assert min(deviation) == pytest.approx(GYRO_INSTABILITY, rel=0.15)


def allan_deviation(values: np.ndarray, count: int) -> float:
    """Return the Allan deviation of readings (n, axes) over means of `count`."""
    means = values[: len(values) // count * count].reshape(-1, count, values.shape[1]).mean(axis=1)
    return float(np.sqrt((np.diff(means, axis=0) ** 2).mean() / 2))


def test_the_bias_at_the_start_is_the_error_of_an_average_at_rest(monkeypatch):
    monkeypatch.setattr(sensors, "GYRO_NOISE", 0.0)
    rest = at_rest(1)
    bias = np.array([Sensors(seed, G).table(rest)[list(GYRO_COLUMNS)].to_numpy()[0] for seed in range(100)])
    assert bias.std() == pytest.approx(GYRO_NOISE / np.sqrt(60), rel=0.12)
    assert abs(bias.mean()) < 3 * bias.std() / np.sqrt(300)


def test_readings_one_by_one_equal_the_table_and_other_seeds_differ():
    trace = drives.straight_drive(0.2)
    trace.drive.update(MOON)
    whole = Sensors(5, G).table(trace).to_numpy()
    one_by_one = Sensors(5, G)
    rows = [one_by_one.read(state_of(trace.table.iloc[row])) for row in range(len(trace.table))]
    np.testing.assert_array_equal(np.array(rows), whole)
    assert not np.array_equal(Sensors(6, G).table(trace).to_numpy(), whole)


def state_of(row: pd.Series) -> RoverState:
    wheels = np.zeros((4, len(WHEEL_COLUMNS)))
    for number, code in enumerate(WHEELS):
        for column in ("steer_rad", "spin_rad"):
            wheels[number, WHEEL_COLUMNS.index(column)] = row[f"{code}_{column}"]
    position, rotation, velocity = (
        row[names].to_numpy(float)
        for names in (["x_m", "y_m", "z_m"], ["qw", "qx", "qy", "qz"], ["vx_m_s", "vy_m_s", "vz_m_s"])
    )
    return RoverState(row["time_s"], position, rotation, velocity, np.zeros(3), np.zeros(3), Command(), 0.0, wheels)
