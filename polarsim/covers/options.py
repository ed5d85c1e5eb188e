"""Options of the covers stage."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.photo import TERRAINS, USUAL_EXPOSURE_MS, PhotoKey
from polarsim.render.options import Model

CARVED = 0  # stands for a terrain where rocks are not scanned but carved by the analog's generator
Range = tuple[float, float]  # from least to most


class ReliefOptions(BaseModel, extra="forbid", frozen=True):
    """Ranges, from least to most, that every scene draws its sand from. Metres."""

    cell_m: float = Field(0.005, gt=0, description="Least side of the ground mesh's cells.")
    most_cells: int = Field(270, ge=10, description="Cells of the ground mesh along the longer side of what is seen.")
    rough_sd_m: Range = Field((0.001, 0.004), description="Standard deviation of roughness of all sizes.")
    finest_m: float = Field(0.008, gt=0, description="Least size of that roughness.")
    widest_m: float = Field(0.4, gt=0, description="Largest size of that roughness.")
    most_layers: int = Field(
        2, ge=0, description="Layers of ridges, each along a direction of its own: none to so many."
    )
    ridge_sd_m: Range = Field((0.0003, 0.002), description="Standard deviation of a layer's heights.")
    ridge_width_m: Range = Field((0.01, 0.03), description="Correlation length across a ridge.")
    ridge_length_m: Range = Field((0.015, 0.12), description="Correlation length along a ridge.")
    swell_sd_m: Range = Field((0.0, 0.02), description="Standard deviation of wide swells.")
    swell_width_m: float = Field(0.25, gt=0, description="Correlation length of swells.")
    most_craters: int = Field(1, ge=0, description="A scene has from none to so many craters.")
    crater_radius_m: Range = Field((0.1, 1.1), description="Radius of a crater at its crest.")
    crater_depth: Range = Field((0.1, 0.3), description="Depth of a crater over its radius.")


class HallOptions(BaseModel, extra="forbid", frozen=True):
    """Ranges, from least to most; brightness is over that of lit sand."""

    brightness: Range = Field((0.0, 0.4), description="Mean of what is behind the walls.")
    folds_sd: Range = Field((0.0, 0.0), description="Standard deviation of the log brightness of the walls' cloth.")
    most_cards: int = Field(0, ge=0, description="Framed cards that lean on the walls: none to so many a picture.")
    card_m: Range = Field((0.15, 0.4), description="Width of a card.")
    card: Range = Field((0.05, 2.0), description="Brightness of a card and of its frame.")
    most_glares: int = Field(0, ge=0, description="Blobs of light that the lens throws: none to so many a picture.")
    glare: Range = Field((0.0, 0.6), description="Brightness of such a blob's centre.")
    glare_share: Range = Field((0.02, 0.1), description="Standard deviation of its width over that of the picture.")


class SceneOptions(BaseModel, extra="forbid", frozen=True):
    """Ranges, from least to most, that every strewn scene is drawn from."""

    number: int = Field(64, ge=1, description="Scenes strewn with the rocks of each terrain.")
    lamps: int = Field(6, ge=1, description="Pictures of a scene, each from its own lamp; they share the rays.")
    scale: float = Field(0.5, gt=0, le=1, description="Size of the pictures over that of a photo.")
    seed: int = Field(0, ge=0, description="Seed of all that is drawn.")
    models: tuple[Model, ...] = Field(("hapke", "principled"), min_length=1, description="A scene has one of them.")

    rocks: tuple[int, int] = Field((3, 40), description="Rocks of a scene.")
    rock_size_m: Range = Field((0.05, 0.6), description="Longest extent of a rock.")
    size_power: Range = Field((0.5, 2.0), description="Power at which the number of rocks larger than a size falls.")
    rock_scale: Range = Field((0.3, 2.0), description="Size of a strewn rock over that of the scanned one.")
    tumbled_share: float = Field(0.25, ge=0, le=1, description="Share of rocks that are turned about any axis.")
    tilt_sd_deg: float = Field(6, ge=0, description="Tilt of the other ones, which are turned about the vertical.")
    sunk: Range = Field((0.0, 0.6), description="Share of its height that a rock on sand is sunk.")
    sunk_into_rocks: Range = Field((0.02, 0.15), description="Share of its height that a rock of a pile is sunk.")
    piled_share: Range = Field((0.0, 0.35), description="Share of a scene's rocks that lie in piles.")
    evenness: Range = Field(
        (0.0, 1.0), description="From rocks strewn evenly over the picture, 0, to over the sand, 1."
    )
    relief: ReliefOptions = Field(ReliefOptions(), description="Relief of the sand.")
    sand_half_width_m: float = Field(2.05, gt=0, description="Half the width of the sand inside walls.")
    open_half_width_m: float = Field(3.0, gt=0, description="Half the width of sand without walls.")

    rig_share: float = Field(
        0.5,
        ge=0,
        le=1,
        description="Share of scenes seen as by NASA's rig: from outside the sand, by its lens. The others are seen "
        "from anywhere that the next three ranges allow, as by a rover too.",
    )
    camera_height_m: Range = Field((0.3, 2.0), description="Height of the camera above the sand.")
    camera_distance_m: Range = Field((0.7, 4.5), description="How far before the camera it looks at the sand.")
    focal_px: Range = Field((1500, 2800), description="Focal length in pixels of a full photo; the rig's has 2070.")
    roll_sd_deg: float = Field(2, ge=0, description="Standard deviation of the camera's roll.")
    least_sand: float = Field(0.55, ge=0, le=1, description="Share of a picture that sand and rocks fill.")

    elevation_deg: Range = Field((2, 15), description="Height of a lamp above the horizon, seen from the centre.")
    near_share: float = Field(0.7, ge=0, le=1, description="Share of lamps as near as NASA's; the others are the Sun.")
    lamp_distance_m: Range = Field((3.2, 5.5), description="Distance of a near lamp from the centre.")
    least_lit: float = Field(0.25, ge=0, le=1, description="Share of the sand in the picture that the lamp lights.")

    rock_albedo: Range = Field((0.7, 2.2), description="Reflectance of a scene's rocks over that of its sand.")
    rock_spread: float = Field(0.15, ge=0, description="Standard deviation of the rocks' albedos among each other.")
    patch_sd: Range = Field((0.0, 0.15), description="Standard deviation of the albedo of patches of sand.")
    walled_share: float = Field(0.7, ge=0, le=1, description="Share of scenes with the walls of the sandbox.")
    rim_albedo: Range = Field((0.2, 0.9), description="Albedo of the walls.")
    rim_height_m: Range = Field((0.2, 0.36), description="Height of the walls.")
    hapke_w: Range = Field((0.15, 0.6), description="Single-scattering albedo.")
    hapke_b: Range = Field((0.15, 0.4), description="Width of the phase function's lobes.")
    hapke_c: Range = Field((-0.2, 0.6), description="Weight of the lobes.")
    hapke_theta_deg: Range = Field((10, 35), description="Macroscopic roughness.")
    roughness: Range = Field((0.5, 1.0), description="Of the principled model.")
    specular: Range = Field((0.0, 0.7), description="Of the principled model.")

    ambient: Range = Field((0.0, 0.02), description="Even light over a lamp's irradiance.")
    hall: HallOptions | None = Field(HallOptions(), description="What is around the sand; none: dark and bare.")
    blur_px: Range = Field((0.0, 1.0), description="Lens blur, pixels of the picture.")
    lens_flare: Range = Field((0.0, 0.003), description="Share of a lamp's light that the lens scatters.")
    noise: bool = Field(True, description="Shot and read noise.")
    electrons_per_grey_value: Range = Field((3, 20), description="The fewer, the noisier.")
    exposure: Range = Field((0.15, 1.0), description="Grey value of bright sand (90th percentile) over white.")
    gamma: Range = Field((1.0, 2.0), description="Exponent of the tone curve from 12 to 8 bits.")
    strokes: int = Field(
        30, ge=0, description="Boxes and digits drawn into half of the pictures and taken out: one to so many."
    )
    least_contrast: float = Field(
        0.06,
        ge=0,
        description="Contrast in the picture, as a share of white, of a rock or shadow and its edge, below which it "
        "has no label: people do not draw what they cannot see.",
    )

    @model_validator(mode="after")
    def _ranges_are_ordered(self) -> Self:
        for name in type(self).model_fields:
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) == 2 and not isinstance(value[0], str) and value[0] > value[1]:
                raise ValueError(f"{name}: {value[0]:g} is above {value[1]:g}")
        if min(self.rocks[0], self.rock_size_m[0], self.camera_height_m[0], self.size_power[0]) <= 0:
            raise ValueError("rocks, rock_size_m, size_power and camera_height_m must be above 0")
        return self


class CoversOptions(BaseModel, extra="forbid", frozen=True):
    """Detectors trained on strewn scenes alone, tested on the published cover photos of terrains left out."""

    run: bool = Field(False, description="Train and test them: hours on a CPU, and the published release is needed.")
    folds: tuple[tuple[int, ...], ...] = Field(
        (),
        description="Terrains that each detector is tested on; it is trained on rocks of the run's other terrains. "
        "Where none is named, each of the run's terrains is left out in turn.",
    )
    keys: tuple[str, ...] = Field(
        (),
        description="Photo keys of cover photos whose camera or azimuth is known; those of all others are told by the "
        "boxes drawn into them and by the shadows that they show.",
    )
    exposure_ms: int = Field(
        USUAL_EXPOSURE_MS, gt=0, description="Exposure whose labels a cover photo is scored by, or the nearest to it."
    )
    scenes: SceneOptions = Field(SceneOptions(), description="Scenes that detectors are trained on.")
    carved_scenes: int = Field(
        512,
        ge=0,
        description="Scenes of rocks that the analog's generator carves. One detector is trained on them alone, once, "
        "and that of every fold starts from its weights: it has seen no scanned rock. 0: folds start from random "
        "weights.",
    )
    carved_epochs: int = Field(24, ge=1, description="Passes over these scenes' pictures.")
    widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (512, 640, 768, 896, 1024, 1280),
        description="Widths of a picture, px, that are tried. Those at which a fold's detector looks at its photos are "
        "chosen on the photos of all other folds, unless `detect.prediction.widths` names them.",
    )
    publish: bool = Field(
        False, description="Train a detector on the rocks of all terrains too, to take away: `covers/detector.pt`."
    )
    val_share: float = Field(0.08, gt=0, lt=1, description="Share of each terrain's scenes that selects the weights.")
    val_terrains: int = Field(
        0,
        ge=0,
        description="Terrains, drawn of those that a fold is trained on, whose scenes all select the weights instead: "
        "weights are then chosen by rocks that the training has not seen.",
    )

    @field_validator("keys")
    @classmethod
    def _keys_of_photos(cls, keys: tuple[str, ...]) -> tuple[str, ...]:
        stations = [PhotoKey.parse(key).station for key in keys]
        if len(set(stations)) < len(stations):
            raise ValueError("two keys name one terrain and position, which has one cover photo")
        return keys

    @field_validator("folds")
    @classmethod
    def _terrains_once(cls, folds: tuple[tuple[int, ...], ...]) -> tuple[tuple[int, ...], ...]:
        tested = [terrain for fold in folds for terrain in fold]
        if unknown := sorted(set(tested) - set(TERRAINS)):
            raise ValueError(f"terrain {unknown[0]}, expected 1 to 13")
        if len(set(tested)) < len(tested) or not all(folds):
            raise ValueError("a fold without terrains, or a terrain in two folds")
        return folds
