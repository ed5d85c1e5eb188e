"""The rover as one table: the physics, the URDF, the cameras and the pictures all read it.

`base_link`: x forward, y left, z up, its origin midway between the four axles at their height. Each wheel hangs on
three links, one joint each: `<code>_arm` slides up and down on the chassis, `<code>_upright` steers on the arm,
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


class Section(BaseModel, extra="forbid", frozen=True):
    """A section of the table."""


class Chassis(Section):
    """All that moves as one with `base_link`."""

    mass_kg: PositiveFloat = Field(description="Mass of body and mast, without what hangs below, kg.")
    position_m: Triple = Field(description="Centre of mass in base_link, m.")
    size_m: tuple[PositiveFloat, PositiveFloat, PositiveFloat] = Field(
        description="Length, width, height of the box whose inertia it has, m."
    )

    def inertia(self) -> np.ndarray:
        """(3,) kg m2 of the box about its centre, along x, y, z."""
        x, y, z = self.size_m
        return self.mass_kg / 12 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])


class WheelPart(Section):
    """One wheel and what holds it."""

    code: WheelCode = Field(description="lf, rf, lr or rr.")
    position_m: Triple = Field(description="Centre in base_link with the suspension at rest, m.")
    radius_m: PositiveFloat = Field(description="Of the rim, m.")
    width_m: PositiveFloat = Field(description="Of the rim, m.")
    mass_kg: PositiveFloat = Field(description="Of the rotating part, kg.")
    arm_mass_kg: PositiveFloat = Field(description="Of what slides with the suspension and does not steer, kg.")
    upright_mass_kg: PositiveFloat = Field(description="Of what steers and does not rotate, kg.")
    grousers: int = Field(0, ge=0, description="Straight grousers round the rim.")
    grouser_height_m: float = Field(0.0, ge=0, description="Beyond the rim, m.")
    grouser_thickness_m: float = Field(0.0, ge=0, description="Along the rim, m.")

    def inertia(self) -> np.ndarray:
        """(3,) kg m2 of the rotating part, a solid cylinder along y."""
        axial = self.mass_kg * self.radius_m**2 / 2
        across = self.mass_kg * (3 * self.radius_m**2 + self.width_m**2) / 12
        return np.array([across, axial, across])


def cube_inertia(mass: float, side: float = 0.2) -> np.ndarray:
    """(3,) kg m2 of a cube of `side` metres: arms and uprights are small, and their rotation matters little."""
    return np.full(3, mass * side**2 / 6)


class Steering(Section):
    """Of every wheel on its own, about the vertical through its centre."""

    limit_deg: float = Field(gt=0, le=180, description="Largest angle either way, degrees.")
    rate_deg_s: PositiveFloat = Field(description="Fastest rotation, degrees per second.")
    stiffness_n_m_rad: PositiveFloat = Field(description="Of the position servo, N m per rad.")
    damping_n_m_s_rad: PositiveFloat = Field(description="Of the joint, N m s per rad.")
    torque_limit_n_m: PositiveFloat = Field(description="The servo gives no more, N m.")
    armature_kg_m2: float = Field(0.0, ge=0, description="Rotor's inertia seen at the joint, kg m2.")


class Suspension(Section):
    """A spring and a damper under each corner, along base_link's z."""

    stiffness_n_m: PositiveFloat = Field(description="N per m; without force the wheel hangs at its position.")
    damping_n_s_m: PositiveFloat = Field(description="N s per m.")
    travel_m: PositiveFloat = Field(description="Either way, m.")


class Drive(Section):
    """A speed servo in every wheel."""

    gain_n_m_s_rad: PositiveFloat = Field(description="Torque per error of wheel speed, N m s per rad.")
    torque_limit_n_m: PositiveFloat = Field(description="The motor gives no more, N m.")
    brake_torque_n_m: PositiveFloat = Field(description="Holds a wheel that is to stand, N m.")
    acceleration_m_s2: PositiveFloat = Field(description="Fastest change of the rim's commanded speed, m/s2.")
    damping_n_m_s_rad: float = Field(0.0, ge=0, description="Friction of the bearing, N m s per rad.")
    armature_kg_m2: float = Field(0.0, ge=0, description="Rotor's inertia seen at the wheel, kg m2.")


