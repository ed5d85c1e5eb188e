"""Options of a views file, validated before rendering."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, Field, PositiveFloat, PositiveInt, model_validator

from polarsim.formats.files import resolve_from
from polarsim.formats.yaml_files import read_model
from polarsim.photo import BLACK_LEVEL, REFERENCE_SIZE_PX, WHITE_LEVEL
from polarsim.render.options import RenderOptions
from polarsim.site import DEFAULT, Site, read_site
from polarsim.site_parts import TerrainName
from polarsim.user_path import UserPath

Name = Annotated[  # without _, which separates the parts of file names
    str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9.-]*$", description="Name used in image file names.")
]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Point = tuple[Finite, Finite, Finite]  # x, y, z, sandbox frame
Elevation = Annotated[float, Field(gt=0, le=90)]


def _in_order(low: Point, high: Point) -> None:
    if any(minimum > maximum for minimum, maximum in zip(low, high, strict=True)):
        raise ValueError(f"low corner {list(low)} is above high corner {list(high)}")


class ViewsSection(BaseModel, extra="forbid", frozen=True):
    """A section of the views file."""


AnyPart = TypeVar("AnyPart", bound=ViewsSection)


class SceneSection(ViewsSection):
    """A terrain to render."""

    name: Name
    meshes: UserPath = Field(description="Folder of the meshes of the terrain, `results/<run>/meshes/TerrainNN`.")
    terrain: TerrainName = Field(description="Number or name of the terrain in the names of the mesh files.")


class RigLens(ViewsSection):
    """Lenses of the calibrated rig."""

    kind: Literal["rig"] = Field("rig", description="Lens of the calibrated rig.")
    localised: UserPath | None = Field(None, description="`PosX.json` with the lenses; none: lenses of the site's rig.")


class PinholeLens(ViewsSection):
    """A lens without distortion."""

    kind: Literal["pinhole"] = Field(description="Pinhole camera without distortion.")
    hfov_deg: float = Field(gt=0, lt=170, description="Horizontal field of view, degrees.")
    width_px: PositiveInt = Field(REFERENCE_SIZE_PX[0], le=16384, description="Width of the images, px.")
    height_px: PositiveInt = Field(REFERENCE_SIZE_PX[1], le=16384, description="Height of the images, px.")
    baseline_m: PositiveFloat = Field(0.3, description="Distance between the cameras of a pair, metres.")


class PointCameras(ViewsSection):
    """One camera at a point."""

    kind: Literal["point"] = Field(description="One camera at a point.")
    name: Name = "point"
    position_m: Point = Field(description="Centre of the camera, metres.")
    look_at_m: Point = Field(description="Point on the optical axis, metres.")
    roll_deg: Finite = Field(0, description="Roll about the optical axis, degrees; positive: right side down.")


class OrbitCameras(ViewsSection):
    """Cameras on a circle, directed at the centre."""

    kind: Literal["orbit"] = Field(description="Cameras on a circle.")
    name: Name = "orbit"
    centre_m: Point = Field((0, 0, 0), description="Centre of the circle and target of all cameras, metres.")
    radius_m: PositiveFloat = Field(description="Radius of the circle, metres.")
    height_m: Finite = Field(description="Height of the circle above the centre, metres.")
    number: PositiveInt = Field(description="Number of cameras to place.")
    from_deg: Finite = Field(0, description="Azimuth of the first camera, degrees from +X to +Y.")
    over_deg: Finite = Field(360, description="Angle over which the cameras are evenly distributed, degrees.")


class PathCameras(ViewsSection):
    """Evenly spaced frames along a smooth curve."""

    kind: Literal["path"] = Field(description="Cameras along a curve.")
    name: Name = "path"
    waypoints_m: tuple[Point, ...] = Field(min_length=2, description="Points of the curve, metres.")
    number: int = Field(ge=2, description="Number of frames, including first and last waypoint.")
    look_at_m: Point | None = Field(None, description="Target of all frames, metres; none: along the curve.")
    pitch_deg: float = Field(0, ge=-90, le=90, description="Downward angle from the heading of the path, degrees.")


class RandomCameras(ViewsSection):
    """Cameras at random points of a box, directed at random points of a second box."""

    kind: Literal["random"] = Field(description="Cameras at random points.")
    name: Name = "random"
    number: PositiveInt = Field(description="Number of cameras to place.")
    low_m: Point = Field(description="Minimum corner of the box of camera centres, metres.")
    high_m: Point = Field(description="Maximum corner of the box of camera centres, metres.")
    look_at_low_m: Point = Field((-1, -1, 0), description="Minimum corner of the box of targets, metres.")
    look_at_high_m: Point = Field((1, 1, 0), description="Maximum corner of the box of targets, metres.")
    clearance_m: float = Field(0.2, ge=0, description="Minimum height of a camera above the surface below it, metres.")
    seed: int = Field(0, ge=0, description="Seed of the random poses.")

    @model_validator(mode="after")
    def _boxes(self) -> RandomCameras:
        _in_order(self.low_m, self.high_m)
        _in_order(self.look_at_low_m, self.look_at_high_m)
        return self


def _utc(moment: datetime) -> datetime:
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


class SkyGrid(ViewsSection):
    """Lights at every pair of an azimuth and an elevation."""

    azimuth_deg: tuple[Finite, ...] = Field(min_length=1, description="Azimuths of the light, degrees from +X to +Y.")
    elevation_deg: tuple[Elevation, ...] = Field(min_length=1, description="Elevations of the light, degrees.")


class NearLamps(SkyGrid):
    """Lamps at a finite distance, as in the POLAR laboratory."""

    kind: Literal["lamp"] = Field(description="Lamps at a finite distance.")
    name: Name = "lamp"
    distance_m: PositiveFloat = Field(description="Distance of the lamp from `centre_m`, metres.")
    centre_m: Point = Field((0, 0, 0), description="Origin of azimuth, elevation and distance, metres.")
    intensity: PositiveFloat = Field(1, description="Radiant intensity relative to POLAR's Sun lamp.")
    radius_m: float = Field(0, ge=0, description="Radius of the lamp, metres; 0: a point lamp with sharp shadows.")


class Suns(SkyGrid):
    """Distant Sun with a diameter of 0.53 degrees."""

    kind: Literal["sun"] = Field(description="Suns in given directions.")
    name: Name = "sun"
    intensity: PositiveFloat = Field(1, description="Irradiance relative to POLAR's Sun lamp 4 m away.")


class LunarSuns(ViewsSection):
    """The Sun over a site on the Moon at given times."""

    kind: Literal["lunar_sun"] = Field(description="The Sun over a site on the Moon.")
    name: Name = "moon"
    latitude_deg: float = Field(ge=-90, le=90, description="Selenographic latitude of the site, degrees north.")
    longitude_deg: float = Field(ge=-180, le=360, description="Selenographic longitude of the site, degrees east.")
    start_utc: Annotated[datetime, AfterValidator(_utc)] = Field(description="Time of the first image, UTC.")
    number: PositiveInt = Field(1, description="Number of times; nights are omitted.")
    every_h: PositiveFloat = Field(24, description="Interval between times, hours.")
    north_deg: Finite = Field(90, description="Direction of north, degrees from +X to +Y; 90: east is +X.")
    intensity: PositiveFloat = Field(1, description="Irradiance relative to POLAR's Sun lamp 4 m away.")


class RoverLight(ViewsSection):
    """Light of the site's rig, a point lamp that moves with the (left) camera."""

    states: tuple[bool, ...] = Field(
        (False,), min_length=1, description="States to render: false (off), true (on), or both."
    )


