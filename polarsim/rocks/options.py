"""Options of the rocks stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class RocksOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the rocks stage."""

    min_size_mm: float = Field(35, gt=0, description="Minimum of the longest horizontal side of rocks, mm.")
    min_height_mm: float = Field(15, gt=0, description="Minimum height of rocks above the ground, mm.")
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
