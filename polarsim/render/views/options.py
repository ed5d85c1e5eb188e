"""What a file of views says, checked before anything is rendered."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from polarsim.formats.files import found_from
from polarsim.formats.yaml_files import read_model
from polarsim.photo import HEIGHT, WIDTH
from polarsim.render.options import RenderOptions
from polarsim.survey import ROVER_LIGHT_FROM_LEFT, ROVER_LIGHT_SHARE
from polarsim.user_path import UserPath

Name = Annotated[  # no _: it stands between the parts of file names
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9.-]*$", description="Files of its pictures have this name in theirs.")
]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]  # x, y, z, sandbox frame
FAINTEST_MAG = 7.0  # Hp, of the table of stars


def _in_order(low: Point, high: Point) -> None:
    if any(least > most for least, most in zip(low, high, strict=True)):
        raise ValueError(f"low corner {list(low)} above high corner {list(high)}")


class Section(BaseModel, extra="forbid", frozen=True):
    """A section of the file."""


AnyPart = TypeVar("AnyPart", bound=Section)


class TerrainPart(Section):
    """A terrain is given by its meshes and by where they lie in the scene."""

    meshes: UserPath = Field(description="The terrain's meshes lie in this folder, `results/<run>/meshes/TerrainNN`.")
    terrain: int = Field(ge=1, le=99, description="The terrain has this number in its files' names.")
    offset_m: Point = Field((0, 0, 0), description="The terrain's origin lies here in the scene, metres.")
    heading_deg: Finite = Field(0, description="The terrain's +X points here in the scene, degrees from +X towards +Y.")


class SceneSection(Section):
    """A scene has terrains side by side."""

    name: Name
    terrains: tuple[TerrainPart, ...] = Field(
        min_length=1, description="These terrains make the scene, each at its position."
    )


class RigLens(Section):
    """Pictures are taken through the calibrated rig's lenses."""

    kind: Literal["rig"] = Field("rig", description="This lens is one of the calibrated rig.")
    localised: UserPath | None = Field(
        None, description="The lenses of this PosX.json are used; none: the real rig's stated ones are."
    )

    @model_validator(mode="before")
    @classmethod
    def _by_its_new_name(cls, values: object) -> object:
        if isinstance(values, dict) and "placed" in values:
            raise ValueError("placed is now localised")
        return values


class PinholeLens(Section):
    """The lens has no distortion."""

    kind: Literal["pinhole"] = Field(description="This lens is a pinhole.")
    hfov_deg: float = Field(
        gt=0,
        lt=170,
        description="The lens has this horizontal field of view, degrees; a wider one shows more and smaller.",
    )
    width_px: PositiveInt = Field(WIDTH, le=16384, description="Pictures have this width, px.")
    height_px: PositiveInt = Field(HEIGHT, le=16384, description="Pictures have this height, px.")
    baseline_m: PositiveFloat = Field(
        0.3, description="With `stereo` the right camera stands this far from the left one, metres."
    )


class PointCameras(Section):
    """One camera stands at a point."""

    kind: Literal["point"] = Field(description="One camera stands at a point.")
    name: Name = "point"
    position_m: Point = Field(description="The camera's centre stands here, metres.")
    look_at_m: Point = Field(description="The optical axis goes through this point, metres.")
    roll_deg: Finite = Field(0, description="The camera is rolled by so much, its right side down, degrees.")


class OrbitCameras(Section):
    """Cameras stand on a circle, all looking at one point."""

    kind: Literal["orbit"] = Field(description="Cameras stand on a circle.")
    name: Name = "orbit"
    centre_m: Point = Field(
        (0, 0, 0), description="All cameras look at this point, which the circle lies around, metres."
    )
    radius_m: PositiveFloat = Field(description="The circle has this radius, metres.")
    height_m: Finite = Field(description="The circle lies this high above the centre, metres.")
    number: PositiveInt = Field(description="There are so many cameras.")
    from_deg: Finite = Field(0, description="The first camera stands at this azimuth, degrees from +X towards +Y.")
    over_deg: Finite = Field(360, description="The cameras divide this angle evenly, degrees; 360 is a full circle.")


class PathCameras(Section):
    """A camera drives or flies along a smooth curve and takes evenly spaced frames."""

    kind: Literal["path"] = Field(description="A camera moves along a curve.")
    name: Name = "path"
    waypoints_m: tuple[Point, ...] = Field(min_length=2, description="The curve goes through these points, metres.")
    number: int = Field(
        ge=2, description="There are so many frames, those at the first and the last waypoint included."
    )
    look_at_m: Point | None = Field(
        None, description="All frames look at this point, metres; none: they look ahead along the path."
    )
    pitch_deg: float = Field(
        0, ge=-90, le=90, description="The camera looks down from the path's heading by so much, degrees."
    )


