"""What a file of views says, checked before anything is rendered."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from polarsim.formats.files import found_from
from polarsim.formats.yaml_files import read_model
from polarsim.render.options import RenderOptions
from polarsim.survey import ROVER_LIGHT_FROM_LEFT, ROVER_LIGHT_SHARE

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9.-]*$")]  # no _: it stands between the parts of file names
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
    """A terrain's meshes, and where they lie in the scene."""

    meshes: Path = Field(description="Folder of the terrain's meshes, `results/<run>/meshes/TerrainNN`.")
    terrain: int = Field(ge=1, le=99, description="Number of the terrain in its files' names.")
    offset_m: Point = Field((0, 0, 0), description="Where the terrain's origin lies in the scene, metres.")
    heading_deg: Finite = Field(0, description="The terrain's +X in the scene, degrees from +X towards +Y.")


class SceneSection(Section):
    """Terrains side by side."""

    name: Name
    terrains: tuple[TerrainPart, ...] = Field(min_length=1, description="Terrains, each at its position.")


class RigLens(Section):
    """The calibrated rig's lenses."""

    kind: Literal["rig"] = "rig"
    localised: Path | None = Field(
        None, description="PosX.json whose lenses are used; none: the real rig's stated ones."
    )

    @model_validator(mode="before")
    @classmethod
    def _by_its_new_name(cls, values: object) -> object:
        if isinstance(values, dict) and "placed" in values:
            raise ValueError("placed is now localised")
        return values


class PinholeLens(Section):
    """A lens without distortion."""

    kind: Literal["pinhole"]
    hfov_deg: float = Field(gt=0, lt=170, description="Horizontal field of view, degrees.")
    width_px: PositiveInt = Field(1936, le=16384, description="Width of the pictures, px.")
    height_px: PositiveInt = Field(1216, le=16384, description="Height of the pictures, px.")
    baseline_m: PositiveFloat = Field(0.3, description="Distance of the right camera with `stereo`, metres.")


class PointCameras(Section):
    """One camera."""

    kind: Literal["point"]
    name: Name = "point"
    position_m: Point = Field(description="Camera centre, metres.")
    look_at_m: Point = Field(description="What lies on the optical axis, metres.")
    roll_deg: Finite = Field(0, description="The camera is rolled by so much, its right side down, degrees.")


class OrbitCameras(Section):
    """Cameras on a circle, all looking at one point."""

    kind: Literal["orbit"]
    name: Name = "orbit"
    centre_m: Point = Field((0, 0, 0), description="What all look at; the circle lies around it, metres.")
    radius_m: PositiveFloat = Field(description="The circle has this radius, metres.")
    height_m: Finite = Field(description="Of the circle above the centre, metres.")
    number: PositiveInt = Field(description="Number of cameras.")
    from_deg: Finite = Field(0, description="Azimuth of the first camera, degrees from +X towards +Y.")
    over_deg: Finite = Field(360, description="Angle that the cameras divide evenly, degrees; 360 is a full circle.")


class PathCameras(Section):
    """Frames of a drive or flight along a smooth curve, evenly spaced."""

    kind: Literal["path"]
    name: Name = "path"
    waypoints_m: tuple[Point, ...] = Field(min_length=2, description="Points that the curve goes through, metres.")
    number: int = Field(ge=2, description="Number of frames, the first and the last waypoint included.")
    look_at_m: Point | None = Field(None, description="What all look at, metres; none: ahead along the path.")
    pitch_deg: float = Field(0, ge=-90, le=90, description="Downwards from the path's heading, degrees.")


class RandomCameras(Section):
    """Cameras anywhere in a box, looking at points anywhere in another one."""

    kind: Literal["random"]
    name: Name = "random"
    number: PositiveInt = Field(description="Number of cameras.")
    low_m: Point = Field(description="Low corner of the box of camera centres, metres.")
    high_m: Point = Field(description="This is the high corner of the box, metres.")
    look_at_low_m: Point = Field((-1, -1, 0), description="Low corner of the box of points looked at, metres.")
    look_at_high_m: Point = Field((1, 1, 0), description="This is the high corner of that box, metres.")
    clearance_m: float = Field(0.2, ge=0, description="Least height above what lies beneath the camera, metres.")
    seed: int = Field(0, ge=0, description="Seed of the positions.")

    @model_validator(mode="after")
    def _boxes(self) -> RandomCameras:
        _in_order(self.low_m, self.high_m)
        _in_order(self.look_at_low_m, self.look_at_high_m)
        return self


def _utc(moment: datetime) -> datetime:
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


class NearLamps(Section):
    """Lamps as in POLAR's hall; lists of azimuths and elevations make a lamp of every pair."""

    kind: Literal["lamp"]
    name: Name = "lamp"
    azimuth_deg: tuple[Finite, ...] = Field(
        min_length=1, description="The light stands at each of these azimuths, from +X towards +Y, degrees."
    )
    elevation_deg: tuple[Annotated[float, Field(gt=0, le=90)], ...] = Field(
        min_length=1, description="The light stands so high above the horizon, degrees."
    )
    distance_m: PositiveFloat = Field(description="The lamp stands so far from `centre_m`, metres.")
    centre_m: Point = Field((0, 0, 0), description="What azimuth, elevation and distance count from, metres.")
    intensity: PositiveFloat = Field(1, description="Radiant intensity over that of POLAR's Sun lamp.")
    radius_m: float = Field(0, ge=0, description="Of the lamp's disc, metres; 0: a point, shadows with sharp edges.")


