"""Soil contact: pressure after Bekker and Wong, shear after Janosi and Hanamoto, node by node, compiled.

The model follows Krenn and Hirzinger (2008, 2011) and Chrono's `SCMTerrain` (Serban, Taves and Zhou, J. Comput.
Nonlinear Dyn. 2023, doi 10.1115/1.4056851), with these differences: the force is normal to the wheel's surface, not to
the ground's; shear displacement is a vector, so a wheel at rest does not creep, is reset once the node has been clear,
and is at most that of the rim (Wong and Reece, J. Terramechanics 4 (1967) 81), since a slipping wheel passes a node for
longer than a point of the rim is in contact; only elastic branches are damped, since damped plastic flow would carry
load that soil cannot. The NumPy reference is `tests/reference/soil.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.nodes import (
    FLOW,
    FREE,
    LEVEL,
    ORIGINAL,
    PLASTIC,
    ROCK,
    SHEAR_X,
    SHEAR_Y,
    SHEAR_Z,
    START,
    TOUCHED,
    YIELD,
)
from polarsim.rover.soil.shapes import (
    HALF_WIDTH,
    INVERSE_WIDTH,
    LEVEL_AXLE,
    RADIUS,
    axis_product,
    lowest_wheel_point,
    wheel_window,
)

STEEPEST = 0.25  # minimum vertical part of a normal: a flank's area is at most four times its cell
SLOWEST_RIM = 1e-3  # m/s; a slower wheel has slip 0 and does not limit the shear displacement
CLEARANCE = 0.003  # m; height above the soil at which the shear of a node is reset
SHEAR_CAP = 6.0  # in units of K, maximum stored shear displacement
# m of rim travel over which a change of slip takes effect, about the length of the contact, since slip digs by moving
# soil away. A wheel that has spun in place by a millimetre has slip 1 but has not dug.
SLIP_LENGTH = 0.1
DEPTH, DEPTH_ORIGINAL, POWER, AREA = range(4)  # indices of readings


class Loads(NamedTuple):
    """Forces of the soil on the wheels, changed in place by the kernel."""

    forces: np.ndarray  # (k, 3) N
    torques: np.ndarray  # (k, 3) N m about the centres
    readings: np.ndarray  # (k, 4): depth below the start level and below the original level, m; power, W; area, m2

    @classmethod
    def zeros(cls, count: int) -> Loads:
        return cls(np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 4)))


@njit()
def update_slips(bodies, length, dt):  # type: ignore[no-untyped-def]
    """Update the slips used for slip sinkage: running means over `length` metres of travel, in place.

    Slip is 0 to 1; it is 0 for a wheel that is towed, braked or at rest.
    """
    slips = bodies.slips
    for body in range(len(bodies.shapes)):
        rotation, velocity = bodies.rotations[body], bodies.velocities[body]
        ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
        rim, level = axis_product(bodies.spins[body], ax, ay, az) * bodies.shapes[body, RADIUS], math.hypot(ax, ay)
        forward = (velocity[0] * ay - velocity[1] * ax) / level if level > 0 else 0.0
        slip = 0.0
        if abs(rim) >= SLOWEST_RIM and level > 0:
            slip = min(max(1 - forward / rim, 0.0), 1.0)
        kept = math.exp(-max(abs(rim), abs(forward)) * dt / length) if length > 0 else 0.0
        slips[body] = kept * slips[body] + (1 - kept) * slip


@njit(error_model="numpy")
def squared_rim_shear(ax, ay, az, nx, ny, nz, lx, ly, lz, depth, vx, vy, vz, across, inverse_rim):  # type: ignore[no-untyped-def]
    """Return the square of the shear displacement of a point of the rim since it entered the soil, in wheel radii.

    The displacement along the rim is that of Wong and Reece, that along the axle is the speed over the time since the
    entry. `ax, ay, az` is the axle, `nx, ny, nz` the normal into the wheel at the point, `lx, ly, lz` that of the
    ground, `depth` the depth of the node since its first contact, in radii, `vx, vy, vz` the velocity of the centre,
    m/s, `across` the speed of the point along the axle, m/s, and `inverse_rim` 1 over the speed of the rim, s/m. The
    rim enters the soil at the level that the node had at its first contact.
    """
    fx, fy, fz = ay * lz - az * ly, az * lx - ax * lz, ax * ly - ay * lx  # forward along the ground
    square = fx * fx + fy * fy + fz * fz  # below 1 if the axle is not parallel to the ground
    if not square > LEVEL_AXLE:
        return math.inf
    # Sines and cosines of the angles of point and entry, from the lowest point to the entry, times sqrt(square).
    entry_cosine = nx * lx + ny * ly + nz * lz - depth
    entry_sine = math.sqrt(max(square - entry_cosine * entry_cosine, 0.0))
    ahead = entry_sine + math.copysign(1.0, inverse_rim) * (nx * fx + ny * fy + nz * fz)  # difference of the sines
    inverse = 1 / square  # multiplications are faster than divisions
    chord = (depth * depth + ahead * ahead) * inverse  # squared
    angle = math.sqrt(chord) * (1 + chord * (1 / 24 + chord * (3 / 640 + chord * (5 / 7168))))  # 1e-4 at 1 rad
    along = angle - (vx * fx + vy * fy + vz * fz) * inverse_rim * ahead * inverse
    beside = angle * across * inverse_rim
    return along * along + beside * beside


@njit(error_model="numpy")
def press_nodes(ground, bodies, law, dt, loads):  # type: ignore[no-untyped-def]  # noqa: C901  one loop over nodes, so that nothing is stored between its parts
    """Press all wheels on the ground and add the forces to `loads`.

    Nodes are accessed element by element, since array views would take longer than the physics.
    """
    state, normals, owner, cell = ground.state, ground.normals, ground.owner, ground.cell
    velocities, forces, torques, readings = bodies.velocities, loads.forces, loads.torques, loads.readings
    for body in range(len(bodies.shapes)):
        shape, centre, rotation = bodies.shapes[body], bodies.centres[body], bodies.rotations[body]
        ax, ay, az, radius, half = rotation[0, 1], rotation[1, 1], rotation[2, 1], shape[RADIUS], shape[HALF_WIDTH]
        height = centre[2]
        wx, wy, wz = bodies.spins[body, 0], bodies.spins[body, 1], bodies.spins[body, 2]
        rim = axis_product(bodies.spins[body], ax, ay, az) * radius
        turning = abs(rim) >= SLOWEST_RIM
        inverse_rim, inverse_radius = 1 / rim, 1 / radius
        ux, uy, uz = velocities[body, 0], velocities[body, 1], velocities[body, 2]
        exponent = law.n + law.n_slip * bodies.slips[body]
        stiffness = law.K_c * shape[INVERSE_WIDTH] + law.K_phi
        first_row, last_row, first, last = wheel_window(ground, shape, centre, rotation)
        force_x = force_y = force_z = torque_x = torque_y = torque_z = power = total = 0.0
        sunk, deep = readings[body, DEPTH], readings[body, DEPTH_ORIGINAL]
        for row in range(first_row, last_row):
            dy = ground.y0 + cell * row - centre[1]
            for column in range(first, last):
                held = owner[row, column] == body
                if owner[row, column] == ROCK:
                    continue
                dx, start = ground.x0 + cell * column - centre[0], state[row, column, START]
                depth = height - start
                # Skip nodes that are certainly below the wheel's surface: this saves a fifth of a step.
                along = dx * ax + dy * ay - depth * az
                if not held and depth > 0 and dx * dx + dy * dy + depth * depth - along * along > radius**2:
                    continue
                weight, h, nx, ny, nz = lowest_wheel_point(ax, ay, az, radius, half, dx, dy, cell)
                lx, ly, lz = normals[row, column, 0], normals[row, column, 1], normals[row, column, 2]
                plastic, surface = state[row, column, PLASTIC], height + h
                s = lz * (start - surface)
                tried = law.K_e * (s - plastic)
                if not (weight > 0 and tried > 0):
                    if held:
                        surface_left = start - plastic / lz
                        state[row, column, LEVEL] = surface_left
                        if weight == 0 or surface - surface_left > CLEARANCE:
                            state[row, column, SHEAR_X] = 0.0
                            state[row, column, SHEAR_Y] = 0.0
                            state[row, column, SHEAR_Z] = 0.0
                            owner[row, column] = FREE
                    continue
                jx = jy = jz = 0.0
                if held:
                    jx, jy, jz = state[row, column, SHEAR_X], state[row, column, SHEAR_Y], state[row, column, SHEAR_Z]
                else:
                    owner[row, column] = body
                    state[row, column, TOUCHED] = plastic
                vx = velocities[body, 0] + (wy * h - wz * dy)
                vy = velocities[body, 1] + (wz * dx - wx * h)
                vz = velocities[body, 2] + (wx * dy - wy * dx)
                v_n = vx * nx + vy * ny + vz * nz
                # Pressure: elastic up to the largest earlier pressure, then Bekker's curve.
                if tried > state[row, column, YIELD]:
                    sigma = min(tried, max(stiffness * s**exponent, state[row, column, YIELD]))
                    state[row, column, YIELD] = sigma
                    kept = s - sigma / law.K_e
                    state[row, column, FLOW] += max(kept - plastic, 0.0)
                    state[row, column, PLASTIC] = kept
                else:
                    sigma = max(tried - law.R * v_n, 0.0)
                # Shear.
                sx, sy, sz = vx - v_n * nx, vy - v_n * ny, vz - v_n * nz
                up = lx * sx + ly * sy + lz * sz
                jx += (sx - up * lx) * dt
                jy += (sy - up * ly) * dt
                jz += (sz - up * lz) * dt
                length = math.sqrt(jx**2 + jy**2 + jz**2)
                capped = min(length, SHEAR_CAP * law.K)
                if turning:
                    across = sx * ax + sy * ay + sz * az
                    depth = (s - state[row, column, TOUCHED]) * inverse_radius
                    square = squared_rim_shear(
                        ax, ay, az, nx, ny, nz, lx, ly, lz, depth, ux, uy, uz, across, inverse_rim
                    )
                    if square * radius**2 < capped * capped:
                        capped = math.sqrt(square) * radius
                kept = capped / length if length > 0 else capped
                state[row, column, SHEAR_X] = jx * kept
                state[row, column, SHEAR_Y] = jy * kept
                state[row, column, SHEAR_Z] = jz * kept
                tau = (law.c + sigma * law.tan_phi) * (1 - math.exp(-capped / law.K))
                off = jx * nx + jy * ny + jz * nz
                tx, ty, tz = jx - off * nx, jy - off * ny, jz - off * nz
                size = math.sqrt(tx**2 + ty**2 + tz**2)
                if size > 0:
                    inverse = 1 / size
                    tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
                rate = sx * tx + sy * ty + sz * tz
                if rate < 0:
                    tau = max(tau + law.R * rate, 0.0)
                state[row, column, LEVEL] = surface
                # Force.
                area = cell**2 / max(nz, STEEPEST) * weight
                fx, fy, fz = (
                    (sigma * nx - tau * tx) * area,
                    (sigma * ny - tau * ty) * area,
                    (sigma * nz - tau * tz) * area,
                )
                force_x += fx
                force_y += fy
                force_z += fz
                torque_x += dy * fz - h * fy
                torque_y += h * fx - dx * fz
                torque_z += dx * fy - dy * fx
                sunk, deep = max(sunk, s / lz), max(deep, state[row, column, ORIGINAL] - surface)
                power -= fx * vx + fy * vy + fz * vz
                total += area
        forces[body, 0] += force_x
        forces[body, 1] += force_y
        forces[body, 2] += force_z
        torques[body, 0] += torque_x
        torques[body, 1] += torque_y
        torques[body, 2] += torque_z
        readings[body, DEPTH], readings[body, DEPTH_ORIGINAL] = sunk, deep
        readings[body, POWER] += power
        readings[body, AREA] += total
