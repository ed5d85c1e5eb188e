"""Options of randomised training scenes, and the ranges of the random parameters."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, Field

from polarsim.render.options import Model

Range = tuple[float, float]  # minimum and maximum of a uniform distribution
SCENE_NAME = re.compile(r"t([A-Za-z0-9-]+)_s(\d+)_l\d+")  # name of an image: terrain, scene, lamp


class SceneOptions(BaseModel, extra="forbid", frozen=True):
    """Number and size of the rendered scenes."""

    kind: Literal["sandbox", "field"] = Field(
        "sandbox",
        description="sandbox: sand and walls under low lamps, as POLAR. field: natural ground with or without sky, for "
        "images from elsewhere.",
    )
    number: int = Field(64, ge=1, description="Number of scenes with the rocks of each terrain.")
    lamps: int = Field(
        6,
        ge=1,
        description="Images per scene, one per lamp. An additional lamp is cheaper than an additional scene.",
    )
    scale: float = Field(0.5, gt=0, le=1, description="Rendered width relative to a photo. Larger images take longer.")
    seed: int = Field(0, ge=0, description="Seed of all scenes.")


@dataclass(frozen=True)
class SceneRanges:
    """Ranges of the random rocks, sand, cameras, lamps, materials and sensors of a scene.

    The ranges were chosen by evaluating detectors on cover photos (docs/notes/detect.md). They are wider than the known
    values of NASA's sandbox, so that NASA's photos are inside the ranges.
    """

    scale: float = 0.5  # width of rendered images relative to a photo, as in `SceneOptions`
    models: tuple[Model, ...] = ("hapke", "principled")  # reflectance models, with equal probability

    rocks: tuple[int, int] = (3, 40)  # number of rocks
    rock_size_m: Range = (0.05, 0.6)  # longest extent
    size_power: Range = (0.5, 2.0)  # exponent of the power law of the number of larger rocks
    rock_scale: Range = (0.3, 2.0)  # size relative to the scanned rock
    tumbled_share: float = 0.25  # share of rocks rotated about any axis; remaining rocks: about the vertical
    tilt_sd_deg: float = 6.0  # standard deviation of the tilt of rocks rotated about the vertical
    sunk: Range = (0.0, 0.6)  # burial depth in sand over the height of the rock
    sunk_into_rocks: Range = (0.02, 0.15)  # depth in the rocks of a pile over the height of the rock
    piled_share: Range = (0.0, 0.35)  # share of the rocks of a scene in piles

    cell_m: float = 0.005  # minimum cell size of the ground mesh
    rough_sd_m: Range = (0.001, 0.004)  # standard deviation of roughness at all sizes
    max_layers: int = 2  # maximum number of layers of ridges, each with a different direction
    swell_sd_m: Range = (0.0, 0.02)  # standard deviation of wide swells
    swell_width_m: float = 0.25  # correlation length of swells
    max_craters: int = 1  # maximum number of craters

    rig_share: float = 0.5  # share of scenes with NASA's rig; remaining scenes: a rover, from the next three ranges
    camera_height_m: Range = (0.3, 2.0)
    camera_distance_m: Range = (0.7, 4.5)  # distance of the camera from the target
    focal_px: Range = (1500, 2800)  # focal length for an image of `REFERENCE_SIZE_PX`; NASA's rig: 2070
    min_sand_share: float = 0.55  # minimum share of the image that shows sand and rocks

    elevation_deg: Range = (2, 15)  # elevation of lamps above the horizon at the centre of the sand
    near_share: float = 0.7  # share of lamps at the distance of NASA's lamps; remaining lamps: at infinity
    lamp_distance_m: Range = (3.2, 5.5)
    min_lit_share: float = 0.25  # minimum share of the visible sand that a lamp lights

    rock_albedo: Range = (0.7, 2.2)  # mean albedo of the rocks relative to the sand
    rock_spread: float = 0.15  # standard deviation of albedo between the rocks of a scene
    patch_sd: Range = (0.0, 0.15)  # standard deviation of albedo between patches of sand
    walled_share: float = 0.7  # share of scenes with the walls of the sandbox
    hapke_w: Range = (0.15, 0.6)  # Hapke's single-scattering albedo
    roughness: Range = (0.5, 1.0)  # roughness of the principled model; 1: no highlight
    specular: Range = (0.0, 0.7)  # specular strength of the principled model; 0: no highlight

    background: Range = (0.0, 0.4)  # mean brightness of the dark hall relative to lit sand
    blur_px: Range = (0.0, 1.0)
    lens_flare: Range = (0.0, 0.003)  # share of the light of a lamp that the lens scatters over the image
    noise: bool = True  # shot and read noise
    electrons_per_dn: Range = (3, 20)
    exposure: Range = (0.15, 1.0)  # 90th percentile of the sand over white
    gamma: Range = (1.0, 2.0)  # gamma of the tone curve from 12 to 8 bits
    max_strokes: int = 30  # maximum number of boxes drawn into half of the images and erased again, as on cover photos
    min_contrast: float = 0.06  # minimum contrast over white of labelled rocks and shadows: below it they are invisible
