"""Steps of MuJoCo and of the soil in one compiled loop: calls from Python for each would take longer than the physics.

Import it only once MuJoCo is known to be there.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import llvmlite.binding as llvm
import mujoco
import numba as nb
import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.bulldozing_numba import _bulldoze
from polarsim.rover.soil.contact import SLOWEST_RIM
from polarsim.rover.soil.contact_numba import _highest, _press, _work
from polarsim.rover.soil.nodes import ORIGINAL, START
from polarsim.rover.soil.shapes import HALF_WIDTH, RADIUS
from polarsim.rover.soil.shapes_numba import window

WHEELS = 4
FIRST_DOF, DOFS = 6, 3  # behind the free body's; lift, steer, spin of each wheel
LIFT, STEER, SPIN = range(DOFS)
# What a drive's energy went into, J; then the motors' work by wheel, and what wheels gave to soil.
MOTOR, SOIL, DAMPER, ROCK, DRIVING = range(5)
MOTOR_OF, SOIL_OF = 5, 9
SIZE = 13
SENSOR = 4  # numbers of a contact sensor: whether there is a contact, its normal
TREAD, FLANK = range(2)  # of a wheel, as they touch a rock
FLANK_FROM = math.sqrt(0.5)  # cosine of normal and axle: a flank's contact is nearer to the axle's direction
LET_GO = 0.01  # m: a wheel lets go a node within this height above its clearance; it cannot rise so fast in a step


def _mujoco(name: str) -> nb.types.ExternalFunction:
    """A function of MuJoCo by a name that compiled and cached loops find it by."""
    folder = Path(mujoco.__file__).parent
    found = (
        sorted(folder.glob("libmujoco*.so*")) + sorted(folder.glob("libmujoco*.dylib")) + sorted(folder.glob("*.dll"))
    )
    library = ctypes.CDLL(str(found[0]))
    llvm.add_symbol(f"polarsim_{name}", ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return nb.types.ExternalFunction(f"polarsim_{name}", nb.types.void(nb.types.intp, nb.types.intp))


_step1, _step2 = _mujoco("mj_step1"), _mujoco("mj_step2")


@njit()
def advance(  # type: ignore[no-untyped-def]
    model, data, steps, done, dt,
    xpos, xmat, cvel, subtree_com, xfrc, qvel, qfrc_constraint, actuator_force, bodies, servo,
    state, normals, owner, x0, y0, cell, shapes, slips, law, normal_of_terrain, clearance, shear_cap, slip_length,
    weights, share, headroom, climb, sweeps, every,
    forces, torques, readings, account, sensors, first, last,
):  # fmt: skip
    """`steps` steps from a state whose first half (`mj_step1`) is done; leaves one that is.

    bodies : (4,) numbers of the wheels in MuJoCo; servo : gain of the drives, N m s/rad, their torque limit, damping of
    lift, steer, spin; every : 0 leaves displaced soil alone; account : (SIZE,) is added to; sensors : (rocks WHEELS
    SENSOR,) of contacts; first : (rocks, 2) step at which a tread and a flank touched a rock first, or -1; last :
    (rocks,) step at which a wheel touched it last, or -1.
    """
    centres, rotations = np.empty((WHEELS, 3)), np.empty((WHEELS, 3, 3))
    velocities, spins = np.empty((WHEELS, 3)), np.empty((WHEELS, 3))
    before = np.empty_like(qvel)
    tops, seen = np.empty(WHEELS), np.full((WHEELS, 6), np.inf)
    for step in range(steps):
        for wheel in range(WHEELS):
            body = bodies[wheel]
            for axis in range(3):
                centres[wheel, axis] = xpos[body, axis]
                spins[wheel, axis] = cvel[body, axis]
                for other in range(3):
                    rotations[wheel, axis, other] = xmat[body, 3 * axis + other]
            _velocity(xpos[body], cvel[body], subtree_com[1], velocities[wheel])
        forces[:], torques[:], readings[:] = 0.0, 0.0, 0.0
        _look(state, owner, x0, y0, cell, shapes, centres, rotations, clearance, tops, seen)
        _work(slips, slip_length, shapes, rotations, velocities, spins, dt)
        _press(
            state, normals, owner, x0, y0, cell, shapes, centres, rotations, velocities, spins, slips,
            tops, law, normal_of_terrain, clearance, shear_cap, dt, forces, torques, readings,
        )  # fmt: skip
        if every > 0 and (done + step + 1) % every == 0:
            _bulldoze(
                state, normals, owner, x0, y0, cell, shapes, centres, rotations,
                weights, share, headroom, climb, sweeps,
            )  # fmt: skip
            seen[:] = np.inf
        for wheel in range(WHEELS):
            for axis in range(3):
                xfrc[bodies[wheel], axis] = forces[wheel, axis]
                xfrc[bodies[wheel], 3 + axis] = torques[wheel, axis]
        before[:] = qvel
        _step2(model, data)
        _account(before, qvel, qfrc_constraint, actuator_force, readings, servo, dt, account)
        _note_contacts(sensors, rotations, done + step, first, last)
        _step1(model, data)


@njit()
def _note_contacts(sensors, rotations, step, first, last):  # type: ignore[no-untyped-def]
    """Note which rocks wheels touch in a step, by MuJoCo's own contacts."""
    for rock in range(len(last)):
        for wheel in range(WHEELS):
            at = SENSOR * (WHEELS * rock + wheel)
            if not sensors[at] > 0:
                continue
            along_axle = 0.0
            for axis in range(3):
                along_axle += sensors[at + 1 + axis] * rotations[wheel, axis, 1]
            part = FLANK if abs(along_axle) > FLANK_FROM else TREAD
            if first[rock, part] < 0:
                first[rock, part] = step
            last[rock] = step


