"""Options of the rocks stage."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field


class RocksOptions(BaseModel, extra="forbid", frozen=True):
    """How scans become rocks and ground, and clouds become meshes."""

    min_size_mm: float = Field(35, gt=0, description="Longest horizontal side of the smallest rock, mm.")
    min_height_mm: float = Field(15, gt=0, description="Height above ground of the lowest rock, mm.")
    bump_size_mm: float = Field(
        95, ge=0, description="Longest side of the largest rock found as a convex bump of the sand, mm; 0: none is."
    )
    max_sand_slope_deg: float = Field(
        40, gt=0, lt=90, description="Steepest slope of sand, degrees; steeper is rock. Loose sand rests at up to 38."
    )
    settle: bool = Field(
        True, description="Whether scans are shifted onto each other rock by rock, where points tell by how much."
    )
    rock_cell_mm: float = Field(1.9, gt=0, description="Cell of a rock's Poisson reconstruction, mm.")
    ground_mesh_cell_mm: float = Field(4, gt=0, description="Cell of the ground's mesh, mm.")
    ground_surface: Literal["poisson", "heights"] = Field(
        "poisson", description="How the ground is meshed: Poisson reconstruction, or triangles between grid heights."
    )
