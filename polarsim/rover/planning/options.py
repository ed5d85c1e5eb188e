"""What the configuration says about a rover that finds its own way."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, field_validator

from polarsim.render.options import Model
from polarsim.rover.cameras.options import SunName

Mode = Literal["truth", "detector", "stereo", "both", "blind"]
OFF, ON = "off", "on"


class MapOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how looks become a map of hazards."""

    cell_m: PositiveFloat = Field(0.15, description="The map has cells of this side, m.")
    farthest_m: PositiveFloat = Field(5.0, description="Ground farther from the camera than this is not mapped, m.")
    full_weight_m: PositiveFloat = Field(
        2.0, description="Looks from up to this distance count in full, farther ones by the inverse square, m."
    )
    miss_log_odds: PositiveFloat = Field(
        0.7, description="A look at a cell that shows no rock lowers its log-odds of a rock by this."
    )
    most_log_odds: PositiveFloat = Field(4.0, description="Log-odds stay within this, either way.")
    decay_s: PositiveFloat = Field(
        120.0, description="Log-odds fall to 1/e of what they were in this time without a look, s."
    )
    stereo_rock_m: PositiveFloat = Field(
        0.05, description="Stereo takes a cell for rock where it stands this high above the ground around, m."
    )
    least_grey: float = Field(
        12.0,
        ge=0,
        description="What has fewer grey values over the black level (of 4,095) was not seen: there no find of a "
        "detector does not mean free ground, and stereo has no depth.",
    )
    hazard_m: PositiveFloat = Field(0.07, description="Rocks that are taken for this high or more are hazards, m.")
    fill_m: float = Field(
        0.6,
        ge=0,
        description="Heights of ground that nothing shows are interpolated from what lies around, if that is no "
        "farther than this, m.",
    )


class PlannerOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how a path is found and followed."""

    wheel_gap_m: PositiveFloat = Field(
        0.15, description="A wheel's centre keeps this far from cells with hazards, m; half its width is 0.1."
    )
    soft_m: PositiveFloat = Field(0.25, description="Nearness to hazards costs over this distance beyond the gap, m.")
    clearance_m: PositiveFloat = Field(
        0.25, description="Rocks lower than this may pass between the wheels below the body, m."
    )
    curvature_1_m: PositiveFloat = Field(0.9, description="Paths bend by this at most, 1/m.")
    window_m: PositiveFloat = Field(5.0, description="Paths reach this far ahead, m.")
    unseen_cost: float = Field(8.0, ge=0, description="A metre over ground never seen costs so many metres more.")
    look_ahead_m: PositiveFloat = Field(0.7, description="The rover steers for the path's point so far ahead, m.")
    back_m: PositiveFloat = Field(0.8, description="Without a path the rover backs off by this, m.")
    tries: int = Field(8, ge=1, description="The rover gives up after backing off so many times.")


class AutonomyOptions(BaseModel, extra="forbid", frozen=True):
    """The rover decides in these drives: one of every mode, seed, Sun, exposure, state of lights, model and detector.

    Modes differ in what they depend on: by labels or blind there is one drive a seed, and stereo has no detector.
    """

    run: bool = Field(False, description="The rover drives so; without it the run has no such drives.")
    modes: tuple[Mode, ...] = Field(
        ("truth", "detector", "stereo", "both", "blind"),
        min_length=1,
        description="The rover goes by the labels, a detector, stereo depth, both of these, or straight on.",
    )
    seeds: tuple[int, ...] = Field((0,), min_length=1, description="Start, ground and noise differ between seeds.")
    suns: tuple[SunName, ...] = Field(("1", "3"), min_length=1, description="It drives under each of these Suns.")
    exposures_ms: tuple[PositiveFloat | Literal["auto"], ...] = Field(
        (256.0,), min_length=1, description="Pictures have each of these exposures, ms; auto: none of 1 % of it clips."
    )
    sun_elevation_deg: float = Field(8.0, gt=0, le=90, description="Suns stand this high above the horizon, degrees.")
    lights: tuple[Literal["off", "on"], ...] = Field(
        ("off",), min_length=1, description="It drives with its lights off, on, or once so and once so."
    )
    lamps: tuple[str, ...] = Field(
        ("navlight_left", "navlight_right", "hazlight_fore_port", "hazlight_fore_starboard"),
        description="These lights of the vehicle's table are meant by `lights`.",
    )
    detectors: tuple[str, ...] = Field(
        (),
        description="It drives by each of these detectors: `packaged_rover`, `packaged`, `fine_tuned`, or the run's "
        "of a training domain, one a seed of training. None: by the one on board, which rover.detector or "
        "rover.cameras.onboard.weights names.",
    )
    models: tuple[Model, ...] = Field(
        ("hapke",), min_length=1, description="It drives with pictures in each of these reflectance models."
    )
    noise: bool = Field(True, description="Pictures have shot and read noise.")
    scale: float = Field(0.5, gt=0, le=1, description="Pictures have this size over that of the camera.")
    around: tuple[str, ...] = Field(
        ("ncl", "acl", "hfp", "hfs", "hap", "has"),
        description="By labels the rover also looks through these cameras of the vehicle's table.",
    )
    around_scale: float = Field(0.125, gt=0, le=1, description="They have this size over that of the cameras.")
    rate_hz: PositiveFloat = Field(1.0, description="The rover looks so many times a second.")
    stereo_base_m: PositiveFloat = Field(0.3, description="The second camera stands this far to the right, m.")
    stereo_scale: float = Field(0.5, gt=0, le=1, description="Stereo matches pictures of this size of those taken.")
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="The body drives at this speed, m/s.")
    ahead_m: float = Field(
        3.0, ge=0, description="It starts so far before the first terrain and ends as far behind, m."
    )
    width_m: PositiveFloat = Field(
        8.0, description="The strip is this wide in these drives, m: filler ground leaves a way round what is dense."
    )
    longest_s: PositiveFloat = Field(240.0, description="A drive that takes longer is ended, s.")
    map: MapOptions = Field(MapOptions(), description="These options say how looks become a map of hazards.")
    planner: PlannerOptions = Field(PlannerOptions(), description="These options say how a path is found and followed.")

    @field_validator("modes", "seeds", "suns", "exposures_ms", "lights", "models", "lamps", "detectors", "around")
    @classmethod
    def _each_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("named twice")
        return values
