"""Minimum distance of a drive from its rocks: from the meshes of rocks to wheels (cylinders) and boxes of the rover.

Contacts are those of the physics (`Simulation.contacts`), not distances.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.rover.drive.trace import Trace
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import WHEELS, Vehicle
from polarsim.rover.world.hulls import points_on
from polarsim.rover.world.surface import World
from polarsim.schemas.rover import HIGH_M

_SAMPLE_M = 0.03  # spacing of points on a rock's surface
_EVERY_S = 0.2  # period of the measured gaps
_REACH_M = 1.3  # from base_link's origin to the farthest part of the rover, plus a margin
_BODY_BELOW_M = 1.0  # height in base_link above which parts cannot reach rocks
_AT_ONCE = 20  # number of rows per batch


def closest_pass(trace: Trace, vehicle: Vehicle) -> float:
    """Return the minimum gap, m, between the rover and rocks above `HIGH_M` near its path; NaN without such a rock.

    The gap is 0 or slightly negative at a contact, since wheels and boxes touch convex parts of rocks, not the meshes.
    """
    table, world = trace.table, trace.world
    times = table["time_s"].to_numpy()
    rows = np.unique(np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, _EVERY_S)).clip(max=len(times) - 1))
    positions = table[["x_m", "y_m"]].to_numpy()[rows]
    gaps = []
    for rock in world.rocks[world.rocks["height_m"] > HIGH_M].to_dict("records"):
        distance = np.hypot(*(positions - [rock["x_m"], rock["y_m"]]).T)
        near = rows[distance < rock["radius_m"] + _REACH_M]
        if len(near):
            points = _surface_points(world, int(rock["rock"]))
            gaps += [
                gap
                for batch in np.array_split(near, math.ceil(len(near) / _AT_ONCE))
                for gap in (*_wheel_gaps(table, vehicle, points, batch), *_body_gaps(table, vehicle, points, batch))
            ]
    return min(gaps, default=math.nan)


def _surface_points(world: World, rock: int) -> np.ndarray:
    """Return (n, 3) points on a rock's mesh above the ground, at most `_SAMPLE_M` apart along edges."""
    vertices, faces = world.rock_mesh(rock)
    points = np.unique(points_on(vertices[faces], _SAMPLE_M)[0], axis=0)
    return points[points[:, 2] > world.height_at(points[:, 0], points[:, 1]) - 0.02]


def cylinder_gap(points: np.ndarray, radius: float, width: float) -> np.ndarray:
    """Return (...) gaps of points (..., 3) in a wheel's frame (axis y)."""
    out = np.hypot(points[..., 0], points[..., 2]) - radius
    aside = np.abs(points[..., 1]) - width / 2
    outside = np.hypot(np.maximum(out, 0), np.maximum(aside, 0))
    return np.where((out > 0) | (aside > 0), outside, np.maximum(out, aside))


def box_gap(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return (...) gaps of points (..., 3) in the frame of a box with sides `size` (3,)."""
    outside = np.abs(points) - size / 2
    return np.asarray(np.linalg.norm(np.maximum(outside, 0), axis=-1) + np.minimum(outside.max(axis=-1), 0))


def _wheel_gaps(table: pd.DataFrame, vehicle: Vehicle, points: np.ndarray, rows: np.ndarray) -> list[float]:
    """Return the minimum gap of each wheel in rows of a trace from points (n, 3) of the world."""
    parts = zip(WHEELS, vehicle.wheels, strict=True)
    return [
        float(cylinder_gap(_local(table, f"{code}_", points, rows), wheel.outer_radius_m, wheel.width_m).min())
        for code, wheel in parts
    ]


def _body_gaps(table: pd.DataFrame, vehicle: Vehicle, points: np.ndarray, rows: np.ndarray) -> list[float]:
    """Return the minimum gap of each box of body and legs."""
    base, gaps = _local(table, "", points, rows), []
    for shape in vehicle.shapes:
        offset = np.zeros((len(rows), 3))
        if shape.link.endswith("_arm"):
            code = shape.link.removesuffix("_arm")
            wheel = vehicle.wheels[WHEELS.index(code)]
            offset = np.tile(np.array(wheel.position_m, float), (len(rows), 1))
            offset[:, 2] += table[f"{code}_lift_m"].to_numpy()[rows]
        elif shape.link != "base_link":
            continue
        link = link_from_part(shape.position_m, shape.yaw_deg, shape.pitch_deg, shape.roll_deg)
        if shape.kind == "box" and link.translation[2] <= _BODY_BELOW_M:
            local = link.inverse().apply(base - offset[:, None])
            gaps.append(float(box_gap(local, np.array(shape.size_m, float)).min()))
    return gaps


def _local(table: pd.DataFrame, prefix: str, points: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return (rows, points, 3) points of the world in the frame of base_link or of a wheel."""
    selected = table.iloc[rows]
    rotation = Rotation.from_quat(
        selected[[f"{prefix}{name}" for name in ("qx", "qy", "qz", "qw")]].to_numpy()
    ).as_matrix()
    origin = selected[[f"{prefix}{name}" for name in ("x_m", "y_m", "z_m")]].to_numpy()
    return np.einsum("rji,rpj->rpi", rotation, points[None] - origin[:, None])
