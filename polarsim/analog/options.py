"""Options of the analog sandbox. The defaults are known or assumed of NASA's sandbox."""

from __future__ import annotations

from pydantic import BaseModel, Field


class AnalogOptions(BaseModel, extra="forbid", frozen=True):
    """Options of sandbox and scanner; equal options make equal bytes."""

    seed: int = Field(1, description="Seed of terrains, drawings and noise.")
    photos: bool = Field(True, description="Make photos, seeds and true labels; false: scans only.")

    ground_step_mm: float = Field(
        5.0, ge=2, le=20, description="Step of the sand's height grid, mm: finer takes longer and has smaller ripples."
    )
    rock_detail: int = Field(
        5,
        ge=3,
        le=6,
        description="Subdivisions of the icosahedron that a rock is carved from; each has 4 times the faces.",
    )

    range_noise_mm: float = Field(2.0, ge=0, le=50, description="Standard deviation of the scanner's ranges, mm.")
    scan_step_deg: float = Field(
        0.072, gt=0.02, le=1, description="Angular step of the scanner, degrees: smaller makes more points."
    )
    mixed_pixels: float = Field(
        0.5, ge=0, le=1, description="Share of the scan points at depth edges that are mixed pixels."
    )
