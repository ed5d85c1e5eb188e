"""Options of autonomous drives."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.rover.perception.options import Mode
from polarsim.schemas.rover import FUSED

ON = "on"
PoseSource = Literal["truth", "odometry", "fused"]  # as `schemas.rover.POSES`


class PlannerOptions(BaseModel, extra="forbid", frozen=True):
    """Limits of the planned path. They depend on the vehicle; the defaults are for `config/viper.yaml`."""

    hazard_m: PositiveFloat = Field(0.07, description="Minimum estimated height of a rock that is avoided, m.")
    wheel_gap_m: PositiveFloat = Field(
        0.15, description="Minimum distance of a wheel's centre from hazards, m; half the wheel's width is 0.1."
    )
    clearance_m: PositiveFloat = Field(
        0.25, description="Maximum height of rocks that may pass below the body between the wheels, m."
    )
    curvature_1_m: PositiveFloat = Field(0.9, description="Maximum curvature of a path, 1/m.")


class AutonomyOptions(BaseModel, extra="forbid", frozen=True):
    """Autonomous drives: each combination of mode, seed, Sun, exposure, state of headlights, model, detector and pose.

    Seeds are those of `rover.seeds`; Suns, exposures, models, stars and scale those of `rover.cameras`. The modes
    `truth` and `blind` have one drive per seed and pose, except for `fused` poses, which need pictures, in mode
    `truth`. The mode `stereo` has no detector, the mode `blind` no `fused` pose.
    """

    run: bool = Field(False, description="Simulate autonomous drives in the target `rover_autonomy`.")
    modes: tuple[Mode, ...] = Field(
        ("truth", "detector", "stereo", "both", "blind"),
        min_length=1,
        description="Source of the map: labels, a detector, stereo depth, both, or none (straight line).",
    )
    headlights: tuple[Literal["off", "on"], ...] = Field(
        ("off",), min_length=1, description="States of the lights that point forward; a drive for each."
    )
    auto_exposure: bool = Field(
        False, description="Expose each picture so that 1 % of it is saturated; ignores `rover.cameras.exposures_ms`."
    )
    detectors: tuple[str, ...] = Field(
        (),
        description="Detectors, a drive for each: `packaged_rover`, `packaged`, `fine_tuned` or a training "
        "domain of the run. Empty: the onboard detector.",
    )
    poses: tuple[PoseSource, ...] = Field(
        ("truth",),
        min_length=1,
        description="Sources of the rover's pose, a drive for each: `truth`, `odometry` (wheels and IMU) "
        "or `fused` (and stereo).",
    )
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="Speed of the body, m/s.")
    width_m: PositiveFloat = Field(
        8.0, description="Width of the strip, m. A wider strip leaves paths around dense terrains."
    )
    longest_s: PositiveFloat = Field(240.0, description="Maximum duration of a drive, s.")
    planner: PlannerOptions = PlannerOptions()

    @model_validator(mode="after")
    def _pictures_for_poses(self) -> AutonomyOptions:
        if self.modes == ("blind",) and self.poses == (FUSED,):
            raise ValueError("poses: `fused` needs pictures, but the mode `blind` takes none; add a mode or a pose")
        return self

    @field_validator("modes", "headlights", "detectors", "poses")
    @classmethod
    def _each_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("contains a value twice")
        return values