@njit()
def _velocity(centre, cvel, com, velocity):  # type: ignore[no-untyped-def]
    """Of a body's centre: MuJoCo gives that of its point at the whole rover's centre of mass."""
    ax, ay, az = centre[0] - com[0], centre[1] - com[1], centre[2] - com[2]
    wx, wy, wz = cvel[0], cvel[1], cvel[2]
    velocity[0] = cvel[3] + wy * az - wz * ay
    velocity[1] = cvel[4] + wz * ax - wx * az
    velocity[2] = cvel[5] + wx * ay - wy * ax


@njit()
def describe(  # type: ignore[no-untyped-def]
    xpos, xmat, cvel, subtree_com, qvel, qfrc_constraint, actuator_force, bodies,
    qpos, xquat, forces, readings, state, x0, y0, cell, shapes, table,
):  # fmt: skip
    """Fill `table` (4, columns) with a wheel's part of a trace's row a row, contacts as if there were no rocks."""
    velocity = np.empty(3)
    for wheel in range(WHEELS):
        row, body, first = table[wheel], bodies[wheel], FIRST_DOF + DOFS * wheel
        radius = shapes[wheel, RADIUS]
        row[0], row[1], row[2] = qpos[first + 1 + STEER], qpos[first + 1 + LIFT], qpos[first + 1 + SPIN]
        row[3] = qvel[first + SPIN]
        row[4:7], row[7:11] = xpos[body], xquat[body]
        ax, ay = xmat[body, 1], xmat[body, 4]
        _velocity(xpos[body], cvel[body], subtree_com[1], velocity)
        row[11] = _slip(qvel[first + SPIN] * radius, velocity[0] * ay - velocity[1] * ax)
        # Below the level from which sinkage counts, and below the original one. A mean over the rim's inner part: what
        # was pushed up along its edges is not what it sank from.
        lowest = xpos[body, 2] - radius * math.hypot(ax, ay)
        start = original = 0.0
        for part in range(5):
            across = (0.3 * part - 0.6) * shapes[wheel, HALF_WIDTH]
            node_row = _nearest_node((xpos[body, 1] + across * ay - y0) / cell, len(state))
            node_column = _nearest_node((xpos[body, 0] + across * ax - x0) / cell, state.shape[1])
            if node_row < 0 or node_column < 0:
                start = original = np.nan
                break
            start += state[node_row, node_column, START] / 5
            original += state[node_row, node_column, ORIGINAL] / 5
        row[12], row[13] = start - lowest, original - lowest
        # What rocks bear passes through the suspension's constraint force; the soil's force is known.
        row[14] = forces[wheel, 2] + qfrc_constraint[first + LIFT]
        row[15] = actuator_force[WHEELS + wheel]
        row[16] = 1.0 if readings[wheel, 3] > 0 else 0.0


