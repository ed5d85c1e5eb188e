"""What the configuration says about the soil."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.rover.soil.bulldozing import Bulldozing
from polarsim.rover.soil.contact import Rule
from polarsim.user_path import UserPath

_EVERY_S = 0.01  # between two moves of displaced soil


class BulldozingOptions(BaseModel, extra="forbid", frozen=True):
    """These options say where displaced soil goes."""

    share: float = Field(
        0.5, ge=0, le=1, description="This share of the pressed volume moves aside; the rest compacts."
    )
    angle_deg: float = Field(
        36.0, gt=0, lt=90, description="Displaced soil slides where it is steeper than this, degrees."
    )

    def rule(self, dt: float) -> Bulldozing:
        """For the kernels."""
        return Bulldozing(self.share, angle_deg=self.angle_deg, every=max(round(_EVERY_S / dt), 1))


class SoilOptions(BaseModel, extra="forbid", frozen=True):
    """These options set the soil and how its law is stepped."""

    soil: str = Field("lunar", description="The soil is the set of this name in the table.")
    table: UserPath = Field(
        Path("config/soils.csv"),
        description="Sets of constants are read from this file, each with its source and gravity.",
    )
    gravity_m_s2: PositiveFloat = Field(1.62, description="The rover drives under this gravity, m/s2.")
    scale_by_gravity: bool = Field(
        True, description="Constants scale with gravity from that of their measurement, so equal masses sink equally."
    )
    normal: Literal["contact", "terrain"] = Field(
        "contact", description="Forces stand on the wheel's surface, or, as in Chrono, on the ground's."
    )
    slip_sinkage: bool = Field(True, description="A slipping wheel digs itself in (where the set says how much).")
    slip_length_m: float = Field(
        0.1,
        ge=0,
        description="A change of slip comes to tell on sinkage over this length of the rim's travel, m; 0: it "
        "tells at once.",
    )
    bulldozing: BulldozingOptions | None = Field(
        BulldozingOptions(), description="Displaced soil moves by these rules; null: it vanishes."
    )
    step_s: PositiveFloat = Field(
        0.001,
        le=0.02,
        description="Physics advances by this step, s; one too large for the soil's stiffness is refused.",
    )
    energy_bound: PositiveFloat = Field(
        0.02, description="This share of energy may be unaccounted for; more ends a run."
    )

    @property
    def rule(self) -> Rule:
        return Rule(self.normal == "terrain", slip_length=self.slip_length_m)
