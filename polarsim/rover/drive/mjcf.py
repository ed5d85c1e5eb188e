"""MuJoCo model of the rover and the rocks, without the ground; soil forces are applied separately."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from polarsim.rover.vehicle.table import Vehicle, WheelPart, cube_inertia
from polarsim.rover.world.hulls import RockPart

# MuJoCo's collision bits: wheels collide with rocks, no other bodies collide.
WHEEL_BITS, ROCK_BITS = {"contype": 1, "conaffinity": 2}, {"contype": 2, "conaffinity": 1}
HARD_BRAKE = (0.9999, 0.9999, 0.001, 0.5, 2)  # solimp: by default a braked wheel creeps 0.1 mm/s
STIFF_ROCK = (0.01, 1)  # solref: contacts end within hundredths of a second, without rebound


def compile_model(vehicle: Vehicle, rocks: Sequence[RockPart], gravity: float, dt: float) -> Any:
    """Return MuJoCo's model: free `base_link`, three links with one joint each per wheel, a body per rock.

    After the accelerometer there is a contact sensor for each rock (in the order of `rocks`) and wheel (in the order
    of the vehicle): whether they touch, and the normal of the contact.
    """
    import mujoco  # an optional dependency

    spec = mujoco.MjSpec()
    spec.modelname = vehicle.name
    spec.compiler.degree = False
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
    option = spec.option
    option.timestep, option.gravity = dt, [0, 0, -gravity]
    option.integrator, option.cone = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtCone.mjCONE_ELLIPTIC
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET  # an invalid state must remain visible
    base = spec.worldbody.add_body(name="base_link")
    base.add_freejoint(name="base")
    _set_inertia(base, vehicle.chassis.mass_kg, vehicle.chassis.inertia(), vehicle.chassis.position_m)
    base.add_site(name="imu")
    for wheel in vehicle.wheels:
        _add_corner(mujoco, base, vehicle, wheel)
    bodies: dict[int, Any] = {}
    for number, part in enumerate(rocks):
        spec.add_mesh(name=f"part{number}", uservert=part.corners.ravel())
        if part.rock not in bodies:
            bodies[part.rock] = spec.worldbody.add_body(name=f"rock{part.rock}")
        bodies[part.rock].add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part{number}", solref=STIFF_ROCK,
            friction=_friction(vehicle), **ROCK_BITS,
        )  # fmt: skip
    _add_actuators(mujoco, spec, vehicle)
    sensor, kind = mujoco.mjtSensor, mujoco.mjtObj
    spec.add_sensor(name="imu", type=sensor.mjSENS_ACCELEROMETER, objtype=kind.mjOBJ_SITE, objname="imu")
    field = mujoco.mjtConDataField
    data = 1 << int(field.mjCONDATA_FOUND) | 1 << int(field.mjCONDATA_NORMAL)
    for rock in bodies:
        for wheel in vehicle.wheels:
            spec.add_sensor(
                type=sensor.mjSENS_CONTACT, objtype=kind.mjOBJ_GEOM, objname=f"{wheel.code}_rim",
                reftype=kind.mjOBJ_BODY, refname=f"rock{rock}", intprm=[data, 0, 1],  # one contact, not reduced
            )  # fmt: skip
    return spec.compile()


def _add_corner(mujoco: Any, base: Any, vehicle: Vehicle, wheel: WheelPart) -> None:
    """Add the links of a wheel: an arm that slides, an upright that steers on the arm, a wheel that spins."""
    spring, steering, drive = vehicle.suspension, vehicle.steering, vehicle.drive
    code, limit = wheel.code, float(np.radians(steering.limit_deg))
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    arm = base.add_body(name=f"{code}_arm", pos=wheel.position_m)
    _set_inertia(arm, wheel.arm_mass_kg, cube_inertia(wheel.arm_mass_kg))
    arm.add_joint(
        name=f"{code}_lift", type=slide, axis=[0, 0, 1], range=[-spring.travel_m, spring.travel_m],
        stiffness=_first(spring.stiffness_n_m), damping=_first(spring.damping_n_s_m),
    )  # fmt: skip
    upright = arm.add_body(name=f"{code}_upright")
    _set_inertia(upright, wheel.upright_mass_kg, cube_inertia(wheel.upright_mass_kg))
    upright.add_joint(
        name=f"{code}_steer", type=hinge, axis=[0, 0, 1], range=[-limit, limit],
        damping=_first(steering.damping_n_m_s_rad), armature=steering.armature_kg_m2,
    )  # fmt: skip
    spinning = upright.add_body(name=f"{code}_wheel")
    _set_inertia(spinning, wheel.mass_kg, wheel.inertia())
    spinning.add_joint(
        name=f"{code}_spin", type=hinge, axis=[0, 1, 0], damping=_first(drive.damping_n_m_s_rad),
        armature=drive.armature_kg_m2, solimp_friction=HARD_BRAKE,
    )  # fmt: skip
    rim = spinning.add_geom(
        name=f"{code}_rim", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[wheel.radius_m, wheel.width_m / 2, 0],
        solref=STIFF_ROCK, friction=_friction(vehicle), **WHEEL_BITS,
    )  # fmt: skip
    rim.alt.type, rim.alt.zaxis = mujoco.mjtOrientation.mjORIENTATION_ZAXIS, [0, 1, 0]


def _add_actuators(mujoco: Any, spec: Any, vehicle: Vehicle) -> None:
    """Add steering servos of all wheels, then drive servos: controls 0 to 3 in rad, 4 to 7 in rad/s."""
    steering, drive, joint = vehicle.steering, vehicle.drive, mujoco.mjtTrn.mjTRN_JOINT
    for what, limit in (("steer", steering.torque_limit_n_m), ("spin", drive.torque_limit_n_m)):
        for wheel in vehicle.wheels:
            name = f"{wheel.code}_{what}"
            servo = spec.add_actuator(name=name, target=name, trntype=joint, forcerange=[-limit, limit])
            if what == "steer":
                servo.set_to_position(kp=steering.stiffness_n_m_rad)
            else:
                servo.set_to_velocity(kv=drive.gain_n_m_s_rad)


def _set_inertia(body: Any, mass: float, inertia: np.ndarray, position: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    body.mass, body.inertia, body.ipos, body.explicitinertial = mass, inertia, position, True


def _friction(vehicle: Vehicle) -> list[float]:
    return [vehicle.friction_on_rock, 0.005, 0.0001]


def _first(coefficient: float) -> list[float]:
    """Return a coefficient as MuJoCo's polynomial with a linear term only."""
    return [coefficient, 0.0, 0.0]
