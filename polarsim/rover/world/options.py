"""What the configuration says about the world that is driven over."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat, field_validator

from polarsim.photo import TERRAINS


class WorldOptions(BaseModel, extra="forbid", frozen=True):
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
