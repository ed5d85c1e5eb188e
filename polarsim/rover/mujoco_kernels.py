"""Steps of MuJoCo and of the soil in one compiled loop: calls from Python for each would take longer than the physics.

Import it only once MuJoCo is known to be there.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import llvmlite.binding as llvm
import mujoco
import numba as nb
import numpy as np

from polarsim.kernels import njit
from polarsim.rover.bulldozing_numba import _bulldoze
from polarsim.rover.contact_numba import _press, _work

WHEELS = 4
FIRST_DOF, DOFS = 6, 3  # behind the free body's; lift, steer, spin of each wheel
LIFT, STEER, SPIN = range(DOFS)
# What a drive's energy went into, J; then the motors' work by wheel, and what wheels gave to soil.
MOTOR, SOIL, DAMPER, ROCK, DRIVING = range(5)
MOTOR_OF, SOIL_OF = 5, 9
SIZE = 13


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
    forces, torques, readings, account,
):  # fmt: skip
    """`steps` steps from a state whose first half (`mj_step1`) is done; leaves one that is.

    bodies : (4,) numbers of the wheels in MuJoCo; servo : gain of the drives, N m s/rad, their torque limit, damping of
    lift, steer, spin; every : 0 leaves displaced soil alone; account : (SIZE,) is added to.
    """
    centres, rotations = np.empty((WHEELS, 3)), np.empty((WHEELS, 3, 3))
    velocities, spins = np.empty((WHEELS, 3)), np.empty((WHEELS, 3))
    before = np.empty_like(qvel)
    for step in range(steps):
        for wheel in range(WHEELS):
            body = bodies[wheel]
            for axis in range(3):
                centres[wheel, axis] = xpos[body, axis]
                spins[wheel, axis] = cvel[body, axis]
                for other in range(3):
                    rotations[wheel, axis, other] = xmat[body, 3 * axis + other]
            # MuJoCo gives the speed of the point of a body that lies at the whole rover's centre of mass.
            ax = xpos[body, 0] - subtree_com[1, 0]
            ay = xpos[body, 1] - subtree_com[1, 1]
            az = xpos[body, 2] - subtree_com[1, 2]
            wx, wy, wz = cvel[body, 0], cvel[body, 1], cvel[body, 2]
            velocities[wheel, 0] = cvel[body, 3] + wy * az - wz * ay
            velocities[wheel, 1] = cvel[body, 4] + wz * ax - wx * az
            velocities[wheel, 2] = cvel[body, 5] + wx * ay - wy * ax
        forces[:], torques[:], readings[:] = 0.0, 0.0, 0.0
        _work(slips, slip_length, shapes, rotations, velocities, spins, dt)
        _press(
            state, normals, owner, x0, y0, cell, shapes, centres, rotations, velocities, spins, slips,
            law, normal_of_terrain, clearance, shear_cap, dt, forces, torques, readings,
        )  # fmt: skip
        if every > 0 and (done + step + 1) % every == 0:
            _bulldoze(
                state, normals, owner, x0, y0, cell, shapes, centres, rotations,
                weights, share, headroom, climb, sweeps,
            )  # fmt: skip
        for wheel in range(WHEELS):
            for axis in range(3):
                xfrc[bodies[wheel], axis] = forces[wheel, axis]
                xfrc[bodies[wheel], 3 + axis] = torques[wheel, axis]
        before[:] = qvel
        _step2(model, data)
        _account(before, qvel, qfrc_constraint, actuator_force, readings, servo, dt, account)
        _step1(model, data)


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
