"""What the configuration says about the camera: pixel filter, lens faults, noise. The defaults add nothing."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, model_validator

from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS


class SensorOptions(BaseModel, extra="forbid", frozen=True):
    """From the scene's light to grey values. Black level (16) and clipping (12 bits) are those of the data set."""

    samples: Literal[1, 4, 9, 16] = Field(1, description="Rays a pixel.")
    pixel_filter: Literal["box", "gaussian"] = Field(
        "box",
        description="Where they go: evenly over the pixel, or as a Gaussian about its centre, which reaches over.",
    )
    filter_sd_px: float = Field(0.5, gt=0, le=1.5, description="Standard deviation of the Gaussian pixel filter, px.")

    blur_px: float = Field(0, ge=0, le=50, description="Standard deviation of the lens's point spread, px; 0: sharp.")
    bloom: float = Field(0, ge=0, le=1, description="Share of a point's light that the lens scatters into a halo.")
    bloom_px: float = Field(60, gt=0, description="Standard deviation of that halo, px.")
    veiling_glare: float = Field(
        0, ge=0, le=1, description="Share of the picture's light that the lens spreads evenly over it."
    )
    lens_flare: float = Field(
        0,
        ge=0,
        le=1,
        description="Share of a lamp's light on the lens that is scattered over the picture, as one over the square of "
        "the angle from the lamp; only lamps that the camera sees, or would see if it had a wider view.",
    )
    vignetting: bool = Field(False, description="Darken by the fourth power of the cosine to the optical axis.")

    noise: bool = Field(False, description="Shot and read noise; noisy twins take 1.5 times the space.")
    electrons_per_grey_value: float = Field(
        ELECTRONS_PER_DN, gt=0, description="Photo-electrons that make a grey value: the more, the less shot noise."
    )
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
