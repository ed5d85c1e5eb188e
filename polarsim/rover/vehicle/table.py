"""Table of the rover's parts, the source of physics, URDF, cameras and pictures.

`base_link`: x forward, y left, z up, origin midway between the four axles at their height. Each wheel is attached by
three links with a joint each: `<code>_arm` slides vertically on the chassis, `<code>_upright` steers on the arm,
`<code>_wheel` spins on the upright; joints are `<code>_lift`, `<code>_steer`, `<code>_spin`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from pydantic import BaseModel, Field, PositiveFloat, model_validator

from polarsim.errors import ConfigError
from polarsim.formats.yaml_files import read_model

WHEELS = ("lf", "rf", "lr", "rr")  # left front, right front, left rear, right rear: the order of all arrays
WheelCode = Literal["lf", "rf", "lr", "rr"]
Triple = tuple[float, float, float]


class VehicleSection(BaseModel, extra="forbid", frozen=True):
    """A section of the table."""


class Chassis(VehicleSection):
    """Rigid body of `base_link`."""

    mass_kg: PositiveFloat = Field(description="Mass of body and mast without suspension and wheels, kg.")
    position_m: Triple = Field(description="Centre of mass in base_link, m.")
    size_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(
        description="Length, width, height of the box that defines the inertia, m."
    )

    def inertia(self) -> np.ndarray:
        """Return (3,) kg m2 of the box about its centre, along x, y, z."""
        x, y, z = self.size_m
        return self.mass_kg / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])


class WheelPart(VehicleSection):
    """A wheel with its arm and upright."""

    code: WheelCode = Field(description="lf, rf, lr or rr.")
    position_m: Triple = Field(description="Centre in base_link with the suspension at rest, m.")
    radius_m: PositiveFloat = Field(description="Radius of the rim, m.")
    width_m: PositiveFloat = Field(description="Width of the rim, m.")
    mass_kg: PositiveFloat = Field(description="Mass of the rotating part, kg.")
    arm_mass_kg: PositiveFloat = Field(description="Mass of the parts that slide but do not steer, kg.")
    upright_mass_kg: PositiveFloat = Field(description="Mass of the parts that steer but do not rotate, kg.")
    grousers: int = Field(
        0,
        ge=0,
        description="Number of straight grousers around the rim. If no wheel has any, rims slide on the soil with two "
        "thirds of its friction angle and without cohesion.",
    )
    grouser_height_m: float = Field(
        0.0, ge=0, description="Height above the rim, m; soil and rocks touch a wheel at the tips."
    )
    grouser_thickness_m: float = Field(0.0, ge=0, description="Thickness along the rim, m.")

    @model_validator(mode="after")
    def _grousers_have_a_height(self) -> WheelPart:
        if (self.grousers > 0) != (self.grouser_height_m > 0):
            raise ValueError(
                f"wheel {self.code}: grousers {self.grousers} and grouser_height_m {self.grouser_height_m:g}, "
                "expected both or neither above 0"
            )
        return self

    @property
    def outer_radius_m(self) -> float:
        """Radius at the tips of the grousers, m: soil between them moves with the wheel, so tips carry and roll."""
        return self.radius_m + self.grouser_height_m

    def inertia(self) -> np.ndarray:
        """Return (3,) kg m2 of the rotating part, a solid cylinder along y."""
        axial = self.mass_kg * self.radius_m**2 / 2
        across = self.mass_kg * (3 * self.radius_m**2 + self.width_m**2) / 12
        return np.array([across, axial, across])


def cube_inertia(mass: float, side: float = 0.2) -> np.ndarray:
    """Return (3,) kg m2 of a cube of `side` metres, for arms and uprights, which are small and rotate little."""
    return np.full(3, mass * side**2 / 6)


class Steering(VehicleSection):
    """Steering of each wheel about the vertical axis through its centre."""

    limit_deg: float = Field(gt=0, le=180, description="Maximum angle in both directions, degrees.")
    rate_deg_s: PositiveFloat = Field(description="Maximum rate, degrees per second.")
    stiffness_n_m_rad: PositiveFloat = Field(description="Stiffness of the position servo, N m per rad.")
    damping_n_m_s_rad: PositiveFloat = Field(description="Damping of the joint, N m s per rad.")
    torque_limit_n_m: PositiveFloat = Field(description="Maximum torque of the servo, N m.")
    armature_kg_m2: float = Field(0.0, ge=0, description="Inertia of the rotor at the joint, kg m2.")


class Suspension(VehicleSection):
    """A spring and a damper at each corner, along base_link's z axis."""

    stiffness_n_m: PositiveFloat = Field(description="Stiffness, N per m; the wheel is at its position without force.")
    damping_n_s_m: PositiveFloat = Field(description="Damping, N s per m.")
    travel_m: PositiveFloat = Field(description="Maximum travel in both directions, m.")


class WheelServo(VehicleSection):
    """A speed servo in each wheel."""

    gain_n_m_s_rad: PositiveFloat = Field(description="Torque per error of wheel speed, N m s per rad.")
    torque_limit_n_m: PositiveFloat = Field(description="Maximum torque of the motor, N m.")
    brake_torque_n_m: PositiveFloat = Field(description="Friction torque of the brake of a stationary wheel, N m.")
    acceleration_m_s2: PositiveFloat = Field(description="Maximum rate of the rim's commanded speed, m/s2.")
    damping_n_m_s_rad: float = Field(0.0, ge=0, description="Friction of the bearing, N m s per rad.")
    armature_kg_m2: float = Field(0.0, ge=0, description="Inertia of the rotor at the wheel, kg m2.")


