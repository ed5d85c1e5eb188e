"""Path following and steering of four wheels."""

import math
from pathlib import Path

import numpy as np
import pytest

from polarsim.rover.drive.control import Command, Driver, ReferencePath, SteeringLaw, steer
from polarsim.rover.vehicle.table import read_vehicle

VIPER = read_vehicle(Path(__file__).parents[3] / "config" / "viper.yaml")
PLACES = VIPER.wheel_centres[:, :2]
LAW = SteeringLaw(0.2, 5.0, 3.0, math.radians(30))


def wheel_commands(command: Command) -> tuple[np.ndarray, np.ndarray]:
    """Return (4,) steering angles, rad, and (4,) rim speeds, m/s."""
    limit = math.radians(VIPER.steering.limit_deg)
    angles, speeds = steer(command, [tuple(position) for position in PLACES.tolist()], VIPER.wheelbase, limit)
    return np.array(angles), np.array(speeds)


def wheel_speeds(command: Command) -> np.ndarray:
    """Return (4, 2) velocities of rolling wheels in base_link, m/s."""
    angles, rims = wheel_commands(command)
    return np.stack([rims * np.cos(angles), rims * np.sin(angles)], axis=1)


def body_motion(velocities: np.ndarray) -> tuple[np.ndarray, float]:
    """Return speed x, y and turn rate of the best rigid motion, and the largest residual of a wheel."""
    rows = np.concatenate(
        [
            np.column_stack([np.ones(4), np.zeros(4), -PLACES[:, 1]]),
            np.column_stack([np.zeros(4), np.ones(4), PLACES[:, 0]]),
        ]
    )
    measured = np.concatenate([velocities[:, 0], velocities[:, 1]])
    motion = np.linalg.lstsq(rows, measured, rcond=None)[0]
    return motion, float(np.abs(rows @ motion - measured).max())


@pytest.mark.parametrize("speed", [0.4, -0.1])
@pytest.mark.parametrize("steer", [-0.5, 0.0, 1e-3, 0.4])
@pytest.mark.parametrize("crab", [0.0, -0.3, 0.4])
def test_no_wheel_slides_sideways_in_a_bend_with_or_without_crab(speed, steer, crab):
    (forward, sideways, turn), slide = body_motion(wheel_speeds(Command(speed, steer, "drive", crab)))
    assert slide < 1e-9
    assert (forward, sideways) == pytest.approx((speed * math.cos(crab), speed * math.sin(crab)), abs=1e-6)
    # Front and rear wheels steer in opposite directions: the curvature is twice that of a car.
    assert turn == pytest.approx(speed * 2 * math.tan(steer) / VIPER.wheelbase, abs=1e-6)


@pytest.mark.parametrize("steer", [-1.5, -0.4, 0.0, 1.2])
def test_a_crab_does_not_turn(steer):
    (forward, sideways, turn), slide = body_motion(wheel_speeds(Command(0.3, steer, "crab")))
    assert slide < 1e-9
    assert turn == pytest.approx(0, abs=1e-9)
    assert (forward, sideways) == pytest.approx((0.3 * math.cos(steer), 0.3 * math.sin(steer)), abs=1e-9)


@pytest.mark.parametrize("speed", [0.1, -0.1])
def test_a_turn_on_the_spot_does_not_move_the_centre(speed):
    (forward, sideways, turn), slide = body_motion(wheel_speeds(Command(speed, 0.0, "turn")))
    assert slide < 1e-9
    assert (forward, sideways) == pytest.approx((0, 0), abs=1e-9)
    assert turn == pytest.approx(speed / math.hypot(*PLACES[0]))  # to the left if positive
    assert np.abs(wheel_commands(Command(speed, 0.0, "turn"))[0]).max() < math.pi / 2


def kinematic_drive(
    law: SteeringLaw, route: ReferencePath, x: float, y: float, heading: float, seconds: float, slide: float = 0.0
) -> tuple[list, Driver]:
    """Simulate a rover that follows commands exactly, plus a slide to the left, m/s."""
    driver, points = Driver(route, law), []
    for _ in range(round(seconds / 0.05)):
        if driver.finished:
            break
        command = driver.command(x, y, heading)
        (forward, sideways, turn), _ = body_motion(wheel_speeds(command))
        sideways += slide
        x += 0.05 * (forward * math.cos(heading) - sideways * math.sin(heading))
        y += 0.05 * (forward * math.sin(heading) + sideways * math.cos(heading))
        heading += 0.05 * turn
        points.append((x, y, heading, driver.offset))
    return points, driver


WEST = ReferencePath(np.array([[10.0, 0.0], [0.0, 0.0]]))


def test_with_the_heading_term_a_rover_returns_to_the_line_and_stays():
    points, _ = kinematic_drive(LAW, WEST, 10, 0.3, math.pi, 40)
    offsets = np.abs([position[3] for position in points])
    assert offsets[len(offsets) // 2 :].max() < 0.005


def test_combined_steering_returns_without_oscillation():
    points, _ = kinematic_drive(SteeringLaw(0.2, 4.0, 2.0, math.radians(30), "combined"), WEST, 10, 0.1, math.pi, 40)
    offsets = np.array([position[3] for position in points])
    assert np.abs(offsets[len(offsets) // 4 :]).max() < 0.001
    assert offsets.max() < 0.001  # the start is to the right of a westward line
    assert max(abs(position[2] - math.pi) for position in points) < 1e-9


@pytest.mark.parametrize("steering", ["ackermann", "combined"])
def test_the_integral_compensates_a_lateral_slide(steering):
    """As on a slope across the path: 1 cm/s is an angle of 3 degrees."""
    worst = []
    for integral in (0.0, 4.0):
        law = SteeringLaw(0.2, 4.0, 3.0, math.radians(30), steering, integral)
        points, _ = kinematic_drive(law, WEST, 10, 0.0, math.pi, 45, slide=0.01)
        worst.append(max(abs(position[3]) for position in points[600:]))
    assert worst[0] > 0.01
    assert worst[1] < 0.002
    _, driver = kinematic_drive(law, WEST, 10, 0.0, math.pi, 20, slide=0.2)
    assert abs(driver.drift) == pytest.approx(math.radians(10))  # the bound


def test_steering_by_the_offset_only_oscillates():
    """Without damping the amplitude does not decrease."""
    points, _ = kinematic_drive(SteeringLaw(0.2, 1.0472, 0.0, math.radians(30)), WEST, 10, 0.3, math.pi, 45)
    offsets = np.array([position[3] for position in points])
    assert offsets.min() < -0.25
    assert offsets[len(offsets) // 2 :].max() > 0.25


def test_a_sharp_corner_is_turned_on_the_spot():
    corner = ReferencePath(np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]))
    points, driver = kinematic_drive(LAW, corner, 0.0, 0.0, 0.0, 60)
    assert driver.finished
    assert max(position[0] for position in points) < 2.05
    assert points[-1][2] == pytest.approx(math.pi / 2, abs=0.05)


def test_a_crab_keeps_the_heading_around_a_corner():
    corner = ReferencePath(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]]))
    points, driver = kinematic_drive(SteeringLaw(0.2, 2.0, 0.0, 0.5, "crab"), corner, 0.0, 0.0, 0.0, 60)
    assert driver.finished
    assert max(abs(position[2]) for position in points) < 1e-9
    assert abs(points[-1][3]) < 0.01
