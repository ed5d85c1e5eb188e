"""Options of the camera: pixel filter, lens effects and noise, all off by default."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, model_validator

from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS


class SensorOptions(BaseModel, extra="forbid", frozen=True):
    """Conversion of radiance to DN. Black level (16) and clipping (12 bits) are fixed by the data set."""

    samples: Literal[1, 4, 9, 16] = Field(1, description="Rays per pixel. More rays smooth edges and take longer.")
    pixel_filter: Literal["box", "gaussian"] = Field(
        "box", description="Distribution of the rays: uniform over the pixel, or Gaussian around the centre."
    )

    blur_px: float = Field(0, ge=0, le=50, description="Standard deviation of the lens's Gaussian point spread, px.")
    bloom: float = Field(0, ge=0, le=1, description="Share of light that the lens scatters into a halo.")
    bloom_px: float = Field(60, gt=0, description="Standard deviation of the Gaussian halo of `bloom`, px.")
    veiling_glare: float = Field(0, ge=0, le=1, description="Share of light that the lens spreads over the image.")
    lens_flare: float = Field(
        0,
        ge=0,
        le=1,
        description="Share of a visible lamp's light that the lens scatters, by the inverse square of the angle.",
    )
    vignetting: bool = Field(False, description="Darken by the fourth power of the cosine to the optical axis.")

    noise: bool = Field(False, description="Add shot and read noise. Files are 1.5 times as large.")
    electrons_per_dn: float = Field(
        ELECTRONS_PER_DN, gt=0, description="Electrons per DN. Higher values reduce shot noise."
    )
    read_noise_electrons: float = Field(
        READ_NOISE_ELECTRONS, ge=0, description="Standard deviation of the read noise, electrons."
    )

    @model_validator(mode="after")
    def _check_samples(self) -> SensorOptions:
        if self.pixel_filter == "gaussian" and self.samples == 1:
            raise ValueError("pixel_filter: gaussian requires samples: 4, 9 or 16")
        return self

    @model_validator(mode="after")
    def _check_shares(self) -> SensorOptions:
        if self.bloom + self.veiling_glare > 1:
            raise ValueError(f"bloom + veiling_glare is {self.bloom + self.veiling_glare:g}, expected at most 1")
        return self
