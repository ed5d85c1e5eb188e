"""What a user may vary of the analog sandbox. The defaults are what is known or assumed of NASA's."""

from __future__ import annotations

from pydantic import BaseModel, Field


class AnalogOptions(BaseModel, extra="forbid", frozen=True):
    """Sandbox, scanner, photographer and annotator follow these options; the same ones and seed make the same bytes."""

    seed: int = Field(
        1,
        description="Everything random is drawn from this seed: another one makes other terrains, drawings and noise.",
    )
    photos: bool = Field(True, description="Photos, seeds and true labels are made; false leaves scans only.")

    ground_step_mm: float = Field(
        5.0,
        ge=2,
        le=20,
        description="The sand's relief is made on a grid of this step, mm; a finer one takes longer and shows "
        "smaller ripples.",
    )
    rock_detail: int = Field(
        5,
        ge=3,
        le=6,
        description="Rocks are carved from an icosahedron that is subdivided so many times; each time has four "
        "times the triangles.",
    )

    range_noise_mm: float = Field(
        2.0,
        ge=0,
        le=50,
        description="Distances of the scanner have noise of this standard deviation along the ray, mm.",
    )
    scan_step_deg: float = Field(
        0.072,
        gt=0.02,
        le=1,
        description="The scanner measures at every so many degrees; a smaller step makes more points.",
    )
    mixed_pixels: float = Field(
        0.5,
        ge=0,
        le=1,
        description="This share of the scan points at depth edges hangs between what is near and what is far, as "
        "mixed pixels do.",
    )
