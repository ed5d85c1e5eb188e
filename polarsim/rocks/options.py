"""Options of the rocks stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class RocksOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the rocks stage."""

    min_size_mm: float = Field(35, gt=0, description="Minimum of the longest horizontal side of rocks, mm.")
    min_height_mm: float = Field(15, gt=0, description="Minimum height of rocks above the ground, mm.")
    bump_size_mm: float = Field(
        95, ge=0, description="Maximum longest side of rocks that are detected as convex bumps, mm. 0 disables this."
    )
    max_sand_slope_deg: float = Field(
        40,
        gt=0,
        lt=90,
        description="Maximum slope of sand, degrees. Steeper surfaces are rock. Loose sand rests at up to 38.",
    )
    rock_cell_mm: float = Field(
        1.9,
        gt=0,
        description="Cell of the Poisson reconstruction of rocks, mm; sets the depth of the octree.",
    )
    ground_mesh_cell_mm: float = Field(
        4, gt=0, description="Cell of the ground mesh, mm. Larger cells give fewer triangles."
    )
    ground_from_photos: bool = Field(
        False, description="Measure the ground without scans in photos from several cameras, before rendering."
    )
