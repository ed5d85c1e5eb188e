"""Options of randomised training scenes, and the ranges that every scene is drawn from."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel, Field

from polarsim.render.options import Model

Range = tuple[float, float]  # minimum and maximum of a uniform distribution


class SceneOptions(BaseModel, extra="forbid", frozen=True):
    """Number and size of the rendered scenes."""

    number: int = Field(64, ge=1, description="Number of scenes with the rocks of each terrain.")
    lamps: int = Field(
        6,
        ge=1,
        description="Images of each scene, one per lamp; a lamp more costs less than a scene more.",
    )
    scale: float = Field(0.5, gt=0, le=1, description="Rendered width over that of a photo; time grows with it.")
    seed: int = Field(0, ge=0, description="Seed of all scenes.")


@dataclass(frozen=True)
class SceneRanges:
    """Ranges of rocks, sand, cameras, lamps, materials and sensors that every scene is drawn from.

    Chosen by detectors of scenes that were tested on cover photos (docs/notes/detect.md). Ranges are wider than what is
    known of NASA's sandbox, so that its photos lie inside them.
    """

    scale: float = 0.5  # width of rendered images over that of a photo, as in `SceneOptions`
    models: tuple[Model, ...] = ("hapke", "principled")  # reflectance model of a scene, each as often

    rocks: tuple[int, int] = (3, 40)  # number of rocks
    rock_size_m: Range = (0.05, 0.6)  # longest extent
    size_power: Range = (0.5, 2.0)  # power of the size by which the number of larger rocks falls
    rock_scale: Range = (0.3, 2.0)  # size over that of the scanned rock
    tumbled_share: float = 0.25  # share of rocks rotated about any axis; the others about the vertical
    tilt_sd_deg: float = 6.0  # of rocks rotated about the vertical
    sunk: Range = (0.0, 0.6)  # burial depth in sand over the rock's height
    sunk_into_rocks: Range = (0.02, 0.15)  # depth in the rocks of a pile over the rock's height
    piled_share: Range = (0.0, 0.35)  # share of a scene's rocks that are in piles

    cell_m: float = 0.005  # minimum side of the cells of the ground's mesh
    rough_sd_m: Range = (0.001, 0.004)  # standard deviation of roughness at all sizes
    most_layers: int = 2  # maximum number of layers of ridges, each with its own direction
    swell_sd_m: Range = (0.0, 0.02)  # standard deviation of wide swells
    swell_width_m: float = 0.25  # correlation length of swells
    most_craters: int = 1  # maximum number of craters

    rig_share: float = 0.5  # share of scenes seen as by NASA's rig; others as by a rover, from the next three ranges
    camera_height_m: Range = (0.3, 2.0)
    camera_distance_m: Range = (0.7, 4.5)  # from the camera to the point that it is aimed at
    focal_px: Range = (1500, 2800)  # of a full photo; the rig's is 2070
    least_sand: float = 0.55  # minimum share of the image that shows sand and rocks

    elevation_deg: Range = (2, 15)  # of lamps above the horizon, from the centre of the sand
    near_share: float = 0.7  # share of lamps at the distance of NASA's; the others are as far as the Sun
    lamp_distance_m: Range = (3.2, 5.5)
    least_lit: float = 0.25  # minimum share of the visible sand that a lamp lights

    rock_albedo: Range = (0.7, 2.2)  # mean albedo of a scene's rocks over that of its sand
    rock_spread: float = 0.15  # standard deviation of albedo between the rocks of a scene
    patch_sd: Range = (0.0, 0.15)  # standard deviation of albedo between patches of sand
    walled_share: float = 0.7  # share of scenes with the walls of the sandbox
    hapke_w: Range = (0.15, 0.6)  # Hapke's single-scattering albedo
    roughness: Range = (0.5, 1.0)  # of the principled model; 1 has no highlight
    specular: Range = (0.0, 0.7)  # of the principled model; 0 has no highlight

    background: Range = (0.0, 0.4)  # mean brightness of the dark hall behind the walls over that of lit sand
    blur_px: Range = (0.0, 1.0)
    lens_flare: Range = (0.0, 0.003)  # share of a lamp's light that the lens scatters over the image
    noise: bool = True  # shot and read noise
    electrons_per_dn: Range = (3, 20)
    exposure: Range = (0.15, 1.0)  # 90th percentile of the sand's light over white
    gamma: Range = (1.0, 2.0)  # of the curve from 12 to 8 bits
    strokes: int = 30  # maximum number of boxes drawn into half of the images and erased again, as on cover photos
    least_contrast: float = 0.06  # of the edge over white: a rock or shadow below it has no label, as people see none
