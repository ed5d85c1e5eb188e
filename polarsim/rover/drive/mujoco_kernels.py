"""Steps of MuJoCo and of the soil in one compiled loop; Python calls for each step would be slower than the physics."""

from __future__ import annotations

import ctypes
import math
import threading
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import mujoco
import numba as nb
import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.bulldozing import bulldoze_nodes
from polarsim.rover.soil.contact import AREA, POWER, SLIP_LENGTH, SLOWEST_RIM, press_nodes, update_slips
from polarsim.rover.soil.nodes import ORIGINAL, START
from polarsim.rover.soil.shapes import HALF_WIDTH, RADIUS

WHEELS = 4
FIRST_DOF, DOFS = 6, 3  # index of the first wheel joint, after the free joint, and joints per wheel: lift, steer, spin
LIFT, STEER, SPIN = range(DOFS)
# Components of the energy account, J; then the motors' work and the soil's dissipation by wheel.
MOTOR, SOIL, DAMPER, ROCK, DRIVING = range(5)
MOTOR_OF, SOIL_OF = 5, 9
SIZE = 13
SENSOR, LINKS = 4, 9  # values of a contact sensor (number of contacts, force), and sensors per rock (`mjcf.LINKS`)
PARTS = LINKS + WHEELS  # parts of the rover: treads, flanks, legs, body; wheels have two parts
FLANK_FROM = math.sqrt(0.5)  # minimum cosine between force and axle of a contact with the flank


def _mujoco(name: str) -> nb.types.ExternalFunction:
    """Return a function of MuJoCo under a name that compiled and cached loops can resolve."""
    folder = Path(mujoco.__file__).parent
    libraries = (
        sorted(folder.glob("libmujoco*.so*")) + sorted(folder.glob("libmujoco*.dylib")) + sorted(folder.glob("*.dll"))
    )
    library = ctypes.CDLL(str(libraries[0]))
    llvm.add_symbol(f"polarsim_{name}", ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return nb.types.ExternalFunction(f"polarsim_{name}", nb.types.void(nb.types.intp, nb.types.intp))


_step1, _step2 = _mujoco("mj_step1"), _mujoco("mj_step2")


_Callback = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)


def addresses_of(model: Any, data: Any) -> tuple[int, int]:
    """Return the addresses of MuJoCo's structures, which a callback receives; `data` is advanced by half a step."""
    found: dict[int, tuple[int, int]] = {}  # by thread: another thread may run a simulation during the call

    @_Callback
    def note(model_address: int, data_address: int) -> None:
        found[threading.get_ident()] = model_address, data_address

    before = mujoco.get_mjcb_control()
    mujoco.set_mjcb_control(note)
    try:
        mujoco.mj_step1(model, data)
    finally:
        mujoco.set_mjcb_control(before)
    return found[threading.get_ident()]


class Physics(NamedTuple):
    """Addresses of MuJoCo's structures, and views of their arrays under MuJoCo's names."""

    model: int
    data: int
    xpos: np.ndarray
    xmat: np.ndarray
    xquat: np.ndarray
    cvel: np.ndarray
    subtree_com: np.ndarray
    xfrc_applied: np.ndarray
    qpos: np.ndarray
    qvel: np.ndarray
    qfrc_constraint: np.ndarray
    actuator_force: np.ndarray
    contacts: np.ndarray  # ((rocks + 1) LINKS SENSOR,) readings of the contact sensors, of the ground last
    wheels: np.ndarray  # (WHEELS,) body indices of the wheels


class Servos(NamedTuple):
    """Servo parameters of the vehicle's table, for the energy balance."""

    gain: float  # N m s/rad, of the drives
    torque_limit: float  # N m, of the drives
    damping: np.ndarray  # (DOFS,) of lift (N s/m), steer and spin (N m s/rad)


class Records(NamedTuple):
    """Arrays that record the steps, changed in place."""

    account: np.ndarray  # (SIZE,) J, accumulated
    # By rock (the ground last) and part of the rover, (rocks + 1, PARTS).
    first: np.ndarray  # first step with contact, or -1
    last: np.ndarray  # last step with contact, or -1
    touching: np.ndarray  # number of steps with contact
    impulse: np.ndarray  # N s, sum of the absolute forces over time


