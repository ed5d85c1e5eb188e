"""Write the vehicle as URDF: three links per wheel (suspension, steering, drive), a link per camera and light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.formats.files import write_text
from polarsim.geometry.poses import Pose
from polarsim.rover.vehicle.camera_names import FOLLOWING
from polarsim.rover.vehicle.mounts import link_from_part, mount_of
from polarsim.rover.vehicle.table import Vehicle, WheelPart, cube_inertia

_FREE = 1e4  # N and rad/s where the table has no limit; URDF requires a value


def write_urdf(path: Path, vehicle: Vehicle) -> None:
    """Write a vehicle as URDF; equal tables give equal bytes."""
    write_text(path, urdf(vehicle))


def urdf(vehicle: Vehicle) -> str:
    """Return the robot as text, without the stiffness of the suspension, since URDF has no springs."""
    robot = ET.Element("robot", name=vehicle.name)
    base = ET.SubElement(robot, "link", name="base_link")
    _inertial(base, vehicle.chassis.mass_kg, vehicle.chassis.inertia(), vehicle.chassis.position_m)
    _visuals(base, vehicle, "base_link")
    for wheel in vehicle.wheels:
        _corner(robot, vehicle, wheel)
    mounted = [  # following cameras have no link; a light shines along x
        (camera.name, camera.link, f"{camera.name}_optical", mount_of(camera).base_from_camera)
        for camera in vehicle.cameras
        if camera.name not in FOLLOWING
    ]
    for light in vehicle.lights:
        pose = link_from_part(light.position_m, light.yaw_deg, light.pitch_deg)
        mounted.append((light.name, light.link, light.name, pose))
    for name, parent, child, pose in mounted:
        ET.SubElement(robot, "link", name=child)
        _origin(_joint(robot, f"{name}_mount", "fixed", parent, child), pose)
    ET.indent(robot)
    return '<?xml version="1.0"?>\n' + ET.tostring(robot, encoding="unicode") + "\n"


def _corner(robot: ET.Element, vehicle: Vehicle, wheel: WheelPart) -> None:
    """Add the links and joints of a wheel: `base_link` - lift - arm - steer - upright - spin - wheel."""
    code, spring, steering, drive = wheel.code, vehicle.suspension, vehicle.steering, vehicle.drive
    for name, mass, inertia in (
        ("arm", wheel.arm_mass_kg, cube_inertia(wheel.arm_mass_kg)),
        ("upright", wheel.upright_mass_kg, cube_inertia(wheel.upright_mass_kg)),
        ("wheel", wheel.mass_kg, wheel.inertia()),
    ):
        link = ET.SubElement(robot, "link", name=f"{code}_{name}")
        _inertial(link, mass, inertia, (0.0, 0.0, 0.0))
        _visuals(link, vehicle, f"{code}_{name}")
        if name == "wheel":
            collision = ET.SubElement(link, "collision")
            _origin(collision, _lying(Pose.identity()))
            _cylinder(collision, 2 * wheel.outer_radius_m, wheel.width_m)
    lift = _joint(robot, f"{code}_lift", "prismatic", "base_link", f"{code}_arm", (0, 0, 1))
    _origin(lift, Pose(np.eye(3), np.array(wheel.position_m)))
    _limit(lift, _FREE, _FREE, spring.travel_m, spring.damping_n_s_m)
    steer = _joint(robot, f"{code}_steer", "revolute", f"{code}_arm", f"{code}_upright", (0, 0, 1))
    limit, rate = math.radians(steering.limit_deg), math.radians(steering.rate_deg_s)
    _limit(steer, steering.torque_limit_n_m, rate, limit, steering.damping_n_m_s_rad)
    spin = _joint(robot, f"{code}_spin", "continuous", f"{code}_upright", f"{code}_wheel", (0, 1, 0))
    _limit(spin, drive.torque_limit_n_m, _FREE, None, drive.damping_n_m_s_rad)


def _joint(
    robot: ET.Element, name: str, kind: str, parent: str, child: str, axis: Sequence[float] | None = None
) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    if axis:
        ET.SubElement(joint, "axis", xyz=_text(axis))
    return joint


def _limit(joint: ET.Element, effort: float, rate: float, reach: float | None, damping: float) -> None:
    """Set symmetric limits and the damping; a wheel has no position limit."""
    limit = ET.SubElement(joint, "limit", effort=_number(effort), velocity=_number(rate))
    if reach is not None:
        limit.set("lower", _number(-reach))
        limit.set("upper", _number(reach))
    ET.SubElement(joint, "dynamics", damping=_number(damping))


def _inertial(link: ET.Element, mass: float, inertia: np.ndarray, centre: Sequence[float]) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(centre))
    ET.SubElement(inertial, "mass", value=_number(mass))
    x, y, z = (_number(value) for value in inertia)
    ET.SubElement(inertial, "inertia", ixx=x, iyy=y, izz=z, ixy="0", ixz="0", iyz="0")


def _visuals(link: ET.Element, vehicle: Vehicle, name: str) -> None:
    for shape in vehicle.shapes:
        if shape.link != name:
            continue
        visual = ET.SubElement(link, "visual", name=shape.name)
        pose = link_from_part(shape.position_m, shape.yaw_deg, shape.pitch_deg, shape.roll_deg)
        if shape.kind == "box":
            _origin(visual, pose)
            ET.SubElement(ET.SubElement(visual, "geometry"), "box", size=_text(shape.size_m))
        else:
            _origin(visual, _lying(pose))
            _cylinder(visual, shape.size_m[0], shape.size_m[1])
        material = ET.SubElement(visual, "material", name=f"{shape.name}_grey")
        ET.SubElement(material, "color", rgba=_text([*[shape.albedo] * 3, 1.0]))


def _cylinder(parent: ET.Element, diameter: float, length: float) -> None:
    ET.SubElement(ET.SubElement(parent, "geometry"), "cylinder", radius=_number(diameter / 2), length=_number(length))


def _lying(link_from_cylinder: Pose) -> Pose:
    """Rotate a cylinder from the table's axis y to URDF's axis z."""
    return link_from_cylinder @ Pose.from_rotvec(np.array([math.pi / 2, 0, 0]), np.zeros(3))


def _origin(parent: ET.Element, parent_from_own: Pose) -> None:
    """Add an origin; URDF's roll, pitch, yaw rotate about the fixed axes x, y, z in this order."""
    angles = Rotation.from_matrix(parent_from_own.rotation).as_euler("xyz")
    ET.SubElement(parent, "origin", xyz=_text(parent_from_own.translation), rpy=_text(angles))


def _text(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(_number(value) for value in values)


def _number(value: float) -> str:
    """Format with nine digits, since further digits of rotated angles differ between machines."""
    return f"{round(float(value), 9) + 0.0:.9g}"
