"""Options of the rocks stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class RocksOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how scans become rocks and ground, and how clouds become meshes."""

    min_size_mm: float = Field(35, gt=0, description="Rocks have a longest horizontal side of at least this, mm.")
    min_height_mm: float = Field(15, gt=0, description="Rocks stand at least so high above the ground, mm.")
    bump_size_mm: float = Field(
        95, ge=0, description="Rocks up to this longest side are found as convex bumps of the sand, mm; 0: none is."
    )
    max_sand_slope_deg: float = Field(
        40,
        gt=0,
        lt=90,
        description="Sand is up to so steep, degrees, and what is steeper is rock. Loose sand rests at up to 38.",
    )
    rock_cell_mm: float = Field(
        1.9,
        gt=0,
        description="Cell of the Poisson reconstruction of rocks, mm (sets its depth); larger: fewer triangles.",
    )
    ground_mesh_cell_mm: float = Field(
        4, gt=0, description="The ground is meshed in cells of this side, mm; larger ones make fewer triangles."
    )
