"""What the configuration says about the camera: pixel filter, lens faults, noise. The defaults add nothing."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, model_validator

from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS


class SensorOptions(BaseModel, extra="forbid", frozen=True):
    """From the scene's light to grey values. Black level (16) and clipping (12 bits) are those of the data set."""

    samples: Literal[1, 4, 9, 16] = Field(
        1, description="So many rays are cast a pixel; more smooth edges and take longer."
    )
    pixel_filter: Literal["box", "gaussian"] = Field(
        "box",
        description="Rays are spread evenly over the pixel, or as a Gaussian about its centre, which reaches over.",
    )

    blur_px: float = Field(
        0,
        ge=0,
        le=50,
        description="The lens blurs a point to a Gaussian of this standard deviation, px; 0: it is sharp.",
    )
    bloom: float = Field(0, ge=0, le=1, description="The lens scatters this share of a point's light into a halo.")
    bloom_px: float = Field(60, gt=0, description="The halo of `bloom` is a Gaussian of this standard deviation, px.")
    veiling_glare: float = Field(
        0, ge=0, le=1, description="The lens spreads this share of the picture's light evenly over it."
    )
    lens_flare: float = Field(
        0,
        ge=0,
        le=1,
        description="The lens scatters this share of a lamp's light over the picture, as one over the square of the"
        " angle from the lamp; only of lamps that the camera sees, or would see if it had a wider view.",
    )
    vignetting: bool = Field(
        False, description="Pictures darken by the fourth power of the cosine to the optical axis."
    )

    noise: bool = Field(False, description="Twins have shot and read noise; noisy ones take 1.5 times the space.")
    electrons_per_dn: float = Field(
        ELECTRONS_PER_DN, gt=0, description="So many photo-electrons make a grey value: the more, the less shot noise."
    )
    read_noise_electrons: float = Field(
        READ_NOISE_ELECTRONS, ge=0, description="Reading a pixel adds noise of this standard deviation, electrons."
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
