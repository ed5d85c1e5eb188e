"""The rover and its rocks as a MuJoCo model; the ground is not in it, for its forces are ours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from polarsim.errors import RoverError
from polarsim.rover.vehicle.table import Vehicle, WheelPart, cube_inertia
from polarsim.rover.world.hulls import RockPart

# MuJoCo's bits: wheels meet rocks, and nothing else meets anything.
WHEEL_BITS: dict[str, Any] = {"contype": "1", "conaffinity": "2"}
ROCK_BITS: dict[str, Any] = {"contype": "2", "conaffinity": "1"}
HARD_BRAKE = "0.9999 0.9999 0.001 0.5 2"  # solimp: MuJoCo's own gives way by a tenth of a millimetre per second
STIFF_ROCK = "0.01 1"  # solref: a touch is over in hundredths of a second, without rebound


def import_mujoco() -> Any:
    """The package, asked for where it is used.

    Raises
    ------
    RoverError
        It is not installed.
    """
    try:
        import mujoco
    except ImportError as error:
        raise RoverError(
            "the rover drives with MuJoCo, which is not installed: pip install 'polarsim[rover]'"
        ) from error
    return mujoco


def compile_model(vehicle: Vehicle, rocks: Sequence[RockPart], gravity: float, dt: float) -> Any:
    """Return MuJoCo's model; see `model_xml`."""
    return import_mujoco().MjModel.from_xml_string(model_xml(vehicle, rocks, gravity, dt))


def model_xml(vehicle: Vehicle, rocks: Sequence[RockPart], gravity: float, dt: float) -> str:
    """Return the model as MJCF: free `base_link`, for each wheel three links with one joint each, a body a rock.

    A contact sensor for each rock and wheel follows the accelerometer, rock by rock in the order of `rocks`, wheels in
    that of the vehicle: whether they touch, and the contact's normal.
    """
    root = ET.Element("mujoco", model=vehicle.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false")
    option = ET.SubElement(
        root, "option", timestep=f"{dt!r}", gravity=f"0 0 {-gravity!r}", integrator="implicitfast", cone="elliptic"
    )
    # A broken state is to be seen, not put back to the start.
    ET.SubElement(option, "flag", energy="enable", autoreset="disable")
    asset, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
    chassis = vehicle.chassis
    base = ET.SubElement(world, "body", name="base_link")
    ET.SubElement(base, "freejoint", name="base")
    _inertial(base, chassis.mass_kg, chassis.inertia(), chassis.position_m)
    ET.SubElement(base, "site", name="imu")
    for wheel in vehicle.wheels:
        _corner(base, vehicle, wheel)
    bodies: dict[int, ET.Element] = {}
    for number, part in enumerate(rocks):
        ET.SubElement(asset, "mesh", name=f"part{number}", vertex=_text(part.corners.ravel()))
        if part.rock not in bodies:
            bodies[part.rock] = ET.SubElement(world, "body", name=f"rock{part.rock}")
        ET.SubElement(
            bodies[part.rock], "geom", type="mesh", mesh=f"part{number}", solref=STIFF_ROCK,
            friction=f"{vehicle.friction_on_rock!r} 0.005 0.0001", **ROCK_BITS,
        )  # fmt: skip
    _actuators(root, vehicle)
    sensors = ET.SubElement(root, "sensor")
    ET.SubElement(sensors, "accelerometer", name="imu", site="imu")
    for rock in bodies:
        for wheel in vehicle.wheels:
            ET.SubElement(sensors, "contact", geom1=f"{wheel.code}_rim", body2=f"rock{rock}", data="found normal")
    return ET.tostring(root, encoding="unicode")


def _corner(base: ET.Element, vehicle: Vehicle, wheel: WheelPart) -> None:
    spring, steering, drive = vehicle.suspension, vehicle.steering, vehicle.drive
    code, limit = wheel.code, float(np.radians(steering.limit_deg))
    arm = ET.SubElement(base, "body", name=f"{code}_arm", pos=_text(wheel.position_m))
    _inertial(arm, wheel.arm_mass_kg, cube_inertia(wheel.arm_mass_kg))
    ET.SubElement(
        arm, "joint", name=f"{code}_lift", type="slide", axis="0 0 1", range=_text((-spring.travel_m, spring.travel_m)),
        stiffness=f"{spring.stiffness_n_m!r}", damping=f"{spring.damping_n_s_m!r}",
    )  # fmt: skip
    upright = ET.SubElement(arm, "body", name=f"{code}_upright")
    _inertial(upright, wheel.upright_mass_kg, cube_inertia(wheel.upright_mass_kg))
    ET.SubElement(
        upright, "joint", name=f"{code}_steer", type="hinge", axis="0 0 1", range=_text((-limit, limit)),
        damping=f"{steering.damping_n_m_s_rad!r}", armature=f"{steering.armature_kg_m2!r}",
    )  # fmt: skip
    spinning = ET.SubElement(upright, "body", name=f"{code}_wheel")
    _inertial(spinning, wheel.mass_kg, wheel.inertia())
    ET.SubElement(
        spinning, "joint", name=f"{code}_spin", type="hinge", axis="0 1 0",
        damping=f"{drive.damping_n_m_s_rad!r}", armature=f"{drive.armature_kg_m2!r}",
        solimpfriction=HARD_BRAKE,
    )  # fmt: skip
    ET.SubElement(
        spinning, "geom", name=f"{code}_rim", type="cylinder", size=_text((wheel.radius_m, wheel.width_m / 2)),
        zaxis="0 1 0", solref=STIFF_ROCK, friction=f"{vehicle.friction_on_rock!r} 0.005 0.0001", **WHEEL_BITS,
    )  # fmt: skip


def _actuators(root: ET.Element, vehicle: Vehicle) -> None:
    """Steering servos of all wheels, then their drives: controls 0 to 3 in rad, 4 to 7 in rad/s."""
    actuators, steering, drive = ET.SubElement(root, "actuator"), vehicle.steering, vehicle.drive
    for wheel in vehicle.wheels:
        ET.SubElement(
            actuators, "position", name=f"{wheel.code}_steer", joint=f"{wheel.code}_steer",
            kp=f"{steering.stiffness_n_m_rad!r}", forcerange=_both(steering.torque_limit_n_m),
        )  # fmt: skip
    for wheel in vehicle.wheels:
        ET.SubElement(
            actuators, "velocity", name=f"{wheel.code}_spin", joint=f"{wheel.code}_spin",
            kv=f"{drive.gain_n_m_s_rad!r}", forcerange=_both(drive.torque_limit_n_m),
        )  # fmt: skip


def _inertial(body: ET.Element, mass: float, inertia: np.ndarray, position: Sequence[float] = (0.0, 0.0, 0.0)) -> None:
    ET.SubElement(body, "inertial", pos=_text(position), mass=f"{mass!r}", diaginertia=_text(inertia))


def _both(limit: float) -> str:
    return f"{-limit!r} {limit!r}"


def _text(values: Sequence[float] | np.ndarray) -> str:
    return " ".join(f"{float(value)!r}" for value in values)