class RandomCameras(Section):
    """Cameras stand anywhere in a box and look at points anywhere in another one."""

    kind: Literal["random"] = Field(description="Cameras stand anywhere in a box.")
    name: Name = "random"
    number: PositiveInt = Field(description="There are so many cameras.")
    low_m: Point = Field(description="This is the low corner of the box of camera centres, metres.")
    high_m: Point = Field(description="This is the high corner of the box, metres.")
    look_at_low_m: Point = Field(
        (-1, -1, 0), description="This is the low corner of the box of points that cameras look at, metres."
    )
    look_at_high_m: Point = Field((1, 1, 0), description="This is the high corner of that box, metres.")
    clearance_m: float = Field(
        0.2, ge=0, description="A camera stands at least this high above what lies beneath it, metres."
    )
    seed: int = Field(0, ge=0, description="Cameras are drawn with this seed.")

    @model_validator(mode="after")
    def _boxes(self) -> RandomCameras:
        _in_order(self.low_m, self.high_m)
        _in_order(self.look_at_low_m, self.look_at_high_m)
        return self


def _utc(moment: datetime) -> datetime:
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


class NearLamps(Section):
    """Lamps stand as in POLAR's hall; lists of azimuths and elevations make a lamp of every pair."""

    kind: Literal["lamp"] = Field(description="The light is a lamp at a finite distance.")
    name: Name = "lamp"
    azimuth_deg: tuple[Finite, ...] = Field(
        min_length=1, description="The light stands at each of these azimuths, from +X towards +Y, degrees."
    )
    elevation_deg: tuple[Annotated[float, Field(gt=0, le=90)], ...] = Field(
        min_length=1, description="The light stands so high above the horizon, degrees."
    )
    distance_m: PositiveFloat = Field(description="The lamp stands so far from `centre_m`, metres.")
    centre_m: Point = Field((0, 0, 0), description="Azimuth, elevation and distance count from this point, metres.")
    intensity: PositiveFloat = Field(
        1, description="The light has this radiant intensity over that of POLAR's Sun lamp."
    )
    radius_m: float = Field(
        0,
        ge=0,
        description="The lamp's disc has this radius, metres; 0: it is a point, whose shadows have sharp edges.",
    )


class Suns(Section):
    """The Sun is 0.53 degrees wide; lists of azimuths and elevations make one of every pair."""

    kind: Literal["sun"] = Field(description="The light is a Sun in a given direction.")
    name: Name = "sun"
    azimuth_deg: tuple[Finite, ...] = Field(
        min_length=1, description="The light stands at each of these azimuths, from +X towards +Y, degrees."
    )
    elevation_deg: tuple[Annotated[float, Field(gt=0, le=90)], ...] = Field(
        min_length=1, description="The light stands so high above the horizon, degrees."
    )
    intensity: PositiveFloat = Field(
        1, description="The Sun has this irradiance over that of POLAR's Sun lamp 4 m away."
    )


class LunarSuns(Section):
    """The real Sun stands over a site on the Moon at moments of time."""

    kind: Literal["lunar_sun"] = Field(description="The light is the Sun over a site on the Moon.")
    name: Name = "moon"
    latitude_deg: float = Field(
        ge=-90, le=90, description="The site has this selenographic latitude, degrees; north is positive."
    )
    longitude_deg: float = Field(
        ge=-180, le=360, description="The site has this selenographic longitude, degrees; east is positive."
    )
    start_utc: Annotated[datetime, AfterValidator(_utc)] = Field(
        description="This is the moment, or the first of several, UTC."
    )
    number: PositiveInt = Field(1, description="There are so many moments, of which those of night are left out.")
    every_h: PositiveFloat = Field(24, description="Two moments lie this far apart, hours.")
    north_deg: Finite = Field(
        90, description="North lies in this direction, degrees from +X towards +Y; at 90 east is +X."
    )
    intensity: PositiveFloat = Field(
        1, description="The Sun has this irradiance over that of POLAR's Sun lamp 4 m away."
    )


class RoverLight(Section):
    """A point of light moves with the camera."""

    states: tuple[bool, ...] = Field(
        (False,), min_length=1, description="The light is off, on, or both; each state makes its pictures."
    )
    intensity: PositiveFloat = Field(
        ROVER_LIGHT_SHARE, description="The light has this radiant intensity over that of POLAR's Sun lamp."
    )
    from_camera_m: Point = Field(
        tuple(ROVER_LIGHT_FROM_LEFT.tolist()),
        description="The light stands at this position in the (left) camera's frame, metres: right, down, forward.",
    )


