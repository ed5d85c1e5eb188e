"""What the configuration says about the soil."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.contact import Rule


class BulldozingOptions(BaseModel, extra="forbid", frozen=True):
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


class SoilOptions(BaseModel, extra="forbid", frozen=True):
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
