"""Options of a drive's physics: world, soil, drive."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.photo import TERRAINS
from polarsim.rover.bulldozing import Bulldozing
from polarsim.rover.contact import Rule

Point = tuple[float, float]


class Part(BaseModel, extra="forbid", frozen=True):
    """A section of options."""


class WorldOptions(Part):
    """What is driven over."""

    terrains: tuple[int, ...] = Field((4, 1, 11), min_length=1, description="Terrain numbers from east to west.")
    length_m: PositiveFloat = Field(3.5, le=4.0, description="Of each terrain along the strip, m.")
    width_m: PositiveFloat = Field(5.0, description="Of the strip, m; beside the terrains lies filler ground.")
    margin_m: PositiveFloat = Field(2.5, description="Filler ground before and behind the terrains, m.")
    cell_m: PositiveFloat = Field(0.02, le=0.1, description="Distance of the ground's nodes, m.")
    blend_m: PositiveFloat = Field(0.4, description="Over which two grounds pass into each other at a seam, m.")
    filler_roughness_m: float = Field(0.003, ge=0, description="Standard deviation of filler ground's heights, m.")
    rock_hollow_m: PositiveFloat = Field(
        0.01, description="A rock is split where its hull stands higher than this above it, on average, m."
    )
    rock_parts: int = Field(8, ge=1, description="Convex parts of a rock at most.")

    @field_validator("terrains")
    @classmethod
    def _known(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        for value in values:
            if value not in TERRAINS:
                raise ValueError(f"terrain {value}, expected 1 to 13")
        return values


class BulldozingOptions(Part):
    """Where displaced soil goes."""

    share: float = Field(0.5, ge=0, le=1, description="Of the pressed volume that moves aside; the rest compacts.")
    spread_m: PositiveFloat = Field(0.03, description="Standard deviation of the distance that soil is pushed, m.")
    headroom_m: float = Field(0.02, ge=0, description="No soil goes where a wheel is nearer to the ground, m.")
    angle_deg: float = Field(36.0, gt=0, lt=90, description="Steeper soil slides, degrees.")
    sweeps: int = Field(3, ge=0, description="Of sliding, each time.")
    every_s: PositiveFloat = Field(0.01, description="Time between two moves of displaced soil, s.")

    def rule(self, dt: float) -> Bulldozing:
        """For the kernels."""
        every = max(round(self.every_s / dt), 1)
        return Bulldozing(self.share, self.spread_m, self.headroom_m, self.angle_deg, self.sweeps, every)


class SoilOptions(Part):
    """The soil, and how its law is stepped."""

    soil: str = Field("lunar", description="Name of a set in the table.")
    table: Path = Field(Path("config/soils.csv"), description="Sets of constants with source and gravity.")
    gravity_m_s2: PositiveFloat = Field(1.62, description="Of the drive, m/s2.")
    scale_by_gravity: bool = Field(
        True, description="Constants scale with gravity from that of their measurement, so equal masses sink equally."
    )
    normal: Literal["contact", "terrain"] = Field(
        "contact", description="Forces stand on the wheel's surface, or, as in Chrono, on the ground's."
    )
    slip_sinkage: bool = Field(True, description="A slipping wheel digs itself in (where the set says how much).")
    slip_length_m: float = Field(
        0.1, ge=0, description="Of the rim's travel in which a change of slip comes to tell on sinkage, m; 0: at once."
    )
    clearance_m: float = Field(0.003, ge=0, description="Above the soil at which a node forgets its shear, m.")
    bulldozing: BulldozingOptions | None = Field(BulldozingOptions(), description="null: displaced soil vanishes.")
    step_s: PositiveFloat = Field(0.001, le=0.02, description="Time step, s.")
    energy_bound: PositiveFloat = Field(
        0.02, description="Share of energy that may be unaccounted for; more ends a run."
    )

    @property
    def rule(self) -> Rule:
        return Rule(self.normal == "terrain", self.clearance_m, slip_length=self.slip_length_m)


class StartSpread(Part):
    """What differs between seeds: drawn evenly within these bounds, ground roughness normally."""

    along_m: float = Field(0.10, ge=0, description="Start before or behind the path's first point, m.")
    offset_m: float = Field(0.02, ge=0, description="Start left or right of it, m.")
    heading_deg: float = Field(1.0, ge=0, description="Start's heading off the path's, degrees.")
    ground_m: float = Field(0.0005, ge=0, description="Standard deviation of heights added to every node, m.")


class DriveOptions(Part):
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
