"""Options of the camera: pixel filter, lens faults, noise. The defaults add none."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, model_validator

from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS


class SensorOptions(BaseModel, extra="forbid", frozen=True):
    """From radiance to DN. Black level (16) and clipping (12 bits) are those of the data set."""

    samples: Literal[1, 4, 9, 16] = Field(1, description="Rays per pixel: more smooth edges and take longer.")
    pixel_filter: Literal["box", "gaussian"] = Field(
        "box", description="Distribution of the rays: even over the pixel, or Gaussian about its centre."
    )

    blur_px: float = Field(0, ge=0, le=50, description="Standard deviation of the lens's Gaussian point spread, px.")
    bloom: float = Field(0, ge=0, le=1, description="Share of light that the lens scatters into a halo.")
    bloom_px: float = Field(60, gt=0, description="Standard deviation of the Gaussian halo of `bloom`, px.")
    veiling_glare: float = Field(0, ge=0, le=1, description="Share of light that the lens spreads over the picture.")
    lens_flare: float = Field(
        0,
        ge=0,
        le=1,
        description="Share of a visible lamp's light that the lens scatters, by its inverse square angle.",
    )
    vignetting: bool = Field(False, description="Darken by the fourth power of the cosine to the optical axis.")

    noise: bool = Field(False, description="Shot and read noise. Noisy twins take 1.5 times the space.")
    electrons_per_dn: float = Field(ELECTRONS_PER_DN, gt=0, description="Electrons per DN: more have less shot noise.")
    read_noise_electrons: float = Field(
        READ_NOISE_ELECTRONS, ge=0, description="Standard deviation of the read noise, electrons."
    )

    @model_validator(mode="after")
    def _samples_for_a_filter(self) -> SensorOptions:
        if self.pixel_filter == "gaussian" and self.samples == 1:
            raise ValueError("pixel_filter: gaussian needs samples of 4, 9 or 16")
        return self

    @model_validator(mode="after")
    def _light_to_spread(self) -> SensorOptions:
        if self.bloom + self.veiling_glare > 1:
            raise ValueError("bloom and veiling_glare: more than all light, their sum is above 1")
        return self
