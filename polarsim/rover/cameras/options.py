"""What the configuration says about what the rover sees, and what it makes of it."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import product
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.detect.options import PACKAGED, PACKAGED_ROVER, PredictionOptions
from polarsim.render.options import Model, RenderOptions
from polarsim.rover.vehicle.mounts import FRONT
from polarsim.user_path import UserPath

PAPER_VIEWS = (
    "CamBirdViewLeft", "CamBirdViewRight",
    "WheelCam_RightFront", "WheelCam_RightBack", "WheelCam_LeftFront", "WheelCam_LeftBack",
    FRONT,
)  # fmt: skip
SUN_AZIMUTHS_DEG = {"1": 0.0, "2": 315.0, "3": 225.0, "4": 180.0}  # the paper's, from east to north
NIGHT = "night"  # name of no Sun at all
SunName = Literal["1", "2", "3", "4", "night"]
REAL = "real"  # name of the real Sun
PackagedName = Literal["packaged", "packaged_rover"]
PACKAGED_FILES: dict[str, Path] = {"packaged": PACKAGED, "packaged_rover": PACKAGED_ROVER}  # that come with polarsim


def _utc(moment: datetime) -> datetime:
    return moment.replace(tzinfo=UTC) if moment.tzinfo is None else moment.astimezone(UTC)


class RealSun(BaseModel, extra="forbid", frozen=True):
    """The Sun stands as over a site on the Moon at a moment."""

    latitude_deg: float = Field(
        ge=-90, le=90, description="The site's selenographic latitude, degrees; north is positive."
    )
    longitude_deg: float = Field(
        ge=-180, le=360, description="The site's selenographic longitude, degrees; east is positive."
    )
    moment_utc: Annotated[datetime, AfterValidator(_utc)] = Field(
        description="The Sun stands where it does at this moment, UTC."
    )


class OnboardOptions(BaseModel, extra="forbid", frozen=True):
    """These options say what a detector makes of the front camera's pictures while the rover drives."""

    weights: UserPath | PackagedName | None = Field(
        None,
        description="The detector has these weights of a run; two come with polarsim: `packaged_rover`, which has seen "
        "drives, and `packaged`, which has seen photos. With none truth alone is measured.",
    )
    prediction: PredictionOptions = Field(
        PredictionOptions(), description="This section says how the detector looks at pictures."
    )
    confidence: float = Field(0.3, gt=0, lt=1, description="Detections of less confidence do not count.")
    least_contrast: float = Field(
        0.06,
        ge=0,
        le=1,
        description="A rock that stands out by less than this share of white in a picture, as one in the rover's own "
        "shadow, cannot be seen in it: labels `visible` and pictures that detectors are fine-tuned on lack it.",
    )
    iou: float = Field(0.5, gt=0, le=1, description="A rock is detected where a predicted rock overlaps it so much.")
    heights_m: tuple[PositiveFloat, ...] = Field(
        (0.05, 0.10), description="Rocks higher than each of these are counted, m."
    )
    farthest_m: PositiveFloat = Field(6.0, description="Rocks farther from the camera are not counted, m.")
    reaction_s: float = Field(1.0, ge=0, description="So much time passes from a picture to the brake, s.")
    brake_m_s2: PositiveFloat = Field(0.3, description="The rover brakes with this deceleration, m/s2.")
    stop_height_m: PositiveFloat = Field(0.10, description="The rover stops for rocks that it takes for so high, m.")
    cell_m: PositiveFloat = Field(0.15, description="The hazard map has cells of this side, m.")
    ground: Literal["surveyed", "plane"] = Field(
        "surveyed",
        description="The rover takes this for the ground ahead: the heights before the drive, as a survey or "
        "stereo pictures would give them, or the plane under its wheels, which is all that one "
        "camera knows.",
    )
    resamples: int = Field(
        1000, ge=100, description="The 95 % intervals over drives and lights have this many bootstrap samples."
    )

    @property
    def weights_file(self) -> Path | None:
        """The detector's file."""
        return PACKAGED_FILES[self.weights] if isinstance(self.weights, str) else self.weights


# Of a drive's pictures: no walls, a Sun, and fewer rays to its disc than twins have.
_RENDER = RenderOptions(rim=False, bounce=0.0, falloff=True, lamp_probe_px=16, lamp_samples=8, calibration_photos=0)


class CameraSuiteOptions(BaseModel, extra="forbid", frozen=True):
    """These options say which pictures of a drive are made."""

    views: tuple[str, ...] = Field(
        PAPER_VIEWS, min_length=1, description="These cameras of the vehicle's table take pictures."
    )
    suns: tuple[SunName, ...] = Field(
        ("1", "2", "3", "4"),
        description="Pictures are made under each of the paper's Suns: 1 east, 2 southeast, 3 southwest, 4 "
        "west; night has none, but the rover's lights alone.",
    )
    sun_elevation_deg: float = Field(
        8.0, gt=0, le=90, description="These Suns stand this high above the horizon, degrees."
    )
    real_sun: RealSun | None = Field(
        None, description="One more Sun, the real one at a site and time, is named `real`."
    )
    lights: tuple[str, ...] = Field((), description="These lights of the vehicle's table are on.")
    models: tuple[Model, ...] = Field(
        ("hapke", "principled"), min_length=1, description="Pictures are made in each of these reflectance models."
    )
    exposures_ms: tuple[PositiveFloat, ...] = Field(
        (256, 512, 1024), min_length=1, description="Pictures are made with each of these exposures, ms."
    )
    scale: float = Field(1.0, gt=0, le=1, description="Pictures have this size over that of the cameras.")
    every: int = Field(1, ge=1, description="Every so many-th of the drive's picture times is rendered.")
    finer: int = Field(
        4, ge=1, le=16, description="The ground that is shown has this many cells along one of the drive's."
    )
    far_m: float = Field(80.0, ge=0, description="The ground goes on this far beyond the drive's grid, m.")
    stars: Literal["none", "physical", "bright"] = Field(
        "physical",
        description="Stars are as bright as they are (physical), so that sunlit exposures show hardly one, or "
        "as in the paper's videos (bright).",
    )
    ground_albedo: float = Field(
        0.12, gt=0, le=1, description="The soil has this albedo; the body's albedos are told over it."
    )
    render: RenderOptions = Field(
        _RENDER,
        description="These options are those of a run's configuration; their `models` and walls do not count.",
    )
    onboard: OnboardOptions = OnboardOptions()
    videos: bool = Field(False, description="A video is made of every view, Sun, model and exposure.")
    video_speed: PositiveFloat = Field(0.5, description="Videos play at this speed over the real one.")

    @property
    def pictures(self) -> list[tuple[Model, float]]:
        """Model and exposure, ms, of every picture of a view under a Sun."""
        return list(product(self.models, self.exposures_ms))

    @field_validator("render", mode="before")
    @classmethod
    def _over_own_defaults(cls, value: object) -> object:
        """Keep the defaults of this section where a part of it is given: those of twins differ."""
        if not isinstance(value, dict):
            return value
        return _RENDER.model_dump(include=_RENDER.model_fields_set) | value

    @field_validator("views", "suns", "lights", "models", "exposures_ms")
    @classmethod
    def _each_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("named twice")
        return values

    @model_validator(mode="after")
    def _light_at_night(self) -> CameraSuiteOptions:
        if NIGHT in self.suns and not self.lights:
            raise ValueError("suns: at night the rover sees by `lights` alone, and none is named")
        return self
