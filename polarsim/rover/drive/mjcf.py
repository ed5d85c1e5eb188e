"""MuJoCo model of the rover, the rocks and the ground under the body; soil forces are applied separately.

Wheels collide with rocks; their contact with the ground is that of the soil. Body and legs have the shapes of the
vehicle's table and collide with rocks and with the ground as it was before the drive, which is rigid for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.rover.vehicle.mounts import link_from_part
from polarsim.rover.vehicle.table import WHEELS, ShapePart, Vehicle, WheelPart, cube_inertia
from polarsim.rover.world.rock_parts import RockPart
from polarsim.rover.world.surface import World

# MuJoCo's collision bits: two geoms collide if one's `contype` shares a bit with the other's `conaffinity`.
WHEEL_BITS, BODY_BITS = {"contype": 1, "conaffinity": 2}, {"contype": 1, "conaffinity": 2 | 4}
ROCK_BITS, GROUND_BITS = {"contype": 2, "conaffinity": 1}, {"contype": 4, "conaffinity": 0}
HARD_BRAKE = (0.9999, 0.9999, 0.001, 0.5, 2)  # solimp: by default a braked wheel creeps 0.1 mm/s
_NET_FORCE = 3  # reduction of a contact sensor: the sum of all contacts (`netforce` in MuJoCo's XML)
STIFF_ROCK = (0.01, 1)  # solref: contacts end within hundredths of a second, without rebound


GROUND = "ground"  # name of the body with the height fields
# Spacing of their nodes, and nodes along a side of a height field. Only fields whose box reaches the rover's body take
# time, so small fields are faster than a single field.
GROUND_STEP_M, GROUND_TILE = 0.06, 12
_GROUND_BASE_M = 0.5  # thickness of a height field below its lowest node
_FLAT_M = 1e-3  # minimum range of heights of a field
# Links that collide, in the order of the contact sensors; uprights have no shape of their own.
LINKS = (*(f"{code}_wheel" for code in WHEELS), *(f"{code}_arm" for code in WHEELS), "base_link")


def compile_model(vehicle: Vehicle, world: World, rocks: Sequence[RockPart], gravity: float, dt: float) -> Any:
    """Return MuJoCo's model: free `base_link`, three links with one joint each per wheel, a body per rock, the ground.

    After the accelerometer there is a contact sensor for each rock (in the order of `rocks`), then for the ground, and
    each of `LINKS`: the number of contacts, and the force on the rock or the ground, N, in the world frame.
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
    # MuJoCo derives several contacts of a pair from parallel faces: a wheel on the edge of a rock sinks in by 12 mm.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD
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
    _add_ground(mujoco, spec, world, vehicle)
    for shape in vehicle.shapes:
        if shape.link in LINKS and not shape.link.endswith("_wheel"):
            _add_shape(mujoco, spec.body(shape.link), shape, vehicle)
    _add_actuators(mujoco, spec, vehicle)
    sensor, kind = mujoco.mjtSensor, mujoco.mjtObj
    spec.add_sensor(name="imu", type=sensor.mjSENS_ACCELEROMETER, objtype=kind.mjOBJ_SITE, objname="imu")
    field = mujoco.mjtConDataField
    data = 1 << int(field.mjCONDATA_FOUND) | 1 << int(field.mjCONDATA_FORCE)
    for other in (*(f"rock{rock}" for rock in bodies), GROUND):
        for link in LINKS:
            spec.add_sensor(
                type=sensor.mjSENS_CONTACT, objtype=kind.mjOBJ_BODY, objname=link, reftype=kind.mjOBJ_BODY,
                refname=other, intprm=[data, _NET_FORCE, 1],
            )  # fmt: skip
    return spec.compile()


def _add_ground(mujoco: Any, spec: Any, world: World, vehicle: Vehicle) -> None:
    """Add the ground before the drive as height fields side by side."""
    step = max(round(GROUND_STEP_M / world.cell), 1)
    spacing, level = step * world.cell, world.level[::step, ::step]
    body = spec.worldbody.add_body(name=GROUND)
    corners = product(*(range(0, count - 1, GROUND_TILE) for count in level.shape))
    for number, (row, column) in enumerate(corners):
        part = level[row : row + GROUND_TILE + 1, column : column + GROUND_TILE + 1]
        low, extent = float(part.min()), max(float(np.ptp(part)), _FLAT_M)
        half_y, half_x = (spacing * (count - 1) / 2 for count in part.shape)
        spec.add_hfield(
            name=f"{GROUND}{number}", nrow=len(part), ncol=part.shape[1], size=[half_x, half_y, extent, _GROUND_BASE_M],
            userdata=((part - low) / extent).ravel(),
        )  # fmt: skip
        centre = world.x0 + spacing * column + half_x, world.y0 + spacing * row + half_y
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname=f"{GROUND}{number}", pos=[*centre, low], solref=STIFF_ROCK,
            friction=_friction(vehicle), **GROUND_BITS,
        )  # fmt: skip


def _add_shape(mujoco: Any, body: Any, shape: ShapePart, vehicle: Vehicle) -> None:
    """Add a box or a cylinder of the vehicle's table as a geom."""
    pose = link_from_part(shape.position_m, shape.yaw_deg, shape.pitch_deg, shape.roll_deg)
    rotation, size = pose.rotation, np.array(shape.size_m) / 2
    kind = mujoco.mjtGeom.mjGEOM_BOX
    if shape.kind == "cylinder":  # along y in the table, along z in MuJoCo
        kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, size[[0, 1, 1]]
        rotation = rotation @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    body.add_geom(
        type=kind, size=size, pos=pose.translation, quat=[w, x, y, z], solref=STIFF_ROCK, friction=_friction(vehicle),
        **BODY_BITS,
    )  # fmt: skip


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
        name=f"{code}_rim", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[wheel.outer_radius_m, wheel.width_m / 2, 0],
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