class CameraPart(Section):
    """A pinhole camera; with all angles 0 it looks along the link's x and z is up."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Of files, frames and topics.")
    link: str = Field("base_link", description="What it is fixed to.")
    position_m: Triple = Field(description="In the link's frame, m.")
    yaw_deg: float = Field(0.0, description="From x towards y (left), degrees.")
    pitch_deg: float = Field(0.0, description="Down is positive, degrees.")
    roll_deg: float = Field(0.0, description="Rotates the right axis towards down, degrees.")
    width_px: int = Field(gt=0, description="Pixels across.")
    height_px: int = Field(gt=0, description="Pixels down.")
    hfov_deg: float | None = Field(None, gt=0, lt=180, description="Horizontal field of view, degrees.")
    focal_px: PositiveFloat | None = Field(None, description="Focal length, px; this or hfov_deg.")

    @model_validator(mode="after")
    def _one_lens(self) -> CameraPart:
        if (self.hfov_deg is None) == (self.focal_px is None):
            raise ValueError(f"camera {self.name}: one of hfov_deg and focal_px was expected")
        return self

    @property
    def focal(self) -> float:
        """Pixels."""
        if self.focal_px is not None:
            return self.focal_px
        assert self.hfov_deg is not None
        return self.width_px / 2 / math.tan(math.radians(self.hfov_deg) / 2)


class LightPart(Section):
    """A lamp; with all angles 0 it shines along the link's x."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Of the lamp.")
    link: str = Field("base_link", description="What it is fixed to.")
    position_m: Triple = Field(description="In the link's frame, m.")
    yaw_deg: float = Field(0.0, description="From x towards y (left), degrees.")
    pitch_deg: float = Field(0.0, description="Down is positive, degrees.")
    beam_deg: float = Field(gt=0, lt=180, description="Full angle between directions of half its intensity, degrees.")
    power_w: PositiveFloat = Field(10.0, description="Light that it radiates, W.")


_Named = TypeVar("_Named", CameraPart, LightPart)


class ShapePart(Section):
    """A simple body for shadows and pictures."""

    name: str = Field(description="What it stands for.")
    link: str = Field("base_link", description="base_link, <code>_arm, <code>_upright or <code>_wheel.")
    kind: Literal["box", "cylinder"] = Field(description="A cylinder's axis is y before it is rotated.")
    position_m: Triple = Field((0.0, 0.0, 0.0), description="Of its centre in the link's frame, m.")
    size_m: Triple = Field(description="Box: length, width, height; cylinder: diameter, length along y, diameter; m.")
    yaw_deg: float = Field(0.0, description="Rotation about z, then about the new y, then about the new x, degrees.")
    pitch_deg: float = Field(0.0, description="Down is positive, degrees.")
    roll_deg: float = Field(0.0, description="About x, degrees.")
    albedo: float = Field(0.3, ge=0, le=1, description="Share of light that it sends back.")


class Vehicle(Section):
    """A four-wheeled rover."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="Of the robot.")
    source: str = Field(min_length=1, description="Where the numbers come from.")
    chassis: Chassis
    wheels: tuple[WheelPart, ...] = Field(description="lf, rf, lr, rr, in this order.")
    steering: Steering
    suspension: Suspension
    drive: Drive
    friction_on_rock: float = Field(gt=0, description="Coulomb's coefficient of rim on rock.")
    cameras: tuple[CameraPart, ...] = ()
    lights: tuple[LightPart, ...] = ()
    shapes: tuple[ShapePart, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Vehicle:
        if tuple(wheel.code for wheel in self.wheels) != WHEELS:
            raise ValueError(f"wheels {', '.join(WHEELS)} in this order were expected")
        links = set(self.links)
        fixed: dict[str, Sequence[CameraPart | LightPart | ShapePart]] = {
            "camera": self.cameras, "light": self.lights, "shape": self.shapes,
        }  # fmt: skip
        for what, parts in fixed.items():
            names = [part.name for part in parts]
            for number, part in enumerate(parts):
                if part.link not in links:
                    raise ValueError(f"{what} {part.name}: no link {part.link!r}")
                if part.name in names[:number]:
                    raise ValueError(f"{what} {part.name} comes twice")
        return self

    @property
    def links(self) -> tuple[str, ...]:
        """All links, `base_link` first, then arm, upright and wheel of each corner."""
        return ("base_link", *(f"{code}_{part}" for code in WHEELS for part in ("arm", "upright", "wheel")))

    @property
    def mass(self) -> float:
        """Of all parts, kg."""
        return self.chassis.mass_kg + sum(w.mass_kg + w.arm_mass_kg + w.upright_mass_kg for w in self.wheels)

    @property
    def wheelbase(self) -> float:
        return self.wheels[0].position_m[0] - self.wheels[2].position_m[0]

    @property
    def wheel_centres(self) -> np.ndarray:
        """(4, 3) in base_link with the suspension at rest, m."""
        return np.array([wheel.position_m for wheel in self.wheels])

    def camera(self, name: str) -> CameraPart:
        """One camera.

        Raises
        ------
        ConfigError
            No such camera.
        """
        return self._part("camera", self.cameras, name)

    def light(self, name: str) -> LightPart:
        """One light.

        Raises
        ------
        ConfigError
            No such light.
        """
        return self._part("light", self.lights, name)

    def _part(self, kind: str, parts: Sequence[_Named], name: str) -> _Named:
        for part in parts:
            if part.name == name:
                return part
        raise ConfigError(f"no {kind} {name!r} on {self.name}, there are {', '.join(part.name for part in parts)}")


def read_vehicle(path: str | Path) -> Vehicle:
    """Read a vehicle's table.

    Raises
    ------
    ConfigError
        No YAML, unknown or missing keys, impossible values: one line with the file and each key.
    """
    return read_model(path, Vehicle, "the table")
