"""Options of the analog. The defaults are known or assumed properties of NASA's scanner and sand."""

from __future__ import annotations

from pydantic import BaseModel, Field


class AnalogOptions(BaseModel, extra="forbid", frozen=True):
    """Options of sandbox and scanner. Equal options produce equal bytes."""

    seed: int = Field(1, description="Seed of terrains, annotations and noise.")
    photos: bool = Field(True, description="Generate photos, seeds and true labels; false: scans only.")

    ground_step_mm: float = Field(
        5.0,
        ge=2,
        le=20,
        description="Step of the height grid of the sand, mm. Smaller steps take longer and add smaller ripples.",
    )
    rock_detail: int = Field(
        5,
        ge=3,
        le=6,
        description="Subdivisions of the icosahedron of a rock. Each step multiplies the number of faces by 4.",
    )

    range_noise_mm: float = Field(2.0, ge=0, le=50, description="Standard deviation of scanner ranges, mm.")
    scan_step_deg: float = Field(
        0.072, gt=0.02, le=1, description="Angular step of the scanner, degrees. Smaller steps produce more points."
    )
    mixed_pixels: float = Field(
        0.5, ge=0, le=1, description="Share of the scan points at depth edges that are mixed pixels."
    )
