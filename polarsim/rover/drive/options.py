"""What the configuration says about where the rover goes and how it is steered."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, model_validator

Point = tuple[float, float]


class StartSpread(BaseModel, extra="forbid", frozen=True):
    """What differs between seeds: drawn evenly within these bounds, ground roughness normally."""

    along_m: float = Field(0.10, ge=0, description="Start before or behind the path's first point, m.")
    offset_m: float = Field(0.02, ge=0, description="Start left or right of it, m.")
    heading_deg: float = Field(1.0, ge=0, description="Start's heading off the path's, degrees.")
    ground_m: float = Field(0.0005, ge=0, description="Standard deviation of heights added to every node, m.")


class DriveOptions(BaseModel, extra="forbid", frozen=True):
    """Where the rover goes and how it is steered."""

    vehicle: Path = Field(Path("config/viper.yaml"), description="The rover's table.")
    path_m: tuple[Point, ...] | None = Field(
        None, min_length=2, description="Points x, y in the world, m; null: the middle line from east to west."
    )
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="Of the body, m/s.")
    control: Literal["heading", "P-only"] = Field(
        "heading", description="Steering by offset and heading, or by the offset alone as in the paper."
    )
    steering: Literal["ackermann", "crab", "combined"] = Field(
        "combined",
        description="The body turns, the wheels alone do, or the wheels lead back to the path while the body keeps its "
        "heading. P-only control turns the body in any case but crab, as in the paper.",
    )
    gain_rad_m: PositiveFloat = Field(4.0, description="Steering angle per offset, with the heading term, rad/m.")
    p_only_gain_rad_m: PositiveFloat = Field(1.0472, description="As the paper steers by the offset alone, rad/m.")
    integral_rad_m2: float = Field(
        4.0, ge=0, description="Steering angle per offset summed over headway, with the heading term, rad/m2."
    )
    heading_gain: float = Field(2.0, ge=0, description="Steering angle per heading error.")
    steer_limit_deg: float = Field(30.0, gt=0, lt=90, description="Largest steering angle, degrees.")
    turn_above_deg: float = Field(45.0, gt=0, description="Sharper corners are taken by a turn on the spot, degrees.")
    control_hz: PositiveFloat = Field(100.0, description="Commands per second.")
    log_hz: PositiveFloat = Field(100.0, description="Rows of the trace per second.")
    picture_hz: PositiveFloat = Field(15.0, description="Frames of the ground's change per second.")
    settle_s: float = Field(2.0, ge=0, description="At rest before time 0, s.")
    longest_s: PositiveFloat | None = Field(None, description="Ends a drive, s; null: four times what it should take.")
    stuck_s: PositiveFloat = Field(10.0, description="Span over which headway is judged, s.")
    stuck_share: float = Field(0.05, ge=0, lt=1, description="Of the commanded headway; less is stuck.")
    save_every_s: PositiveFloat = Field(10.0, description="Time driven between saved states, s.")
    spread: StartSpread = Field(StartSpread(), description="What differs between seeds.")

    @model_validator(mode="after")
    def _rates(self) -> DriveOptions:
        points = self.path_m or ()
        for number, (one, two) in enumerate(pairwise(points), 1):
            if one == two:
                raise ValueError(f"path_m: points {number} and {number + 1} are the same")
        return self
