"""Options of drives in which the rover finds its own way."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, field_validator

from polarsim.rover.perception.options import Mode

OFF, ON = "off", "on"


class PlannerOptions(BaseModel, extra="forbid", frozen=True):
    """Limits of the planned path. They depend on the vehicle; the defaults are for `config/viper.yaml`."""

    hazard_m: PositiveFloat = Field(0.07, description="Minimum estimated height of a rock that is avoided, m.")
    wheel_gap_m: PositiveFloat = Field(
        0.15, description="Minimum distance of a wheel's centre from hazards, m; half its width is 0.1."
    )
    clearance_m: PositiveFloat = Field(
        0.25, description="Maximum height of rocks that may pass between the wheels below the body, m."
    )
    curvature_1_m: PositiveFloat = Field(0.9, description="Maximum curvature of a path, 1/m.")


class AutonomyOptions(BaseModel, extra="forbid", frozen=True):
    """Drives in which the rover decides: one of every mode, seed, Sun, exposure, state of headlights, model, detector.

    Seeds are those of `rover.seeds`; Suns, exposures, models, stars and scale those of `rover.cameras`. By labels or
    blind there is one drive a seed, and stereo has no detector.
    """

    run: bool = Field(False, description="Make drives in which the rover finds its own way.")
    modes: tuple[Mode, ...] = Field(
        ("truth", "detector", "stereo", "both", "blind"),
        min_length=1,
        description="Source of the map: labels, a detector, stereo depth, both of these, or none (straight on).",
    )
    headlights: tuple[Literal["off", "on"], ...] = Field(
        ("off",), min_length=1, description="States of the lights that point ahead; a drive for each."
    )
    auto_exposure: bool = Field(
        False, description="Expose each picture so that 1 % of it clips, in place of `rover.cameras.exposures_ms`."
    )
    detectors: tuple[str, ...] = Field(
        (),
        description="A drive for each of these detectors: `packaged_rover`, `packaged`, `fine_tuned` or a training "
        "domain of the run. None: the detector on board.",
    )
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="Speed of the body, m/s.")
    width_m: PositiveFloat = Field(
        8.0, description="Width of the strip in these drives, m. A wider one leaves ways round dense terrains."
    )
    longest_s: PositiveFloat = Field(240.0, description="Maximum duration of a drive, s.")
    planner: PlannerOptions = PlannerOptions()

    @field_validator("modes", "headlights", "detectors")
    @classmethod
    def _each_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("named twice")
        return values