class AutoExposure(Section):
    """An exposure `auto` is found so."""

    percentile: float = Field(95, gt=0, le=100, description="This percentile of the lit pixels gets the grey value.")
    grey: int = Field(
        3000,
        gt=16,
        le=4095,
        description="The pixel of `percentile` gets this grey value of 12 bits, black level 16 included; a "
        "higher one exposes longer.",
    )
    shortest_ms: PositiveFloat = Field(1, description="Exposures stay at or above this, ms.")
    longest_ms: PositiveFloat = Field(8192, description="Exposures stay at or below this, ms.")


class StarField(Section):
    """Pixels that see no surface show the stars of the Hipparcos catalogue."""

    intensity: float = Field(
        1, ge=0, description="Stars have this flux over that of real ones; at 1 sunlit exposures show hardly one."
    )
    faintest_mag: float = Field(
        FAINTEST_MAG,
        le=FAINTEST_MAG,
        ge=-1,
        description="The faintest stars have this magnitude Hp, which is near the visual one; a larger one "
        "shows more stars.",
    )


class Views(Section):
    """A file of views says what to render, in metres of the sandbox frame: +X to azimuth 0, +Y to 90, +Z up."""

    scenes: tuple[SceneSection, ...] = Field(min_length=1, description="Each of these scenes is seen by all cameras.")
    lens: RigLens | PinholeLens = Field(RigLens(), discriminator="kind", description="All cameras have this lens.")
    stereo: bool = Field(False, description="Every camera is the left one of a pair, the right one takes pictures too.")
    cameras: tuple[
        Annotated[PointCameras | OrbitCameras | PathCameras | RandomCameras, Field(discriminator="kind")], ...
    ] = Field(min_length=1, description="Pictures are taken by each of these cameras.")
    lights: tuple[Annotated[NearLamps | Suns | LunarSuns, Field(discriminator="kind")], ...] = Field(
        min_length=1, description="Each picture is lit by one of these lamps."
    )
    rover_light: RoverLight = Field(RoverLight(), description="The light on the rover shines besides the lamp.")
    exposures_ms: tuple[PositiveFloat | Literal["auto"], ...] = Field(
        ("auto",),
        min_length=1,
        description="Pictures are taken with each of these exposure times, ms; auto: with one that suits the light.",
    )
    auto_exposure: AutoExposure = Field(AutoExposure(), description="This section says how auto exposures are found.")
    combine: Literal["product", "zip"] = Field(
        "product",
        description="Cameras and lights are combined so. product: every camera under every light; zip: the "
        "first camera under the first light, and so on. Either comes in all states of the rover "
        "light, models and exposures.",
    )
    stars: StarField | None = Field(None, description="These stars are in the background; none: it is black.")
    render: RenderOptions = Field(
        RenderOptions(), description="These options are those of a run's configuration; all `models` are rendered."
    )

    @model_validator(mode="after")
    def _each_once(self) -> Views:
        for what, values in (
            ("scenes: name", [scene.name for scene in self.scenes]),
            ("exposures_ms:", list(self.exposures_ms)),
            ("rover_light.states:", list(self.rover_light.states)),
            ("render.models:", list(self.render.models)),
        ):
            twice = [value for number, value in enumerate(values) if value in values[:number]]
            if twice:
                raise ValueError(f"{what} {twice[0]!r} comes twice")
        return self


def read_views(path: str | Path) -> Views:
    """Read a file of views. Relative paths count from its folder, or the nearest one above where they are.

    Raises
    ------
    ConfigError
        No YAML, unknown or missing keys, impossible values: one line with the file and each key.
    """
    views = read_model(path, Views, "the file")
    scenes = tuple(
        scene.model_copy(update={"terrains": tuple(_found(part, "meshes", path) for part in scene.terrains)})
        for scene in views.scenes
    )
    lens = views.lens
    if isinstance(lens, RigLens) and lens.localised is not None:
        lens = _found(lens, "localised", path)
    return views.model_copy(update={"scenes": scenes, "lens": lens})


def _found(part: AnyPart, name: str, file: str | Path) -> AnyPart:
    """The part with its path of a name as it is from here."""
    return part.model_copy(update={name: found_from(getattr(part, name), file)})


def schema() -> str:
    """JSON schema of files of views; `config/views.schema.json` holds it for editors."""
    return json.dumps(Views.model_json_schema(), indent=1, sort_keys=True) + "\n"
