"""`contact.press` compiled: the same numbers, node by node, fast enough to drive with."""

from __future__ import annotations

import math

import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.contact import READINGS, SLOWEST_RIM, STEEPEST, Rule, Wrenches
from polarsim.rover.soil.law import ContactLaw
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
    YIELD,
    Ground,
)
from polarsim.rover.soil.shapes import GROUSERS, HALF_WIDTH, INVERSE_WIDTH, KIND, RADIUS, WHEEL, Bodies
from polarsim.rover.soil.shapes_numba import clear, dot, intersect, intersect_rim, low_window

_SIZE = len(READINGS)


def press(ground: Ground, bodies: Bodies, law: ContactLaw, rule: Rule, dt: float) -> Wrenches:
    """One step of the contact of all bodies, in their order; changes `ground`."""
    count = len(bodies.numbers)
    forces, torques, readings = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, _SIZE))
    slips, length = (np.zeros(count), 0.0) if bodies.slips is None else (bodies.slips, rule.slip_length)
    _work(slips, length, bodies.numbers, bodies.rotations, bodies.velocities, bodies.spins, dt)
    tops = np.full(count, np.inf)
    _press(
        ground.state, ground.normals, ground.owner, ground.x0, ground.y0, ground.cell,
        bodies.numbers, bodies.centres, bodies.rotations, bodies.velocities, bodies.spins, slips,
        tops, law, rule.normal_of_terrain, rule.clearance, rule.shear_cap, dt, forces, torques, readings,
    )  # fmt: skip
    return Wrenches(forces, torques, readings)


@njit()
def _highest(state, owner, nodes, margin):  # type: ignore[no-untyped-def]
    """Highest level from which sinkage counts in a window and a margin of nodes round it."""
    top, rows, columns = -np.inf, owner.shape[0], owner.shape[1]
    for row in range(max(nodes[0] - margin, 0), min(nodes[1] + margin, rows)):
        for column in range(max(nodes[2] - margin, 0), min(nodes[3] + margin, columns)):
            if owner[row, column] != ROCK:
                top = max(top, state[row, column, START])
    return top


@njit()
def _work(slips, length, shapes, rotations, velocities, spins, dt):  # type: ignore[no-untyped-def]
    """`contact.worked_slips`: of all bodies, in place."""
    for body in range(len(shapes)):
        rotation, velocity = rotations[body], velocities[body]
        ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
        rim, level = dot(spins[body], ax, ay, az) * shapes[body, RADIUS], math.hypot(ax, ay)
        forward = (velocity[0] * ay - velocity[1] * ax) / level if level > 0 else 0.0
        slip = 0.0
        if shapes[body, KIND] == WHEEL and abs(rim) >= SLOWEST_RIM and level > 0:
            slip = min(max(1 - forward / rim, 0.0), 1.0)
        kept = math.exp(-max(abs(rim), abs(forward)) * dt / length) if length > 0 else 0.0
        slips[body] = kept * slips[body] + (1 - kept) * slip


@njit(error_model="numpy")
def _press(  # type: ignore[no-untyped-def]  # noqa: C901  one loop over nodes, so that nothing is stored between its parts
    state, normals, owner, x0, y0, cell, shapes, centres, rotations, velocities, spins, slips,
    tops, law, normal_of_terrain, clearance, shear_cap, dt, forces, torques, readings,
):  # fmt: skip
    """Nodes are read and written one number at a time: a view of each would cost more than its physics."""
    rows, columns = owner.shape
    for body in range(len(shapes)):
        shape, centre, rotation = shapes[body], centres[body], rotations[body]
        ax, ay, az, radius, half = rotation[0, 1], rotation[1, 1], rotation[2, 1], shape[RADIUS], shape[HALF_WIDTH]
        height, tip2 = centre[2], radius**2
        wx, wy, wz = spins[body, 0], spins[body, 1], spins[body, 2]
        exponent = law.n + law.n_slip * slips[body]
        stiffness = law.K_c * shape[INVERSE_WIDTH] + law.K_phi
        first_row, last_row, first, last = low_window(shape, centre, rotation, tops[body], x0, y0, cell, rows, columns)
        plain = shape[KIND] == WHEEL and shape[GROUSERS] == 0
        force_x = force_y = force_z = torque_x = torque_y = torque_z = power = total = 0.0
        sunk, deep = readings[body, 0], readings[body, 1]
        for row in range(first_row, last_row):
            dy = y0 + cell * row - centre[1]
            for column in range(first, last):
                held = owner[row, column] == body
                if owner[row, column] == ROCK:
                    continue
                dx, start = x0 + cell * column - centre[0], state[row, column, START]
                depth = height - start
                if plain:
                    # Nodes that surely lie below its surface are passed over.
                    along = dx * ax + dy * ay - depth * az
                    if not held and depth > 0 and dx * dx + dy * dy + depth * depth - along * along > tip2:
                        continue
                    weight, h, nx, ny, nz = intersect_rim(ax, ay, az, radius, half, dx, dy, cell)
                else:
                    if not held and clear(shape, rotation, dx, dy, depth):
                        continue
                    weight, h, nx, ny, nz = intersect(shape, rotation, dx, dy, cell)
                lx, ly, lz = normals[row, column, 0], normals[row, column, 1], normals[row, column, 2]
                plastic, surface = state[row, column, PLASTIC], height + h
                s = lz * (start - surface)
                tried = law.K_e * (s - plastic)
                if not (weight > 0 and tried > 0):
                    if held:
                        left = start - plastic / lz
                        state[row, column, LEVEL] = left
                        if weight == 0 or surface - left > clearance:
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
                if normal_of_terrain:
                    nx, ny, nz = lx, ly, lz
                vx = velocities[body, 0] + (wy * h - wz * dy)
                vy = velocities[body, 1] + (wz * dx - wx * h)
                vz = velocities[body, 2] + (wx * dy - wy * dx)
                v_n = vx * nx + vy * ny + vz * nz
                # Pressure: elastic up to what was borne before, then Bekker's curve.
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
                capped = min(length, shear_cap * law.K)
                kept = capped / length if length > 0 else capped
                state[row, column, SHEAR_X] = jx * kept
                state[row, column, SHEAR_Y] = jy * kept
                state[row, column, SHEAR_Z] = jz * kept
                tau = (law.c + sigma * law.tan_phi) * (1 - math.exp(-capped / law.K))
                off = jx * nx + jy * ny + jz * nz
                tx, ty, tz = jx - off * nx, jy - off * ny, jz - off * nz
                size = math.sqrt(tx**2 + ty**2 + tz**2)
                if size > 0:
                    tx, ty, tz = tx / size, ty / size, tz / size
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
        readings[body, 0], readings[body, 1] = sunk, deep
        readings[body, 2] += power
        readings[body, 3] += total
