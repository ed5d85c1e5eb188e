"""What a user may vary of the analog sandbox. The defaults are what is known or assumed of NASA's."""

from __future__ import annotations

from pydantic import BaseModel, Field


class AnalogOptions(BaseModel, extra="forbid", frozen=True):
    """The sandbox, its scanner, its photographer and its annotator. Same options and seed, same bytes."""

    seed: int = Field(1, description="Run seed of everything random.")
    photos: bool = Field(True, description="Whether photos, seeds and true labels are made; false leaves scans only.")

    ground_step_mm: float = Field(5.0, ge=2, le=20, description="Grid step of the sand's relief, mm.")
    rock_detail: int = Field(5, ge=3, le=6, description="Subdivisions of the icosahedron that rocks are carved from.")

    lamp_radius_mm: float = Field(45, ge=0, le=300, description="Radius of a lamp's bright disc, mm.")

    range_noise_mm: float = Field(2.0, ge=0, le=50, description="Scanner's noise along the ray (sd), mm.")
    scan_step_deg: float = Field(0.072, gt=0.02, le=1, description="Scanner's angular step, degrees.")
    mixed_pixels: float = Field(0.5, ge=0, le=1, description="Share of scan points at depth edges that hang between.")

    full_well_electrons: float = Field(33000, gt=0, description="Full well of a pixel, electrons.")
    read_noise_electrons: float = Field(7.0, ge=0, description="Read noise (sd), electrons.")
    electrons_per_dn: float = Field(8.0, gt=0, description="Gain, electrons per DN.")