@njit()
def _nearest_node(at, count):  # type: ignore[no-untyped-def]
    """Return the number of the node nearest to a coordinate in cells, within 0 and `count` - 1; -1 for NaN."""
    if math.isnan(at):
        return -1
    return int(np.rint(min(max(at, 0.0), count - 1.0)))


@njit()
def _slip(rim, forward):  # type: ignore[no-untyped-def]
    """1 where a wheel turns on the spot, 0 where it rolls, below 0 where it is pushed."""
    larger = max(abs(rim), abs(forward))
    if not larger > SLOWEST_RIM:
        return 0.0
    leading = rim if abs(rim) > SLOWEST_RIM else forward
    return math.copysign(1.0, leading) * (rim - forward) / larger


@njit()
def _look(state, owner, x0, y0, cell, shapes, centres, rotations, clearance, tops, seen):  # type: ignore[no-untyped-def]
    """Keep `tops`: heights above which no wheel touches or lets go a node, so that most of its window can be left out.

    Looked up anew once a wheel has moved by a cell from where it was `seen`, or its axle rotated by as much.
    """
    rows, columns = owner.shape
    for wheel in range(len(shapes)):
        far = 0.0
        for axis in range(3):
            rotated = abs(rotations[wheel, axis, 1] - seen[wheel, 3 + axis]) * shapes[wheel, RADIUS]
            far = max(far, abs(centres[wheel, axis] - seen[wheel, axis]) * (axis < 2), rotated)
        if far <= cell:
            continue
        for axis in range(3):
            seen[wheel, axis], seen[wheel, 3 + axis] = centres[wheel, axis], rotations[wheel, axis, 1]
        nodes = window(shapes[wheel], centres[wheel], rotations[wheel], x0, y0, cell, rows, columns)
        tops[wheel] = _highest(state, owner, nodes, 3) + clearance + LET_GO


@njit()
def _account(before, qvel, qfrc_constraint, actuator_force, readings, servo, dt, account):  # type: ignore[no-untyped-def]
    """Add a step's work.

    What MuJoCo integrates works over the mean of the speeds before and after the step, and drives and dampers act as at
    its end, as the integrator has it; what the soil takes is its own reckoning at its start. So the balance stays open
    by what the soil's forces gain from a step that is too long.
    """
    gain, limit = servo[0], servo[1]
    for dof in range(len(qvel)):
        account[ROCK] -= 0.5 * (before[dof] + qvel[dof]) * qfrc_constraint[dof] * dt
    for wheel in range(WHEELS):
        first = FIRST_DOF + DOFS * wheel
        steer, spin = first + STEER, first + SPIN
        torque = actuator_force[WHEELS + wheel]
        if abs(torque) < limit:
            torque -= gain * (qvel[spin] - before[spin])
        driving = 0.5 * (before[spin] + qvel[spin]) * torque * dt
        work = driving + 0.5 * (before[steer] + qvel[steer]) * actuator_force[wheel] * dt
        account[MOTOR] += work
        account[MOTOR_OF + wheel] += work
        for joint in range(DOFS):
            dof = first + joint
            account[DAMPER] += 0.5 * (before[dof] + qvel[dof]) * servo[2 + joint] * qvel[dof] * dt
        account[SOIL] += readings[wheel, 2] * dt
        account[SOIL_OF + wheel] += readings[wheel, 2] * dt
        account[DRIVING] += abs(driving)