class AutoExposure(ViewsSection):
    """Automatic exposure of an image, from the lit pixels."""

    percentile: float = Field(95, gt=0, le=100, description="Percentile of the lit pixels that is exposed to `grey`.")
    grey: int = Field(
        3000,
        gt=BLACK_LEVEL,
        le=WHITE_LEVEL,
        description=f"Target DN of the percentile, including black level {BLACK_LEVEL}.",
    )


class StarField(ViewsSection):
    """Stars of the Hipparcos catalogue where no surface is visible."""

    intensity: float = Field(
        1, ge=0, description="Flux relative to real stars, which are hardly visible in sunlit exposures."
    )


class Views(ViewsSection):
    """Scenes, cameras and lights in the sandbox frame, metres: +X towards azimuth 0, +Y towards 90, +Z up."""

    scenes: tuple[SceneSection, ...] = Field(min_length=1, description="Scenes, each rendered with all cameras.")
    site: str = Field(
        DEFAULT, description="Site of the terrains: the name of one that polarsim ships, or the path of a site file."
    )
    lens: RigLens | PinholeLens = Field(RigLens(), discriminator="kind", description="Lens of all cameras.")
    stereo: bool = Field(False, description="Add a right camera to every camera.")
    cameras: tuple[
        Annotated[PointCameras | OrbitCameras | PathCameras | RandomCameras, Field(discriminator="kind")], ...
    ] = Field(min_length=1, description="Cameras of all scenes.")
    lights: tuple[Annotated[NearLamps | Suns | LunarSuns, Field(discriminator="kind")], ...] = Field(
        min_length=1, description="Lights, one per image."
    )
    rover_light: RoverLight = Field(RoverLight(), description="Rover light, in addition to `lights`.")
    exposures_ms: tuple[PositiveFloat | Literal["auto"], ...] = Field(
        ("auto",), min_length=1, description="Exposure times, ms; auto: by `auto_exposure`."
    )
    auto_exposure: AutoExposure = Field(AutoExposure(), description="Settings of the exposure `auto`.")
    stars: StarField | None = Field(None, description="Stars in the background; none: black.")
    render: RenderOptions = Field(
        RenderOptions(), description="Options as in the configuration of a run; all `models` are rendered."
    )

    def read_site(self) -> Site:
        """Return the site of the terrains."""
        return read_site(self.site)

    @model_validator(mode="after")
    def _check_duplicates(self) -> Views:
        if self.render.fitted_domains:
            raise ValueError("render: fitted twins are twins of photos, which novel views do not have")
        for key, values in (
            ("scenes: name", [scene.name for scene in self.scenes]),
            ("exposures_ms:", list(self.exposures_ms)),
            ("rover_light.states:", list(self.rover_light.states)),
            ("render.models:", list(self.render.models)),
        ):
            duplicates = [value for number, value in enumerate(values) if value in values[:number]]
            if duplicates:
                raise ValueError(f"{key} {duplicates[0]!r} is given twice")
        return self


def read_views(path: str | Path) -> Views:
    """Read a views file. Relative paths are relative to the file or to the nearest parent folder with such a path."""
    views = read_model(path, Views, "the file")
    scenes = tuple(_resolved(scene, "meshes", path) for scene in views.scenes)
    lens = views.lens
    if isinstance(lens, RigLens) and lens.localised is not None:
        lens = _resolved(lens, "localised", path)
    is_file = Path(views.site).suffix in (".yaml", ".yml")
    site = str(resolve_from(Path(views.site), path)) if is_file else views.site
    return views.model_copy(update={"scenes": scenes, "lens": lens, "site": site})


def _resolved(part: AnyPart, name: str, file: str | Path) -> AnyPart:
    """Return the section with a path made relative to the working folder."""
    return part.model_copy(update={name: resolve_from(getattr(part, name), file)})


def views_schema() -> str:
    """Return the JSON schema of views files; `config/views.schema.json` contains it for editors."""
    return json.dumps(Views.model_json_schema(), indent=1, sort_keys=True) + "\n"