class Suns(Section):
    """The Sun, 0.53 degrees wide; lists of azimuths and elevations make one of every pair."""

    kind: Literal["sun"]
    name: Name = "sun"
    azimuth_deg: tuple[Finite, ...] = Field(
        min_length=1, description="The light stands at each of these azimuths, from +X towards +Y, degrees."
    )
    elevation_deg: tuple[Annotated[float, Field(gt=0, le=90)], ...] = Field(
        min_length=1, description="The light stands so high above the horizon, degrees."
    )
    intensity: PositiveFloat = Field(1, description="Irradiance over that of POLAR's Sun lamp 4 m away.")


class LunarSuns(Section):
    """The real Sun over a site on the Moon at moments of time."""

    kind: Literal["lunar_sun"]
    name: Name = "moon"
    latitude_deg: float = Field(ge=-90, le=90, description="Selenographic latitude of the site, degrees.")
    longitude_deg: float = Field(ge=-180, le=360, description="Selenographic longitude, degrees, east is positive.")
    start_utc: Annotated[datetime, AfterValidator(_utc)] = Field(description="The moment, or the first of them, UTC.")
    number: PositiveInt = Field(1, description="Number of moments; those of night are left out.")
    every_h: PositiveFloat = Field(24, description="Hours between two moments.")
    north_deg: Finite = Field(90, description="Where north lies, degrees from +X towards +Y; at 90 east is +X.")
    intensity: PositiveFloat = Field(1, description="Irradiance over that of POLAR's Sun lamp 4 m away.")


class RoverLight(Section):
    """A point of light that moves with the camera."""

    states: tuple[bool, ...] = Field((False,), min_length=1, description="Off, on, or both; each makes its pictures.")
    intensity: PositiveFloat = Field(ROVER_LIGHT_SHARE, description="Radiant intensity over that of POLAR's Sun lamp.")
    from_camera_m: Point = Field(
        tuple(ROVER_LIGHT_FROM_LEFT.tolist()),
        description="Position in the (left) camera's frame: right, down, forward.",
    )


class AutoExposure(Section):
    """What `auto` among the exposures means."""

    percentile: float = Field(95, gt=0, le=100, description="Of the lit pixels: this one gets the grey value.")
    grey: int = Field(3000, gt=16, le=4095, description="Grey value, 12 bits, black level 16 included.")
    shortest_ms: PositiveFloat = Field(1, description="Exposures stay above, ms.")
    longest_ms: PositiveFloat = Field(8192, description="Exposures stay below, ms.")


class StarField(Section):
    """Stars where a pixel meets no surface, those of the Hipparcos catalogue."""

    intensity: float = Field(
        1, ge=0, description="Flux over that of real stars; at 1 sunlit exposures show hardly one."
    )
    faintest_mag: float = Field(
        FAINTEST_MAG, le=FAINTEST_MAG, ge=-1, description="Magnitude Hp, near the visual one, of the faintest stars."
    )


class Views(Section):
    """A file of views. All lengths in metres, sandbox frame: +X to azimuth 0, +Y to 90, +Z up."""

    scenes: tuple[SceneSection, ...] = Field(min_length=1, description="Scenes; each is seen by all cameras.")
    lens: RigLens | PinholeLens = Field(RigLens(), discriminator="kind", description="All cameras have this lens.")
    stereo: bool = Field(False, description="Every camera is the left one of a pair, the right one takes pictures too.")
    cameras: tuple[
        Annotated[PointCameras | OrbitCameras | PathCameras | RandomCameras, Field(discriminator="kind")], ...
    ] = Field(min_length=1, description="Where pictures are taken from.")
    lights: tuple[Annotated[NearLamps | Suns | LunarSuns, Field(discriminator="kind")], ...] = Field(
        min_length=1, description="What lights the scene, one lamp a picture."
    )
    rover_light: RoverLight = Field(RoverLight(), description="The light on the rover, besides the lamp.")
    exposures_ms: tuple[PositiveFloat | Literal["auto"], ...] = Field(
        ("auto",), min_length=1, description="Exposure times, ms, or auto."
    )
    auto_exposure: AutoExposure = Field(AutoExposure(), description="How auto exposures are found.")
    combine: Literal["product", "zip"] = Field(
        "product",
        description="product: every camera under every light; zip: the first camera under the first light, and so on. "
        "Either in all states of the rover light, models and exposures.",
    )
    stars: StarField | None = Field(None, description="Background of stars; none: black.")
    render: RenderOptions = Field(
        RenderOptions(), description="As in a run's configuration; all `models` are rendered."
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
