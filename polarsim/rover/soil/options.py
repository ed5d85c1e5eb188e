"""Options of the soil."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.user_path import UserPath


class SoilOptions(BaseModel, extra="forbid", frozen=True):
    """Soil and time step of the physics."""

    soil: str = Field("lunar", description="Name of the soil in the table.")
    table: UserPath = Field(
        Path("config/soils.csv"), description="File with sets of constants, each with its source and gravity."
    )
    gravity_m_s2: PositiveFloat = Field(
        1.62, description="Gravity, m/s2; the soil's constants are scaled to it from that of their measurement."
    )
    slip_sinkage: bool = Field(True, description="Let a slipping wheel sink deeper, by the soil's n_slip.")
    step_s: PositiveFloat = Field(
        0.001, le=0.02, description="Time step, s; one too large for the soil's stiffness is refused."
    )
