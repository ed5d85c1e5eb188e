"""Shapes of wheels, and the first intersection of a vertical line with a wheel from below.

Wheel frame: x forward, y along the axle to the left, z up. A wheel rolls forward when it spins about +y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from polarsim.kernels import njit

RADIUS, HALF_WIDTH, INVERSE_WIDTH = range(3)  # indices of a wheel's shape numbers in the kernels
LEVEL_AXLE = 1e-9  # maximum vertical component of an axle that is treated as level


@dataclass(frozen=True)
class Wheel:
    """A rigid cylinder up to the tips of grousers; metres. Cells of 2 cm do not resolve single grousers."""

    radius: float
    width: float

    @property
    def reach(self) -> float:
        """Maximum distance of a point of the wheel from its centre."""
        return math.hypot(self.radius, self.width / 2)

    def numbers(self) -> np.ndarray:
        """Return the (3,) shape numbers for the kernels."""
        return np.array([self.radius, self.width / 2, 1 / self.width])


class Bodies(NamedTuple):
    """Wheels on the ground, in the world frame."""

    shapes: np.ndarray  # (k, 3) shape numbers of the wheels
    centres: np.ndarray  # (k, 3)
    rotations: np.ndarray  # (k, 3, 3) world from wheel
    velocities: np.ndarray  # (k, 3)
    spins: np.ndarray  # (k, 3) rad/s, including the rotation about the axle
    slips: np.ndarray | None = None  # (k,) recent slips, updated in place; None: present slips


@njit()
def axis_product(a, ax, ay, az):  # type: ignore[no-untyped-def]
    return a[0] * ax + a[1] * ay + a[2] * az


@njit()
def _covered(distance, half, cell):  # type: ignore[no-untyped-def]
    """Return the share of a cell that a strip covers, for a cell at `distance` from the centre line of the strip.

    So the load is continuous when a wheel's edge passes a row of nodes.
    """
    return min(max((half - abs(distance)) / cell + 0.5, 0.0), 1.0)


@njit(error_model="numpy")
def lowest_wheel_point(ax, ay, az, radius, half, dx, dy, cell):  # type: ignore[no-untyped-def]
    """Return the lowest point of a wheel on the vertical line at (dx, dy) from its centre.

    Returns the share of the cell below the wheel (0: no hit), the height above the centre, and the normal into the
    wheel. `ax, ay, az` is the axle's direction.
    """
    e = dx * ax + dy * ay
    # Points on the cylinder at height h above the centre: A h^2 - 2 e a_z h + C = 0.
    A, C = 1 - az**2, dx * dx + dy * dy - e * e - radius**2
    root = e * e * az**2 - A * C
    if not root > 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    h = (e * az - math.sqrt(root)) / A
    u = e + h * az
    weight = _covered(u, half, cell)
    if weight > 0:
        if h >= 0:
            return 0.0, 0.0, 0.0, 0.0, 0.0
        inverse = -1 / radius  # multiplications are faster than divisions
        return weight, h, (dx - u * ax) * inverse, (dy - u * ay) * inverse, (h - u * az) * inverse
    if abs(az) > LEVEL_AXLE:  # a leaning wheel also has contact at the lower side
        side = -1.0 if az > 0 else 1.0
        h = (side * half - e) / az
        if h < 0 and side * u > half and dx * dx + dy * dy + h * h - half * half < radius**2:
            return 1.0, h, -side * ax, -side * ay, -side * az
    return 0.0, 0.0, 0.0, 0.0, 0.0


@njit()
def _bound(at, count, last):  # type: ignore[no-untyped-def]
    """Return a bound of a range of nodes, within 0 and `count`.

    The bound is the index of the first node, or with `last` the index after the last node. NaN gives 0.
    """
    if not at > -1.0:  # also true for NaN, whose integer would be an invalid index
        return 0
    if at >= count:
        return count
    return min(math.ceil(at) + 1, count) if last else max(math.floor(at), 0)


@njit()
def wheel_window(ground, shape, centre, rotation):  # type: ignore[no-untyped-def]
    """Return rows and columns (first, last + 1) of the nodes that may be below a wheel."""
    ax, ay = rotation[0, 1], rotation[1, 1]
    rows, columns = ground.owner.shape
    # Rounding makes an axle along y a little longer than 1.
    half_x = shape[RADIUS] * math.sqrt(max(1 - ax**2, 0.0)) + shape[HALF_WIDTH] * abs(ax)
    half_y = shape[RADIUS] * math.sqrt(max(1 - ay**2, 0.0)) + shape[HALF_WIDTH] * abs(ay)
    return (
        _bound((centre[1] - half_y - ground.y0) / ground.cell, rows, 0),
        _bound((centre[1] + half_y - ground.y0) / ground.cell, rows, 1),
        _bound((centre[0] - half_x - ground.x0) / ground.cell, columns, 0),
        _bound((centre[0] + half_x - ground.x0) / ground.cell, columns, 1),
    )
