"""Parts of a site: tripods, lamps, images, cameras, sandbox, terrains. `site` combines them.

Lengths are metres in the sandbox frame unless a name says otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from math import cos, radians, sin
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, Field, PositiveFloat, PositiveInt, model_validator

from polarsim.photo import CameraSide, Light, Terrain, parse_terrain

Point = tuple[float, float, float]  # x, y, z
Side = Literal["-x", "+x", "-y", "+y"]  # of the sandbox

FILL_IN = "FILL_IN"  # start of a value in the draft of a site file that a person must replace
FAR_M = 1000.0  # distance at which a directional lamp is placed; over 6 m its direction varies by 0.3 degrees

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9-]*")  # a name that is safe in photo keys and paths
MAX_EXPOSURE_MS = 99999  # photo keys have at most five digits
_NO_VALUE = ("na", "nan", "none", "null")  # names that readers of CSV files replace by missing values


def text_of_name(value: object) -> object:
    """Convert a name that YAML reads as a number to text; raise ValueError for a boolean."""
    if isinstance(value, bool):
        raise ValueError("YAML reads on, off, yes, no as booleans: put the name in quotes")
    if isinstance(value, float):
        raise ValueError(f"{value}, expected a whole number or a name")
    return str(value) if isinstance(value, int) else value


def _name(value: object) -> object:
    value = text_of_name(value)
    if isinstance(value, str) and not NAME.fullmatch(value):
        raise ValueError(
            f"{value!r}, expected letters a to z, digits and dashes; state other texts in paths in files.spelling"
        )
    if isinstance(value, str) and value.lower() in _NO_VALUE:
        raise ValueError(f"{value!r} in a table is read as a missing value, expected another name")
    return value


def _terrain(value: object) -> object:
    return parse_terrain(str(_name(value)))


Name = Annotated[str, BeforeValidator(_name)]
TerrainName = Annotated[Terrain, BeforeValidator(_terrain)]


class Part(BaseModel, extra="forbid", frozen=True, allow_inf_nan=False):
    """Part of a site."""


class Tripod(Part):
    """Approximate pose of the left (or only) camera at a position."""

    camera_m: Point = Field(description="Centre of the left camera, sandbox frame, m.")
    yaw_deg: float = Field(description="Heading of the optical axis, from +X towards +Y, degrees.")
    pitch_deg: float = Field(25.0, description="Downward tilt of the optical axis, degrees.")
    usual_pitch_deg: float | None = Field(
        None, description="Mean pitch of rigs that were located here, where known, degrees; null: pitch_deg."
    )
    same_tilt_as: Name | None = Field(None, description="Position with the same tilt: the rig was only moved.")

    @property
    def usual_pitch(self) -> float:
        """Most likely pitch of a rig that is not located, degrees."""
        return self.pitch_deg if self.usual_pitch_deg is None else self.usual_pitch_deg


class SunLamp(Part):
    """A lamp that stands in for the Sun and does not move with the rig."""

    kind: Literal["point", "directional"] = Field(
        "point", description="'point': a lamp near the sandbox, also with a reflector. 'directional': parallel light."
    )
    position_m: Point | None = Field(None, description="Approximate position of a point lamp, sandbox frame, m.")
    radius_m: PositiveFloat = Field(
        0.045, description="Radius of the lit disc of a point lamp, m. A larger disc makes the edges of shadows softer."
    )
    azimuth_deg: float | None = Field(None, description="Direction to a directional lamp, from +X towards +Y, degrees.")
    elevation_deg: float | None = Field(None, description="Elevation of a directional lamp above the horizon, degrees.")

    @model_validator(mode="after")
    def _placed(self) -> SunLamp:
        if (self.kind == "point") != (self.position_m is not None):
            raise ValueError("position_m is required for a point lamp, and only for it")
        if (self.kind == "directional") != (None not in (self.azimuth_deg, self.elevation_deg)):
            raise ValueError("azimuth_deg and elevation_deg are required for a directional lamp, and only for it")
        return self

    @property
    def point(self) -> Point:
        """Position; of a directional lamp `FAR_M` away in its direction."""
        if self.position_m is not None:
            return self.position_m
        assert self.azimuth_deg is not None
        assert self.elevation_deg is not None
        azimuth, elevation = radians(self.azimuth_deg), radians(self.elevation_deg)
        return (
            FAR_M * cos(azimuth) * cos(elevation),
            FAR_M * sin(azimuth) * cos(elevation),
            FAR_M * sin(elevation),
        )


class RigLamp(Part):
    """A lamp that moves with the rig: `on` or `off` in photo keys."""

    from_camera_m: Point = Field(description="Position in the left camera's frame (x right, y down, z forward), m.")
    share: PositiveFloat = Field(description="Radiant intensity relative to a fixed lamp.")


class Images(Part):
    """Format of the photo files."""

    width: PositiveInt = Field(le=16384, description="Width of the photos, px.")
    height: PositiveInt = Field(le=16384, description="Height of the photos, px.")
    bits: int = Field(12, ge=8, le=16, description="Bits of a value. Files with more bits hold them in the low bits.")
    black: int = Field(16, ge=0, description="Value of an unlit pixel.")
    white: PositiveInt | None = Field(None, description="Value of a saturated pixel; null: the largest value.")
    curve: Literal["linear", "srgb"] = Field(
        "linear", description="'linear': values are proportional to light. 'srgb': values of JPEG files of cameras."
    )

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.width, self.height

    @property
    def white_level(self) -> int:
        """Value of a saturated pixel."""
        return self.white if self.white is not None else 2**self.bits - 1

    @model_validator(mode="after")
    def _levels(self) -> Images:
        if not self.black < self.white_level < 2**self.bits:
            raise ValueError(f"black {self.black}, white {self.white_level}: expected black < white < {2**self.bits}")
        return self


class Cameras(Part):
    """Camera or stereo rig."""

    stereo: bool = Field(True, description="Two cameras, L and R. False: one camera, named L.")
    baseline_m: tuple[PositiveFloat, PositiveFloat] | None = Field(
        None, description="Smallest and largest plausible distance of the two cameras, m. Required for stereo."
    )
    calibration: Path | None = Field(
        None,
        description="Calibration for terrains without a calibration file, relative to the site file: NASA's "
        "stereo.calibration, OpenCV YAML, Kalibr YAML or COLMAP cameras.txt (and images.txt).",
    )

    field_of_view_deg: float | None = Field(
        None, gt=1, lt=150, description="Horizontal field of view of terrains without a calibration, degrees."
    )

    @model_validator(mode="after")
    def _baseline(self) -> Cameras:
        if self.stereo and self.baseline_m is None:
            raise ValueError("baseline_m is required for two cameras")
        if self.baseline_m and self.baseline_m[0] > self.baseline_m[1]:
            raise ValueError("baseline_m: the smallest distance exceeds the largest")
        return self

    @property
    def sides(self) -> tuple[CameraSide, ...]:
        """Names of the cameras."""
        return ("L", "R") if self.stereo else ("L",)


class Sandbox(Part):
    """Size and walls of the sandbox."""

    half_width_m: tuple[PositiveFloat, PositiveFloat] = Field(description="Half the size along X and Y, m.")
    walls_m: Mapping[Side, PositiveFloat | None] = Field(
        {},
        description="Height of the wall on each side (-x, +x, -y, +y) above the ground, m; null: none.",
    )
    raised: bool = Field(
        False, description="The sandbox is a box on a floor that the scans show: it defines origin and heading."
    )

    @property
    def reach_m(self) -> float:
        """Distance of the corners from the origin along the longer axis."""
        return max(self.half_width_m)

    @property
    def is_walled(self) -> bool:
        """Whether all four sides have a wall."""
        return all(self.walls_m.get(side) for side in ("-x", "+x", "-y", "+y"))


class Missing(Part):
    """Photos that do not exist: all that match every stated field."""

    positions: tuple[Name, ...] | None = Field(None, description="Positions of these photos; null: all.")
    lights: tuple[Annotated[Light, BeforeValidator(text_of_name)], ...] | None = Field(
        None, description="States of the rig's lamp, 'on' or 'off'; null: both."
    )
    azimuths: tuple[Name, ...] | None = Field(None, description="Lamps of these photos, or 'no'; null: all.")

    def matches(self, position: str, light: str, azimuth: str) -> bool:
        """Return whether photos with these fields are missing."""
        pairs = ((position, self.positions), (light, self.lights), (azimuth, self.azimuths))
        return all(names is None or value in names for value, names in pairs)


class TerrainOptions(Part):
    """Name of a terrain, and where it differs from the site."""

    name: str = Field("", pattern=r"^[A-Za-z0-9-]*$", description="Name in folders of raw data: Terrain01_NAME.")
    positions: tuple[Name, ...] | None = Field(None, description="Positions; null: those of the site.")
    exposures_ms: tuple[PositiveInt, ...] | None = Field(None, description="Exposures with a lamp, ms; null: site's.")
    missing: tuple[Missing, ...] = Field((), description="Photos that do not exist.")
    sandbox: Sandbox | None = Field(None, description="Another sandbox; null: the site's.")
    surveyed: bool = Field(True, description="Tripods and lamps of the site apply to this terrain.")


class AnalogSite(Part):
    """Properties of the simulated sandbox of a site (source.kind: analog) that do not follow from the site."""

    scenes: Mapping[TerrainName, Annotated[int, Field(ge=1, le=13)]] = Field(
        {},
        description="Preset of rocks and ground: the number of one of NASA's terrains. Default: 1, 3, 4, ... in order.",
    )
    scanned: tuple[Name, ...] | None = Field(None, description="Positions with a scan; null: all.")
    tripods_m: Mapping[Name, Point] = Field(
        {}, description="Mean positions of the left camera, sandbox frame, m. Default: the approximate poses."
    )
    lamp_output: Mapping[Name, PositiveFloat] = Field(
        {},
        description="Radiant intensity of lamps relative to one that exposes level sand well at the usual exposure. "
        "Default: the value at which the sand at the centre is as bright as below NASA's lamp 30.",
    )


class ImageIds(Part):
    """Numbering of the photos in COCO files.

    The number of a photo is made of the terrain, the number of the position in the list of the terrain, the light, the
    number of the lamp, the camera and the exposure. Thus a terrain, position or lamp that is added at the end of its
    list keeps the numbers of all former photos.
    """

    positions: PositiveInt = Field(256, description="Largest number of positions of a terrain.")
    lamps: PositiveInt = Field(32, description="Largest number of lamps, 'no' included.")
    exposures_ms: tuple[PositiveInt, ...] | None = Field(
        None, description="Exposures, ms, in the order of their numbers; null: the exposure is the number."
    )


class Licence(Part):
    """Terms under which the photos may be published."""

    terms: str = Field(min_length=1, description="Name or summary of the terms, for data cards.")
    url: str = Field("", description="Address of the text.")
