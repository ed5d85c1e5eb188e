"""What the configuration says about the world that is driven over."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat, field_validator

from polarsim.photo import TERRAINS


class WorldOptions(BaseModel, extra="forbid", frozen=True):
    """The section describes the ground that is driven over."""

    terrains: tuple[int, ...] = Field(
        (4, 1, 11), min_length=1, description="The strip has the terrains with these numbers, from east to west."
    )
    length_m: PositiveFloat = Field(3.5, le=4.0, description="Every terrain takes this length of the strip, m.")
    width_m: PositiveFloat = Field(
        5.0, description="The strip is this wide, m; beside the terrains lies filler ground."
    )
    margin_m: PositiveFloat = Field(
        2.5, description="Filler ground reaches this far before and behind the terrains, m."
    )
    cell_m: PositiveFloat = Field(0.02, le=0.1, description="Nodes of the ground stand this far apart, m.")
    blend_m: PositiveFloat = Field(0.4, description="Two grounds pass into each other over this length at a seam, m.")
    filler_roughness_m: float = Field(
        0.003, ge=0, description="Heights of filler ground have this standard deviation, m."
    )

    @field_validator("terrains")
    @classmethod
    def _known(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        for value in values:
            if value not in TERRAINS:
                raise ValueError(f"terrain {value}, expected 1 to 13")
        return values
