"""Options of the drive."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, model_validator

from polarsim.user_path import UserPath

Point = tuple[float, float]


class DriveOptions(BaseModel, extra="forbid", frozen=True):
    """Path, speed and steering of the rover."""

    vehicle: UserPath = Field(
        Path("config/viper.yaml"), description="File with the rover's masses, wheels, cameras and lights."
    )
    path_m: tuple[Point, ...] | None = Field(
        None, min_length=2, description="Points x, y of the path, m; null: the centre line from east to west."
    )
    speed_m_s: PositiveFloat = Field(0.2, le=2.0, description="Speed of the body, m/s.")
    control: Literal["heading", "P-only"] = Field(
        "heading", description="Steer by offset and heading, or by the offset only, as in the paper."
    )
    steering: Literal["ackermann", "crab", "combined"] = Field(
        "combined",
        description="Turn the body, turn the wheels only, or steer back by crab while the body keeps its heading.",
    )
    picture_hz: PositiveFloat = Field(15.0, description="Rate of pictures and stored ground changes, 1/s.")
    longest_s: PositiveFloat | None = Field(
        None, description="Maximum duration, s; null: four times the path's length over the speed."
    )
    spread: float = Field(
        1.0, ge=0, description="Scale of the differences in start and ground between seeds; 0: no differences."
    )

    @model_validator(mode="after")
    def _rates(self) -> DriveOptions:
        points = self.path_m or ()
        for number, (point, following) in enumerate(pairwise(points), 1):
            if point == following:
                raise ValueError(f"path_m: points {number} and {number + 1} are the same")
        return self
