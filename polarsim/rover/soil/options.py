"""Options of the soil."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.user_path import UserPath


class SoilOptions(BaseModel, extra="forbid", frozen=True):
    """Soil and time step of the physics."""

    soil: str = Field("lunar", description="Name of the soil in the table.")
    table: UserPath = Field(
        Path("config/soils.csv"), description="File with the constants of soils, their source and their gravity."
    )
    gravity_m_s2: PositiveFloat = Field(
        1.62, description="Gravity, m/s2. The soil's constants are scaled from the gravity of their measurement."
    )
    slip_sinkage: bool = Field(True, description="Increase the sinkage of slipping wheels by the soil's n_slip.")
    step_s: PositiveFloat = Field(
        0.001, le=0.02, description="Time step, s. Lower is slower; too high for the soil's stiffness is an error."
    )
