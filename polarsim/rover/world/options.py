"""What the configuration says about the world that is driven over."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.photo import TERRAINS
from polarsim.user_path import UserPath


class FineReliefOptions(BaseModel, extra="forbid", frozen=True):
    """These options set the relief finer than what the elevation model shows, or all relief where there is none."""

    hurst: float = Field(
        0.76, gt=0, lt=1, description="Heights differ with this power of the distance (Hurst exponent; 0.76: maria)."
    )
    deviation_m: float = Field(
        0.02, ge=0, description="Heights of points 1 m apart differ by this in the root mean square, m."
    )


class CraterOptions(BaseModel, extra="forbid", frozen=True):
    """These options say which craters are dug into the ground."""

    share: float = Field(
        1.0, ge=0, le=1, description="There are this many craters over those of Trask's equilibrium; 0: none."
    )
    smallest_m: PositiveFloat = Field(0.3, description="The smallest craters have this diameter, m.")
    largest_m: PositiveFloat = Field(
        5.0, description="The largest craters have this diameter, m; larger ones are in the elevation model."
    )
    depth_over_diameter: tuple[PositiveFloat, PositiveFloat] = Field(
        (0.02, 0.08), description="Depths over diameters are drawn evenly between these; fresh craters have 0.196."
    )

    @model_validator(mode="after")
    def _ordered(self) -> CraterOptions:
        low, high = self.depth_over_diameter
        if low > high or high > 0.3:
            raise ValueError("depth_over_diameter: the lower one first, neither above 0.3")
        return self


class RockOptions(BaseModel, extra="forbid", frozen=True):
    """These options say which rocks are strewn over the ground; their shapes are the terrains' rocks."""

    abundance: float = Field(
        0.02,
        gt=0,
        le=0.4,
        description="Rocks cover this share of the ground (k of Golombek and Rapp's law, whose small ones are left "
        "out).",
    )
    smallest_m: PositiveFloat = Field(0.05, description="The smallest rocks have this diameter, m.")
    largest_m: PositiveFloat = Field(1.0, description="The largest rocks have this diameter, m.")
    clear_m: float = Field(1.5, ge=0, description="No rock lies so near to where the rover is put down, m.")

    @model_validator(mode="after")
    def _ordered(self) -> RockOptions:
        if self.smallest_m >= self.largest_m:
            raise ValueError("smallest_m is not below largest_m")
        return self


class DemOptions(BaseModel, extra="forbid", frozen=True):
    """The ground is a square of an elevation model, with craters and rocks strewn by laws, up to the horizon."""

    path: UserPath | None = Field(
        None,
        description="Heights are read from this GeoTIFF, in a projected frame in metres; null: relief alone is made "
        "up.",
    )
    centre_m: tuple[float, float] | None = Field(
        None, description="The square's centre, east and north in the file's frame, m; null: the file's middle."
    )
    size_m: PositiveFloat = Field(60.0, description="The square with craters and rocks has this side, m.")
    horizon_m: PositiveFloat = Field(
        300.0, description="The ground is shown so far from the centre, as far as the file reaches, m."
    )
    drive_m: PositiveFloat = Field(
        12.0, description="Without rover.drive.path_m the rover drives this far through the centre, east to west, m."
    )
    coarse_cell_m: PositiveFloat = Field(
        0.25, description="Nodes beyond the drive's grid grow up to this distance from each other in the square, m."
    )
    seed: int = Field(0, ge=0, description="Relief, craters and rocks are drawn with this seed; drives share them.")
    relief: FineReliefOptions = Field(
        FineReliefOptions(), description="This section sets the relief between the heights."
    )
    craters: CraterOptions = Field(CraterOptions(), description="This section says which craters there are.")
    rocks: RockOptions | None = Field(
        RockOptions(), description="This section says which rocks are strewn; null: none."
    )


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

    dem: DemOptions | None = Field(
        None,
        description="The ground is an elevation model with strewn craters and rocks in place of the strip; the "
        "terrains lend the rocks' shapes, and length_m, blend_m and filler_roughness_m have no effect.",
    )

    @property
    def half_length_m(self) -> float:
        """From the centre to either end of what is driven over, m."""
        return self.dem.drive_m / 2 if self.dem else self.length_m * len(self.terrains) / 2

    @field_validator("terrains")
    @classmethod
    def _known(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        for value in values:
            if value not in TERRAINS:
                raise ValueError(f"terrain {value}, expected 1 to 13")
        return values