@njit()
def advance(physics, servos, ground, bodies, law, bulldozing, loads, records, steps, done, dt):  # type: ignore[no-untyped-def]
    """Run `steps` steps of `dt` seconds after `done` earlier steps.

    Before and after the call, the first half of the next step (`mj_step1`) is done. Types: `Physics`, `Servos`,
    `SoilGround`, `Bodies`, `ContactLaw`, `Bulldozing`, `Loads`, `Records`.
    """
    before = np.empty_like(physics.qvel)
    xpos, xmat, cvel = physics.xpos, physics.xmat, physics.cvel
    for step in range(steps):
        for wheel in range(WHEELS):
            body = physics.wheels[wheel]
            for axis in range(3):
                bodies.centres[wheel, axis] = xpos[body, axis]
                bodies.spins[wheel, axis] = cvel[body, axis]
                for other in range(3):
                    bodies.rotations[wheel, axis, other] = xmat[body, 3 * axis + other]
            _velocity(xpos[body], cvel[body], physics.subtree_com[1], bodies.velocities[wheel])
        loads.forces[:], loads.torques[:], loads.readings[:] = 0.0, 0.0, 0.0
        update_slips(bodies, SLIP_LENGTH, dt)
        press_nodes(ground, bodies, law, dt, loads)
        if (done + step + 1) % bulldozing.every == 0:
            bulldoze_nodes(ground, bodies, bulldozing)
        for wheel in range(WHEELS):
            for axis in range(3):
                physics.xfrc_applied[physics.wheels[wheel], axis] = loads.forces[wheel, axis]
                physics.xfrc_applied[physics.wheels[wheel], 3 + axis] = loads.torques[wheel, axis]
        before[:] = physics.qvel
        _step2(physics.model, physics.data)
        _add_work(before, physics, loads.readings, servos, dt, records.account)
        _record_contacts(physics.contacts, bodies.rotations, done + step, dt, records)
        _step1(physics.model, physics.data)


@njit()
def _record_contacts(sensors, rotations, step, dt, records):  # type: ignore[no-untyped-def]
    """Record the contacts of a step with a force, from MuJoCo's sensors."""
    for other in range(len(records.first)):
        for link in range(LINKS):
            at = SENSOR * (LINKS * other + link)
            if not sensors[at] > 0:
                continue
            x, y, z = sensors[at + 1], sensors[at + 2], sensors[at + 3]
            force = math.sqrt(x * x + y * y + z * z)
            if not force > 0:
                continue
            part = WHEELS + link
            if link < WHEELS:
                axle = rotations[link]
                if abs(x * axle[0, 1] + y * axle[1, 1] + z * axle[2, 1]) <= FLANK_FROM * force:
                    part = link  # tread
            if records.first[other, part] < 0:
                records.first[other, part] = step
            records.last[other, part] = step
            records.touching[other, part] += 1
            records.impulse[other, part] += force * dt


@njit()
def _velocity(centre, cvel, com, velocity):  # type: ignore[no-untyped-def]
    """Compute the velocity of a body's centre; MuJoCo gives the velocity at the rover's centre of mass."""
    ax, ay, az = centre[0] - com[0], centre[1] - com[1], centre[2] - com[2]
    wx, wy, wz = cvel[0], cvel[1], cvel[2]
    velocity[0] = cvel[3] + wy * az - wz * ay
    velocity[1] = cvel[4] + wz * ax - wx * az
    velocity[2] = cvel[5] + wx * ay - wy * ax


