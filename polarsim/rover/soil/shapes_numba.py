"""`shapes.intersect` and `Ground.window` compiled: one node and one body at a time."""

from __future__ import annotations

import math

import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.shapes import (
    GROUSER_HEIGHT,
    GROUSERS,
    HALF_LENGTH,
    HALF_THICKNESS,
    HALF_WIDTH,
    KIND,
    LEVEL_AXLE,
    PLATE,
    RADIUS,
    WHEEL,
)


@njit()
def dot(a, ax, ay, az):  # type: ignore[no-untyped-def]
    return a[0] * ax + a[1] * ay + a[2] * az


@njit()
def _covered(distance, half, cell):  # type: ignore[no-untyped-def]
    return min(max((half - abs(distance)) / cell + 0.5, 0.0), 1.0)


@njit(error_model="numpy")
def intersect_rim(ax, ay, az, radius, half, dx, dy, cell):  # type: ignore[no-untyped-def]
    """Share of the cell (0: no hit), height over the centre, normal."""
    e = dx * ax + dy * ay
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
        return weight, h, -(dx - u * ax) / radius, -(dy - u * ay) / radius, -(h - u * az) / radius
    if abs(az) > LEVEL_AXLE:
        side = -1.0 if az > 0 else 1.0
        h = (side * half - e) / az
        if h < 0 and side * u > half and dx * dx + dy * dy + h * h - half * half < radius**2:
            return 1.0, h, -side * ax, -side * ay, -side * az
    return 0.0, 0.0, 0.0, 0.0, 0.0


@njit()
def _span(at, slope, low, high, enter, leave):  # type: ignore[no-untyped-def]
    """Cut a line's stretch by a slab."""
    if abs(slope) < LEVEL_AXLE:
        return enter, (-np.inf if at < low or at > high else leave)
    one, two = (low - at) / slope, (high - at) / slope
    return max(enter, min(one, two)), min(leave, max(one, two))


@njit()
def _grouser(number, shape, rotation, dx, dy, cell):  # type: ignore[no-untyped-def]
    angle = 2 * math.pi * number / shape[GROUSERS]
    cosine, sine = math.cos(angle), math.sin(angle)
    forward, up = rotation[:, 0], rotation[:, 2]
    rx, ry, rz = (
        cosine * forward[0] + sine * up[0],
        cosine * forward[1] + sine * up[1],
        cosine * forward[2] + sine * up[2],
    )
    tx, ty, tz = (
        cosine * up[0] - sine * forward[0],
        cosine * up[1] - sine * forward[1],
        cosine * up[2] - sine * forward[2],
    )
    ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    half, thick = shape[HALF_WIDTH], shape[HALF_THICKNESS]
    enter, leave = _span(dx * rx + dy * ry, rz, 0.0, shape[RADIUS] + shape[GROUSER_HEIGHT], -np.inf, np.inf)
    enter, leave = _span(dx * tx + dy * ty, tz, -thick, thick, enter, leave)
    aside, leave = _span(dx * ax + dy * ay, az, -half - cell / 2, half + cell / 2, -np.inf, leave)
    if not (aside < enter < leave and enter < 0):  # a line that enters by a side meets none of the wheel's width
        return 0.0, 0.0, 0.0, 0.0, 0.0
    u = dx * ax + dy * ay + enter * az
    ox, oy, oz = dx - u * ax, dy - u * ay, enter - u * az
    length = math.sqrt(ox**2 + oy**2 + oz**2)
    if length == 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    return _covered(u, half, cell), enter, -ox / length, -oy / length, -oz / length


