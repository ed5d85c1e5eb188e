"""Options of the ground."""

from __future__ import annotations

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.site_parts import TerrainName
from polarsim.user_path import UserPath

EDGE_M = 0.25  # margin at both ends of a sandbox that is left out
BORDER_M = 0.5  # width of filler ground on both sides of the terrains


class DemOptions(BaseModel, extra="forbid", frozen=True):
    """A square of an elevation model as the ground, with random craters and rocks, up to the horizon."""

    path: UserPath | None = Field(
        None, description="GeoTIFF of heights, in a projected frame in metres; null: random relief."
    )
    centre_m: tuple[float, float] | None = Field(
        None, description="Centre of the square, east and north in the file's frame, m; null: the file's middle."
    )
    size_m: PositiveFloat = Field(60.0, description="Side of the square with craters and rocks, m.")
    horizon_m: PositiveFloat = Field(300.0, description="Distance up to which the ground is rendered, m.")
    drive_m: PositiveFloat = Field(12.0, description="Length of the default path through the centre, east to west, m.")
    seed: int = Field(0, ge=0, description="Seed of relief, craters and rocks, common to all drives.")
    relief_m: float = Field(
        0.02, ge=0, description="RMS height difference of points 1 m apart in the relief added below a pixel, m."
    )
    craters: float = Field(
        1.0, ge=0, le=1, description="Number of craters relative to Trask's equilibrium; 0: no craters."
    )
    rocks: float = Field(
        0.02, ge=0, le=0.4, description="Share of the ground covered by rocks (k of Golombek and Rapp); 0: no rocks."
    )


class WorldOptions(BaseModel, extra="forbid", frozen=True):
    """Ground of a drive."""

    terrains: tuple[TerrainName, ...] = Field(
        (4, 1, 11), min_length=1, description="Terrains of the strip by number or name, from east to west."
    )
    terrain_m: PositiveFloat = Field(
        3.5,
        description="Length of each terrain in the strip, m; default: that of the site's sandbox without its edges.",
    )
    width_m: PositiveFloat = Field(
        5.0, description="Width of the strip including filler ground, m; default: sandbox and 0.5 m on both sides."
    )
    margin_m: PositiveFloat = Field(2.5, description="Length of filler ground at both ends of the terrains, m.")
    cell_m: PositiveFloat = Field(0.02, le=0.1, description="Distance between nodes of the ground, m.")
    dem: DemOptions | None = Field(
        None, description="Elevation model that replaces the strip; the terrains provide the shapes of rocks."
    )

    @property
    def half_length_m(self) -> float:
        """Distance from the centre to the ends of the default path, m."""
        return self.dem.drive_m / 2 if self.dem else self.terrain_m * len(self.terrains) / 2
