"""Rocks that a drive touched, and minimum distances to all rocks nearby.

Contacts of wheels are MuJoCo's contacts at each physics step (`Simulation.wheel_contacts`), stored with the drive. Body
and legs have no contacts in the physics; they touch a rock if a box of the vehicle's table reaches the rock's mesh at a
logged time. Gaps are distances from meshes to wheels (cylinders) and boxes.
"""

from __future__ import annotations

from operator import itemgetter

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.rover.drive.trace import Trace
from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import WHEELS, Vehicle
from polarsim.rover.world.hulls import points_on
from polarsim.rover.world.surface import World

BODY_TOUCH_M = 0.01  # more than 0, since a box may pass between the sampled points of a rock
_SAMPLE_M = 0.03  # spacing of points on a rock's surface
_EVERY_S = 0.2  # period of the measured gaps
_NEAR_M = 0.15  # the gap of body and rock changes less than this within a period
REACH_M = 1.3  # from base_link's origin to the farthest part of the rover, plus a margin
_BODY_BELOW_M = 1.0  # height in base_link above which parts cannot reach rocks
BODY = "body"
PARTS = ("tread", "flank", BODY)
TOUCH_COLUMNS = ("rock", "height_m", "gap_m", "touched", "part", "time_s")


def rock_contacts(trace: Trace, vehicle: Vehicle) -> pd.DataFrame:
    """Return a row per rock near the path: height, minimum gap (m, negative inside), `touched`, part and time.

    Part and time are those of the first touch, or of the minimum gap without a touch. The part is `tread` if a tread
    touched the rock at any time.
    """
    table, world = trace.table, trace.world
    times = table["time_s"].to_numpy()
    rows = np.unique(np.searchsorted(times, np.arange(times[0], times[-1] + 1e-9, _EVERY_S)).clip(max=len(times) - 1))
    positions = table[["x_m", "y_m"]].to_numpy()
    by_wheels: dict[int, list[tuple[str, float]]] = {}
    for contact in trace.drive["rocks_touched"]:
        by_wheels.setdefault(int(contact["rock"]), []).append((str(contact["part"]), float(contact["time_s"])))
    result = []
    for rock in world.rocks.to_dict("records"):
        number = int(rock["rock"])
        distance = np.hypot(*(positions - [rock["x_m"], rock["y_m"]]).T)
        near = rows[distance[rows] < rock["radius_m"] + REACH_M]
        if not len(near):
            continue
        points = rock_surface_points(world, number)
        gaps = [*_wheel_gaps(table, vehicle, points, near), *_body_gaps(table, vehicle, points, near)]
        part, gap, row = min(gaps, key=itemgetter(1))
        touch = list(by_wheels.get(number, []))
        if min(gap_m for name, gap_m, _ in gaps if name == BODY) < _NEAR_M:
            touch += body_touch(table, vehicle, points, np.flatnonzero(distance < rock["radius_m"] + REACH_M))
        time_s = min((contact_s for _, contact_s in touch), default=float(times[row]))
        part = min((name for name, _ in touch), key=PARTS.index, default=part)
        result.append((number, float(rock["height_m"]), gap, bool(touch), part, time_s))
    return pd.DataFrame(result, columns=list(TOUCH_COLUMNS)).astype({"touched": bool})


def rock_surface_points(world: World, rock: int) -> np.ndarray:
    """Return (n, 3) points on a rock's mesh above the ground, at most `_SAMPLE_M` apart along edges."""
    vertices, faces = world.rock_mesh(rock)
    points = np.unique(points_on(vertices[faces], _SAMPLE_M)[0], axis=0)
    return points[points[:, 2] > world.height_at(points[:, 0], points[:, 1]) - 0.02]


def cylinder_gap(points: np.ndarray, radius: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (...) gaps of points (..., 3) in a wheel's frame (axis y), and whether the tread is the nearest part."""
    out = np.hypot(points[..., 0], points[..., 2]) - radius
    aside = np.abs(points[..., 1]) - width / 2
    outside = np.hypot(np.maximum(out, 0), np.maximum(aside, 0))
    return np.where((out > 0) | (aside > 0), outside, np.maximum(out, aside)), out >= aside


def box_gap(points: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return (...) gaps of points (..., 3) in the frame of a box with sides `size` (3,)."""
    outside = np.abs(points) - size / 2
    return np.asarray(np.linalg.norm(np.maximum(outside, 0), axis=-1) + np.minimum(outside.max(axis=-1), 0))


_AT_ONCE = 20  # number of rows per batch
Gap = tuple[str, float, int]  # part of the rover, gap, m, row of the table


def body_touch(table: pd.DataFrame, vehicle: Vehicle, points: np.ndarray, rows: np.ndarray) -> list[tuple[str, float]]:
    """Return `BODY` and the time of the first contact of body or legs with points (n, 3) of a rock in rows of a trace.

    The list is empty without a contact.
    """
    for batch in np.array_split(rows, max(1, len(rows) // _AT_ONCE)):
        touching = [row for _, gap, row in _body_gaps(table, vehicle, points, batch) if gap <= BODY_TOUCH_M]
        if touching:
            return [(BODY, float(table["time_s"].iloc[min(touching)]))]
    return []


def _wheel_gaps(table: pd.DataFrame, vehicle: Vehicle, points: np.ndarray, rows: np.ndarray) -> list[Gap]:
    gaps: list[Gap] = []
    for code, wheel in zip(WHEELS, vehicle.wheels, strict=True):
        local = _local(table, f"{code}_", points, rows)
        gap, tread = cylinder_gap(local, wheel.radius_m, wheel.width_m)
        nearest = int(gap.argmin())
        part = "tread" if tread.flat[nearest] else "flank"
        gaps.append((part, float(gap.flat[nearest]), int(rows[nearest // len(points)])))
    return gaps


def _body_gaps(table: pd.DataFrame, vehicle: Vehicle, points: np.ndarray, rows: np.ndarray) -> list[Gap]:
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
        if shape.kind != "box" or link.translation[2] > _BODY_BELOW_M:
            continue
        gap = box_gap(link.inverse().apply(base - offset[:, None]), np.array(shape.size_m, float))
        nearest = int(gap.argmin())
        gaps.append((BODY, float(gap.flat[nearest]), int(rows[nearest // len(points)])))
    return gaps


def _local(table: pd.DataFrame, prefix: str, points: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return (rows, points, 3) points of the world in the frame of base_link or of a wheel."""
    selected = table.iloc[rows]
    rotation = Rotation.from_quat(
        selected[[f"{prefix}{name}" for name in ("qx", "qy", "qz", "qw")]].to_numpy()
    ).as_matrix()
    origin = selected[[f"{prefix}{name}" for name in ("x_m", "y_m", "z_m")]].to_numpy()
    return np.einsum("rji,rpj->rpi", rotation, points[None] - origin[:, None])