@njit()
def describe(physics, ground, shapes, loads, table):  # type: ignore[no-untyped-def]
    """Fill `table` (4, columns), a row per wheel, with the wheel columns of the trace except contacts with rocks."""
    xpos, xmat, qvel, state = physics.xpos, physics.xmat, physics.qvel, ground.state
    velocity = np.empty(3)
    for wheel in range(WHEELS):
        row, body, first = table[wheel], physics.wheels[wheel], FIRST_DOF + DOFS * wheel
        radius = shapes[wheel, RADIUS]
        angles = physics.qpos[first + 1 : first + 1 + DOFS]
        row[0], row[1], row[2] = angles[STEER], angles[LIFT], angles[SPIN]
        row[3] = qvel[first + SPIN]
        row[4:7], row[7:11] = xpos[body], physics.xquat[body]
        ax, ay = xmat[body, 1], xmat[body, 4]
        _velocity(xpos[body], physics.cvel[body], physics.subtree_com[1], velocity)
        row[11] = _slip(qvel[first + SPIN] * radius, velocity[0] * ay - velocity[1] * ax)
        # Sinkage below the current reference level and below the original level, averaged over the inner part of the
        # rim, since soil that is pushed up along the edges is not the level from which the wheel sinks.
        lowest = xpos[body, 2] - radius * math.hypot(ax, ay)
        start = original = 0.0
        for part in range(5):
            across = (0.3 * part - 0.6) * shapes[wheel, HALF_WIDTH]
            node_row = _nearest_node((xpos[body, 1] + across * ay - ground.y0) / ground.cell, len(state))
            node_column = _nearest_node((xpos[body, 0] + across * ax - ground.x0) / ground.cell, state.shape[1])
            if node_row < 0 or node_column < 0:
                start = original = np.nan
                break
            start += state[node_row, node_column, START] / 5
            original += state[node_row, node_column, ORIGINAL] / 5
        row[12], row[13] = start - lowest, original - lowest
        # The load on rocks passes through the suspension's constraint force; the soil's force is known.
        row[14] = loads.forces[wheel, 2] + physics.qfrc_constraint[first + LIFT]
        row[15] = physics.actuator_force[WHEELS + wheel]
        row[16] = 1.0 if loads.readings[wheel, AREA] > 0 else 0.0


@njit()
def _nearest_node(at, count):  # type: ignore[no-untyped-def]
    """Return the index of the nearest node to a coordinate in cells, within 0 and `count` - 1; -1 for NaN."""
    if math.isnan(at):
        return -1
    return int(np.rint(min(max(at, 0.0), count - 1.0)))


@njit()
def _slip(rim, forward):  # type: ignore[no-untyped-def]
    """Return the slip: 1 for a wheel that spins in place, 0 for pure rolling, negative for a pushed wheel."""
    larger = max(abs(rim), abs(forward))
    if not larger > SLOWEST_RIM:
        return 0.0
    leading = rim if abs(rim) > SLOWEST_RIM else forward
    return math.copysign(1.0, leading) * (rim - forward) / larger


@njit()
def _add_work(before, physics, readings, servos, dt, account):  # type: ignore[no-untyped-def]
    """Add the work of a step.

    MuJoCo's forces act over the mean of the speeds before and after the step, and drives and dampers use the speed at
    the end of the step, as the integrator does. The soil's dissipation is computed at the start of the step. Energy
    that the soil's forces add in a step that is too long therefore appears as missing.
    """
    qvel, actuator_force = physics.qvel, physics.actuator_force
    for dof in range(len(qvel)):
        account[ROCK] -= 0.5 * (before[dof] + qvel[dof]) * physics.qfrc_constraint[dof] * dt
    for wheel in range(WHEELS):
        first = FIRST_DOF + DOFS * wheel
        steer, spin = first + STEER, first + SPIN
        torque = actuator_force[WHEELS + wheel]
        if abs(torque) < servos.torque_limit:
            torque -= servos.gain * (qvel[spin] - before[spin])
        driving = 0.5 * (before[spin] + qvel[spin]) * torque * dt
        work = driving + 0.5 * (before[steer] + qvel[steer]) * actuator_force[wheel] * dt
        account[MOTOR] += work
        account[MOTOR_OF + wheel] += work
        for joint in range(DOFS):
            dof = first + joint
            account[DAMPER] += 0.5 * (before[dof] + qvel[dof]) * servos.damping[joint] * qvel[dof] * dt
        account[SOIL] += readings[wheel, POWER] * dt
        account[SOIL_OF + wheel] += readings[wheel, POWER] * dt
        account[DRIVING] += abs(driving)
