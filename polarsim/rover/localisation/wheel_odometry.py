"""Velocity of the body from speeds and steering angles of the wheels, as if no wheel slipped."""

from __future__ import annotations

import numpy as np

from polarsim.rover.vehicle.table import Vehicle


class WheelOdometry:
    """Least-squares fit of the planar motion of base_link to the velocities of the wheels.

    A wheel at (x, y) with rim speed s and steering angle a has the velocity s (cos a, sin a) = (vx - w y, vy + w x),
    eight equations for the velocity vx, vy, m/s, and the yaw rate w, rad/s.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        centres = vehicle.wheel_centres[:, :2]
        self._radii = np.array([wheel.outer_radius_m for wheel in vehicle.wheels])
        across = np.column_stack([-centres[:, 1], centres[:, 0]])
        equations = np.concatenate([np.tile(np.eye(2), (len(centres), 1)), across.reshape(-1, 1)], axis=1)
        self._solve = np.linalg.pinv(equations)  # (3, 8)

    def motion(self, spin: np.ndarray, steer: np.ndarray) -> np.ndarray:
        """Return (..., 3) vx, vy, w of wheel speeds (..., 4), rad/s, and steering angles (..., 4), rad."""
        speed = np.asarray(spin) * self._radii
        velocity = np.stack([speed * np.cos(steer), speed * np.sin(steer)], axis=-1)
        return np.asarray(velocity.reshape(*speed.shape[:-1], -1) @ self._solve.T)
