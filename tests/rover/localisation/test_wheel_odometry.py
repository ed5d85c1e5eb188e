"""Wheel odometry is exact for motions without slip, and the mean of the wheels otherwise."""

import math
from pathlib import Path

import numpy as np
import pytest

from polarsim.rover.drive.control import Command, steer
from polarsim.rover.localisation.wheel_odometry import WheelOdometry
from polarsim.rover.vehicle.table import read_vehicle

VEHICLE = read_vehicle(Path(__file__).parents[3] / "config" / "viper.yaml")
RADII = np.array([wheel.outer_radius_m for wheel in VEHICLE.wheels])


def measured(command: Command) -> np.ndarray:
    wheels = [(x, y) for x, y, _ in VEHICLE.wheel_centres.tolist()]
    angles, rims = steer(command, wheels, VEHICLE.wheelbase, math.pi)
    return WheelOdometry(VEHICLE).motion(np.array(rims) / RADII, np.array(angles))


def test_straight_and_arc():
    assert measured(Command(0.2)) == pytest.approx([0.2, 0, 0])
    curvature = 2 * math.tan(0.2) / VEHICLE.wheelbase
    assert measured(Command(0.2, 0.2)) == pytest.approx([0.2, 0, 0.2 * curvature])
    assert measured(Command(-0.1, -0.3))[2] == pytest.approx(0.1 * 2 * math.tan(0.3) / VEHICLE.wheelbase)


def test_crab_and_crab_with_a_turn():
    assert measured(Command(0.2, 0.5, "crab")) == pytest.approx([0.2 * math.cos(0.5), 0.2 * math.sin(0.5), 0])
    both = measured(Command(0.2, 0.1, "drive", 0.3))
    assert both == pytest.approx(
        [0.2 * math.cos(0.3), 0.2 * math.sin(0.3), 0.2 * 2 * math.tan(0.1) / VEHICLE.wheelbase]
    )


def test_turn_on_the_spot():
    distance = math.hypot(*VEHICLE.wheel_centres[0, :2])
    assert measured(Command(0.1, 0, "turn")) == pytest.approx([0, 0, 0.1 / distance], abs=1e-12)


def test_a_table_gives_the_same_as_its_rows_and_a_slipping_wheel_counts_a_quarter():
    odometry = WheelOdometry(VEHICLE)
    spin = np.tile(0.2 / RADII, (2, 1))
    spin[1, 0] *= 1.2
    motion = odometry.motion(spin, np.zeros((2, 4)))
    assert motion[0] == pytest.approx([0.2, 0, 0])
    assert motion[1] == pytest.approx(odometry.motion(spin[1], np.zeros(4)))
    assert motion[1, 0] == pytest.approx(0.2 * 1.05)