@njit()
def intersect(shape, rotation, dx, dy, cell):  # type: ignore[no-untyped-def]
    if shape[KIND] == PLATE:
        fx, fy, fz = rotation[0, 0], rotation[1, 0], rotation[2, 0]
        ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
        ux, uy, uz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        h = -(dx * ux + dy * uy) / uz
        weight = _covered(dx * fx + dy * fy + h * fz, shape[HALF_LENGTH], cell)
        return weight * _covered(dx * ax + dy * ay + h * az, shape[HALF_WIDTH], cell), h, ux, uy, uz
    ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    best = intersect_rim(ax, ay, az, shape[RADIUS], shape[HALF_WIDTH], dx, dy, cell)
    for number in range(int(shape[GROUSERS])):
        other = _grouser(number, shape, rotation, dx, dy, cell)
        if other[0] > 0 and (best[0] == 0 or other[1] < best[1]):
            best = other
    return best


@njit()
def clear(shape, rotation, dx, dy, depth):  # type: ignore[no-untyped-def]
    """Whether a point `depth` below a wheel's centre surely lies below its surface: spares nodes out of reach."""
    if shape[KIND] == PLATE or depth <= 0:
        return False
    along = dx * rotation[0, 1] + dy * rotation[1, 1] - depth * rotation[2, 1]
    tip = shape[RADIUS] + (shape[GROUSER_HEIGHT] if shape[GROUSERS] > 0 else 0.0)
    # A grouser's corners lie farther out than its centre.
    return dx * dx + dy * dy + depth * depth - along * along > tip**2 + shape[HALF_THICKNESS] ** 2


@njit()
def _bound(at, count, last):  # type: ignore[no-untyped-def]
    """Return a bound of a range of nodes, within 0 and `count`: the first node, or one after the last; NaN gives 0."""
    if not at > -1.0:  # of NaN too: its integer would be an address far outside
        return 0
    if at >= count:
        return count
    return min(math.ceil(at) + 1, count) if last else max(math.floor(at), 0)


@njit()
def window(shape, centre, rotation, x0, y0, cell, rows, columns):  # type: ignore[no-untyped-def]
    length = max(shape[RADIUS] + (shape[GROUSER_HEIGHT] if shape[GROUSERS] > 0 else 0.0), shape[HALF_LENGTH])
    ax, ay = (rotation[0, 1], rotation[1, 1]) if shape[KIND] == WHEEL else (0.0, 0.0)
    extra = 0.0 if shape[KIND] == WHEEL else shape[HALF_WIDTH]
    half_x = length * math.sqrt(max(1 - ax**2, 0.0)) + shape[HALF_WIDTH] * abs(ax) + extra
    half_y = length * math.sqrt(max(1 - ay**2, 0.0)) + shape[HALF_WIDTH] * abs(ay) + extra
    return (
        _bound((centre[1] - half_y - y0) / cell, rows, 0),
        _bound((centre[1] + half_y - y0) / cell, rows, 1),
        _bound((centre[0] - half_x - x0) / cell, columns, 0),
        _bound((centre[0] + half_x - x0) / cell, columns, 1),
    )


@njit()
def low_window(shape, centre, rotation, top, x0, y0, cell, rows, columns):  # type: ignore[no-untyped-def]
    """Of `window`, what can hold a point of a wheel below the height `top`, and a cell more."""
    ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    level, tip = math.hypot(ax, ay), shape[RADIUS]
    if shape[GROUSERS] > 0:
        tip = math.hypot(tip + shape[GROUSER_HEIGHT], shape[HALF_THICKNESS])
    depth = centre[2] - top - shape[HALF_WIDTH] * abs(az)
    if shape[KIND] == PLATE or level < 0.1 or not depth > 0:
        return window(shape, centre, rotation, x0, y0, cell, rows, columns)
    along = tip * math.sqrt(max(1 - (depth / (tip * level)) ** 2, 0.0))
    across = shape[HALF_WIDTH] * level + tip * abs(az)
    half_x = (along * abs(ay) + across * abs(ax)) / level + cell
    half_y = (along * abs(ax) + across * abs(ay)) / level + cell
    return (
        _bound((centre[1] - half_y - y0) / cell, rows, 0),
        _bound((centre[1] + half_y - y0) / cell, rows, 1),
        _bound((centre[0] - half_x - x0) / cell, columns, 0),
        _bound((centre[0] + half_x - x0) / cell, columns, 1),
    )
