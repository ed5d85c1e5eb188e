"""Ranges of the random parameters of scenes beyond the sandbox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from polarsim.scenes.options import Range

GroundKind = Literal["plain", "ripples", "craters", "bedrock", "outcrop", "ledges"]
TARGET_M = 3.0  # distance of the camera from the ground at the centre of the image: scenes have no absolute size


@dataclass(frozen=True)
class FieldRanges:
    """Ranges (minimum, maximum) of the random rocks, ground, cameras, light and sensors of a scene.

    Sizes are relative to the width of the image at the distance of the object, so that a scene represents gravel in
    front of a hand lens as well as boulders on a slope. The ranges cover published photos of rovers and landers on
    the Moon and Mars. Light and exposure are those of images for which `polarsim detect` uses the detector: few pixels
    are dark or clipped. Values were not selected by the metrics of a detector; surfaces of rocks became rough, layered,
    porous and spotted because detectors divided such rocks in photos of the Curiosity rover.
    """

    scale: float = 0.33  # width of rendered images relative to a photo, as in `SceneOptions`
    grounds: tuple[GroundKind, ...] = ("plain", "ripples", "craters", "bedrock", "outcrop")  # equal probability

    negative_share: float = 0.1  # share of scenes without rocks
    rocks: Range = (8, 220)  # number of rocks, log-uniform
    smallest: float = 0.01  # minimum size of rocks
    largest: Range = (0.1, 0.7)  # maximum size of rocks, log-uniform
    size_power: Range = (0.8, 2.4)  # exponent of the power law of the number of larger rocks
    near_rocks: int = 5  # maximum number of additional rocks in the foreground
    near_share: float = 0.75  # share of scenes with such rocks
    near_size: Range = (0.1, 0.7)  # log-uniform
    perspective_share: float = 0.5  # share of scenes with one power law of sizes in metres; remaining: in the image
    piled_share: Range = (0.0, 0.4)  # share of the rocks of a scene in piles
    sunk: Range = (0.0, 0.6)  # burial depth over the height of a rock
    gravel: Range = (20, 1500)  # number of stones below the size of labels, log-uniform
    gravel_size: Range = (0.0015, 0.007)
    parts_share: float = 0.1  # share of scenes with parts of a rover or lander, which are not labelled
    tracks_share: float = 0.12  # share of scenes with wheel tracks

    field_of_view_deg: Range = (6, 80)  # horizontal, log-uniform: tele to wide
    horizon_share: float = 0.35  # share of scenes with a horizon
    pitch_deg: Range = (15, 85)  # depression of the optical axis in the remaining scenes
    low_height: Range = (0.03, 0.25)  # height of cameras close to the ground over the distance of the target
    rough: Range = (0.001, 0.02)  # standard deviation of the heights, log-uniform
    hurst: Range = (0.55, 1.0)
    hills: Range = (0.0, 0.12)  # elevation of hills at the horizon, tangent

    elevation_deg: Range = (5, 75)  # of the Sun
    black_sky_share: float = 0.15  # share of scenes without light of the sky
    sky_fill: Range = (0.1, 1.5)  # irradiance of the sky over the Sun's, in the remaining scenes
    sky: Range = (0.4, 2.5)  # radiance of the sky over that of bright ground
    haze: Range = (20, 800)  # distance over `TARGET_M` at which haze halves contrast, log-uniform

    albedo_ratio: Range = (0.35, 2.6)  # mean albedo of rocks over that of the ground, log-uniform
    rock_spread: float = 0.15  # standard deviation of albedo between rocks
    rock_spots: Range = (0.0, 0.3)  # standard deviation of the logarithm of albedo within a rock
    dust: Range = (0.0, 0.9)  # share of the ground's albedo on upward faces of rocks
    patch_sd: Range = (0.02, 0.2)  # standard deviation of the albedo of ground
    texture: Range = (0.02, 0.3)  # contrast of texture below the mesh on the ground
    rock_texture: Range = (0.03, 0.6)  # the same on rocks

    blur_px: Range = (0.2, 1.3)
    electrons_per_dn: Range = (3, 30)
    exposure: Range = (0.25, 0.85)  # 90th percentile of the ground over white
    gamma: Range = (1.0, 2.2)
    jpeg_share: float = 0.7  # share of images that were compressed
    jpeg_quality: Range = (35, 95)
    min_contrast: float = 0.06  # minimum contrast of labelled rocks and shadows, see `SceneRanges`


def log_uniform(limits: Range, random: np.random.Generator) -> float:
    """Return a random number whose logarithm is uniform between the logarithms of the limits."""
    return float(np.exp(random.uniform(*np.log(limits))))