class CameraPart(VehicleSection):
    """A pinhole camera; with all angles 0 the view is along the link's x axis and z is up."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Name in files, frames and topics.")
    link: str = Field("base_link", description="Link that carries the camera.")
    position_m: Triple = Field(description="Position in the link's frame, m.")
    yaw_deg: float = Field(0.0, description="Angle from x towards y (left), degrees.")
    pitch_deg: float = Field(0.0, description="Angle downwards, degrees.")
    roll_deg: float = Field(0.0, description="Rotation of the right axis downwards, degrees.")
    width_px: int = Field(gt=0, description="Width of the image, px.")
    height_px: int = Field(gt=0, description="Height of the image, px.")
    hfov_deg: float | None = Field(None, gt=0, lt=180, description="Horizontal field of view, degrees.")
    focal_px: PositiveFloat | None = Field(None, description="Focal length, px; alternative to hfov_deg.")

    @model_validator(mode="after")
    def _one_lens(self) -> CameraPart:
        if (self.hfov_deg is None) == (self.focal_px is None):
            raise ValueError(f"camera {self.name}: expected either hfov_deg or focal_px")
        return self

    @property
    def focal(self) -> float:
        """Focal length, px."""
        if self.focal_px is not None:
            return self.focal_px
        assert self.hfov_deg is not None
        return self.width_px / 2 / math.tan(math.radians(self.hfov_deg) / 2)


class LightPart(VehicleSection):
    """A lamp; with all angles 0 the beam is along the link's x axis."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Name of the lamp.")
    link: str = Field("base_link", description="Link that carries the lamp.")
    position_m: Triple = Field(description="Position in the link's frame, m.")
    yaw_deg: float = Field(0.0, description="Angle from x towards y (left), degrees.")
    pitch_deg: float = Field(0.0, description="Angle downwards, degrees.")
    beam_deg: float = Field(gt=0, lt=180, description="Full angle of the beam at half intensity, degrees.")
    power_w: PositiveFloat = Field(10.0, description="Radiated light, W.")


_Named = TypeVar("_Named", CameraPart, LightPart)


class ShapePart(VehicleSection):
    """A simple body for shadows and pictures."""

    name: str = Field(description="Name of the part.")
    link: str = Field("base_link", description="base_link, <code>_arm, <code>_upright or <code>_wheel.")
    kind: Literal["box", "cylinder"] = Field(description="Shape; the axis of a cylinder is y before rotation.")
    position_m: Triple = Field((0.0, 0.0, 0.0), description="Centre in the link's frame, m.")
    size_m: Triple = Field(description="Box: length, width, height; cylinder: diameter, length along y, diameter; m.")
    yaw_deg: float = Field(0.0, description="Rotation about z (before pitch about the new y and roll), degrees.")
    pitch_deg: float = Field(0.0, description="Angle downwards, degrees.")
    roll_deg: float = Field(0.0, description="Rotation about the new x, degrees.")
    albedo: float = Field(0.3, ge=0, le=1, description="Share of reflected light.")


class Vehicle(VehicleSection):
    """A four-wheeled rover."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Name of the robot.")
    source: str = Field(min_length=1, description="Source of the numbers.")
    chassis: Chassis
    wheels: tuple[WheelPart, ...] = Field(description="lf, rf, lr, rr, in this order.")
    steering: Steering
    suspension: Suspension
    drive: WheelServo
    friction_on_rock: float = Field(
        gt=0, description="Coulomb friction coefficient of the rover on rocks, and of body and legs on the ground."
    )
    cameras: tuple[CameraPart, ...] = ()
    lights: tuple[LightPart, ...] = ()
    shapes: tuple[ShapePart, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Vehicle:
        if tuple(wheel.code for wheel in self.wheels) != WHEELS:
            raise ValueError(f"expected wheels {', '.join(WHEELS)} in this order")
        links = set(self.links)
        fixed: dict[str, Sequence[CameraPart | LightPart | ShapePart]] = {
            "camera": self.cameras, "light": self.lights, "shape": self.shapes,
        }  # fmt: skip
        for what, parts in fixed.items():
            names = [part.name for part in parts]
            for number, part in enumerate(parts):
                if part.link not in links:
                    raise ValueError(f"{what} {part.name}: unknown link {part.link!r}")
                if part.name in names[:number]:
                    raise ValueError(f"{what} {part.name} is defined twice")
        return self

    @property
    def links(self) -> tuple[str, ...]:
        """Names of all links: `base_link`, then arm, upright and wheel of each corner."""
        return ("base_link", *(f"{code}_{part}" for code in WHEELS for part in ("arm", "upright", "wheel")))

    @property
    def mass(self) -> float:
        """Mass of all parts, kg."""
        return self.chassis.mass_kg + sum(w.mass_kg + w.arm_mass_kg + w.upright_mass_kg for w in self.wheels)

    @property
    def wheelbase(self) -> float:
        return self.wheels[0].position_m[0] - self.wheels[2].position_m[0]

    @property
    def wheel_centres(self) -> np.ndarray:
        """(4, 3) positions in base_link with the suspension at rest, m."""
        return np.array([wheel.position_m for wheel in self.wheels])

    def camera(self, name: str) -> CameraPart:
        """Return a camera by name; an unknown name is a `ConfigError`."""
        return self._part("camera", self.cameras, name)

    def light(self, name: str) -> LightPart:
        """Return a light by name; an unknown name is a `ConfigError`."""
        return self._part("light", self.lights, name)

    def _part(self, kind: str, parts: Sequence[_Named], name: str) -> _Named:
        by_name = {part.name: part for part in parts}
        if name not in by_name:
            raise ConfigError(f"unknown {kind} {name!r}, {self.name} has {', '.join(by_name)}")
        return by_name[name]


def read_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle's table; an error is one line with the file and each invalid key."""
    return read_model(path, Vehicle, "the table")
