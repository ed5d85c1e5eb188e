"""What the configuration says about where the rover goes and how it is steered."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, model_validator

from polarsim.user_path import UserPath

Point = tuple[float, float]


class StartSpread(BaseModel, extra="forbid", frozen=True):
    """Seeds differ by what is drawn evenly within these bounds, ground roughness normally."""

    along_m: float = Field(
        0.10, ge=0, description="A drive starts up to this far before or behind the path's first point, m."
    )
    offset_m: float = Field(0.02, ge=0, description="A drive starts up to this far left or right of it, m.")
    heading_deg: float = Field(
        1.0, ge=0, description="A drive starts with a heading off the path's by up to this, degrees."
    )
    ground_m: float = Field(
        0.0005, ge=0, description="Heights of this standard deviation are added to every node of the ground, m."
    )


class DriveOptions(BaseModel, extra="forbid", frozen=True):
    """The section says where the rover goes and how it is steered."""

    vehicle: UserPath = Field(
        Path("config/viper.yaml"),
        description="The rover's table is read from this file: masses, wheels, cameras, lights.",
    )
    path_m: tuple[Point, ...] | None = Field(
        None,
        min_length=2,
        description="The rover follows these points x, y of the world, m; null: the centre line from east to west.",
    )
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="The body drives at this speed, m/s.")
    control: Literal["heading", "P-only"] = Field(
        "heading", description="The rover steers by offset and heading, or by the offset alone as in the paper."
    )
    steering: Literal["ackermann", "crab", "combined"] = Field(
        "combined",
        description="The body turns, the wheels alone do, or the wheels lead back to the path while the body keeps its "
        "heading. P-only control turns the body in any case but crab, as in the paper.",
    )
    steer_limit_deg: float = Field(30.0, gt=0, lt=90, description="A wheel steers by this angle at most, degrees.")
    log_hz: PositiveFloat = Field(100.0, description="The trace has this many rows a second.")
    picture_hz: PositiveFloat = Field(15.0, description="Pictures and changes of the ground are kept this often, 1/s.")
    settle_s: float = Field(2.0, ge=0, description="The rover sinks in at rest for this long before time 0, s.")
    longest_s: PositiveFloat | None = Field(
        None, description="A drive that takes longer is ended, s; null: four times what it should take."
    )
    spread: StartSpread = Field(
        StartSpread(), description="This section says how far starts and grounds of two seeds differ."
    )

    @model_validator(mode="after")
    def _rates(self) -> DriveOptions:
        points = self.path_m or ()
        for number, (one, two) in enumerate(pairwise(points), 1):
            if one == two:
                raise ValueError(f"path_m: points {number} and {number + 1} are the same")
        return self
