"""Options of the rover's pictures and of the detector on board."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.detect.options import PACKAGED, PACKAGED_ROVER
from polarsim.render.options import Model, RenderOptions
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.user_path import UserPath

if TYPE_CHECKING:
    from polarsim.rover.vehicle.table import Vehicle

PAPER_VIEWS = (
    "CamBirdViewLeft", "CamBirdViewRight",
    "WheelCam_RightFront", "WheelCam_RightBack", "WheelCam_LeftFront", "WheelCam_LeftBack",
    FRONT,
)  # fmt: skip
SUN_AZIMUTHS_DEG = {"1": 0.0, "2": 315.0, "3": 225.0, "4": 180.0}  # of the paper, from east to north
NIGHT = "night"  # name of a light without a Sun
SunName = Literal["1", "2", "3", "4", "night"]
PackagedName = Literal["packaged", "packaged_rover"]
# Options of the section `render` that the rover's pictures replace: a drive has no walls that reflect light
# (`bounce`), the light of headlights decreases with distance, and large pictures need few rays to the Sun's disc.
ROVER_RENDER = {"bounce": 0.0, "falloff": True, "lamp_probe_px": 16, "lamp_samples": 8}
_NO_EFFECT = {  # options of the section `render` that do not change the rover's pictures and labels
    "models", "maps", "materials_from_photos", "fitting", "lamp_radius_m",
    "walls", "wall_albedo", *ROVER_RENDER,
}  # fmt: skip
# Weights shipped with polarsim.
PACKAGED_FILES: dict[str, Path] = {"packaged": PACKAGED, "packaged_rover": PACKAGED_ROVER}


@dataclass(frozen=True)
class ImagingCondition:
    """Sun, exposure (ms or `auto`), lights of the vehicle that are on, and reflectance model of pictures."""

    sun: str
    exposure_ms: float | str
    lights: tuple[str, ...] = ()
    model: Model = "hapke"


def lights_ahead(vehicle: Vehicle) -> tuple[str, ...]:
    """Return the names of the vehicle's lights that point forward (VIPER: mast and front lights)."""
    return tuple(light.name for light in vehicle.lights if abs(light.yaw_deg) < 45)


def rover_render(render: RenderOptions) -> dict[str, object]:
    """Return the options of a run's section `render` that change the rover's pictures, as JSON values."""
    return render.model_dump(mode="json", exclude=_NO_EFFECT)


class OnboardOptions(BaseModel, extra="forbid", frozen=True):
    """Detector on the pictures of the front camera."""

    weights: UserPath | PackagedName | None = Field(
        None,
        description="Weights of the detector: a file, `packaged_rover` (trained on drives and photos) or `packaged` "
        "(photos only). None: no detector.",
    )
    confidence: float = Field(0.3, gt=0, lt=1, description="Minimum confidence of a detection.")
    ground: Literal["surveyed", "plane"] = Field(
        "surveyed",
        description="Ground for locating boxes: heights before the drive, or the plane under the wheels.",
    )

    @property
    def weights_file(self) -> Path | None:
        """Path of the weights."""
        return PACKAGED_FILES[self.weights] if isinstance(self.weights, str) else self.weights


class CameraSuiteOptions(BaseModel, extra="forbid", frozen=True):
    """Pictures of a drive; other options are in the section `render`."""

    views: tuple[str, ...] = Field(PAPER_VIEWS, min_length=1, description="Names of the vehicle's cameras to render.")
    suns: tuple[SunName, ...] = Field(
        ("1", "2", "3", "4"),
        min_length=1,
        description="Suns of the paper: 1 east, 2 southeast, 3 southwest, 4 west; `night`: headlights only.",
    )
    sun_elevation_deg: float = Field(8.0, gt=0, le=90, description="Elevation of these Suns, degrees.")
    lights: tuple[str, ...] = Field((), description="Names of the vehicle's lights that are on.")
    models: tuple[Model, ...] = Field(
        ("hapke", "principled"), min_length=1, description="Reflectance models of the pictures."
    )
    exposures_ms: tuple[PositiveFloat, ...] = Field(
        (256, 512, 1024), min_length=1, description="Exposures of the pictures, ms."
    )
    scale: float = Field(1.0, gt=0, le=1, description="Picture size relative to the camera's size. Lower is faster.")
    every: int = Field(1, ge=1, description="Step between rendered picture times of the drive.")
    finer: int = Field(4, ge=1, le=16, description="Cells of the rendered ground per cell of the drive's ground.")
    stars: Literal["none", "physical", "bright"] = Field(
        "physical",
        description="Brightness of stars: physical (invisible at sunlit exposures) or bright as in the paper's videos.",
    )
    onboard: OnboardOptions = OnboardOptions()
    videos: bool = Field(False, description="Write a video for each view, Sun, model and exposure.")

    @property
    def pictures(self) -> list[tuple[Model, float]]:
        """Return model and exposure, ms, of each picture of a view under a Sun."""
        return list(product(self.models, self.exposures_ms))

    @field_validator("views", "suns", "lights", "models", "exposures_ms")
    @classmethod
    def _each_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("contains a value twice")
        return values

    @model_validator(mode="after")
    def _light_at_night(self) -> CameraSuiteOptions:
        if NIGHT in self.suns and not self.lights:
            raise ValueError("suns: 'night' needs at least one of the vehicle's `lights`")
        return self
