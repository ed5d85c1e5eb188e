"""Options of randomised training scenes."""

from __future__ import annotations

from typing import Self

from pydantic import BaseModel, Field, model_validator

from polarsim.render.options import Model

Range = tuple[float, float]  # minimum and maximum


class ReliefOptions(BaseModel, extra="forbid", frozen=True):
    """Every scene draws the relief of its sand from these ranges, least to most."""

    cell_m: float = Field(
        0.005, gt=0, description="Cells of the ground's mesh have sides of at least this, m; finer ones render slower."
    )
    rough_sd_m: Range = Field(
        (0.001, 0.004), description="Sand is rough at all sizes, by a standard deviation in this range, m."
    )
    most_layers: int = Field(
        2, ge=0, description="Sand has from none to so many layers of ridges, each along a direction of its own."
    )
    swell_sd_m: Range = Field(
        (0.0, 0.02), description="Wide swells raise and lower the sand by a standard deviation in this range, m."
    )
    swell_width_m: float = Field(0.25, gt=0, description="Swells are so wide (correlation length), m.")
    most_craters: int = Field(1, ge=0, description="A scene has from none to so many craters.")


class HallOptions(BaseModel, extra="forbid", frozen=True):
    """Each range goes from least to most; brightness is over that of lit sand."""

    brightness: Range = Field(
        (0.0, 0.4), description="What is behind the walls is so bright on average, lit sand being 1."
    )
    folds_sd: Range = Field(
        (0.0, 0.0),
        description="Folds of the walls' cloth change its brightness by this standard deviation of the logarithm; "
        "0: it is even.",
    )
    most_cards: int = Field(
        0,
        ge=0,
        description="From none to so many framed cards lean on the walls of a picture: they have edges as rocks.",
    )
    card_m: Range = Field((0.15, 0.4), description="Cards are so wide, m.")
    card: Range = Field((0.05, 2.0), description="A card and its frame are so bright, lit sand being 1.")
    most_glares: int = Field(0, ge=0, description="The lens throws from none to so many blobs of light onto a picture.")
    glare: Range = Field((0.0, 0.6), description="The centre of such a blob is so bright, lit sand being 1.")


class SceneOptions(BaseModel, extra="forbid", frozen=True):
    """Every strewn scene is drawn from these ranges, least to most."""

    number: int = Field(64, ge=1, description="So many scenes are strewn with the rocks of each terrain.")
    lamps: int = Field(
        6,
        ge=1,
        description="A scene makes so many pictures, each under its own lamp; they share rays, so they cost less.",
    )
    scale: float = Field(
        0.5, gt=0, le=1, description="Pictures are rendered in this size, a photo's being 1; larger ones take longer."
    )
    seed: int = Field(0, ge=0, description="Another seed draws other scenes.")
    models: tuple[Model, ...] = Field(
        ("hapke", "principled"), min_length=1, description="A scene is rendered with one of these reflectance models."
    )

    rocks: tuple[int, int] = Field((3, 40), description="A scene has so many rocks.")
    rock_size_m: Range = Field((0.05, 0.6), description="Rocks have a longest extent in this range, m.")
    size_power: Range = Field(
        (0.5, 2.0),
        description="The number of rocks larger than a size falls with this power of it; a higher one makes more small "
        "rocks.",
    )
    rock_scale: Range = Field(
        (0.3, 2.0), description="A strewn rock is as large as the scanned one times a factor in this range."
    )
    tumbled_share: float = Field(
        0.25, ge=0, le=1, description="This share of rocks is rotated about any axis, the others about the vertical."
    )
    tilt_sd_deg: float = Field(
        6,
        ge=0,
        description="Rocks rotated about the vertical are tilted by this standard deviation, degrees.",
    )
    sunk: Range = Field((0.0, 0.6), description="A rock on sand is sunk by a share of its height in this range.")
    sunk_into_rocks: Range = Field(
        (0.02, 0.15), description="A rock of a pile is sunk into those below it by a share of its height in this range."
    )
    piled_share: Range = Field((0.0, 0.35), description="A share of a scene's rocks in this range lies in piles.")
    relief: ReliefOptions = Field(ReliefOptions(), description="The sand of a scene has such a relief.")

    rig_share: float = Field(
        0.5,
        ge=0,
        le=1,
        description="This share of scenes is seen as by NASA's rig: from outside the sand, by its lens. The others are "
        "seen from anywhere that the next three ranges allow, as by a rover too.",
    )
    camera_height_m: Range = Field((0.3, 2.0), description="The camera stands so high above the sand, m.")
    camera_distance_m: Range = Field((0.7, 4.5), description="The camera looks at the sand so far before it, m.")
    focal_px: Range = Field(
        (1500, 2800),
        description="The focal length is in this range, px of a full photo (the rig's is 2070); a longer one shows "
        "rocks larger.",
    )
    least_sand: float = Field(
        0.55, ge=0, le=1, description="Sand and rocks fill at least this share of a picture, where a view allows it."
    )

    elevation_deg: Range = Field(
        (2, 15),
        description="Lamps stand so high above the horizon as seen from the sand's centre, degrees; lower ones throw "
        "longer shadows.",
    )
    near_share: float = Field(
        0.7, ge=0, le=1, description="This share of lamps stands as near as NASA's; the others are as far as the Sun."
    )
    lamp_distance_m: Range = Field((3.2, 5.5), description="Near lamps stand so far from the sand's centre, m.")
    least_lit: float = Field(
        0.25, ge=0, le=1, description="A lamp lights at least this share of the sand in the picture, where one can."
    )

    rock_albedo: Range = Field(
        (0.7, 2.2), description="A scene's rocks reflect as much as its sand times a factor in this range."
    )
    rock_spread: float = Field(
        0.15, ge=0, description="Albedos of the rocks of a scene differ from each other by this standard deviation."
    )
    patch_sd: Range = Field(
        (0.0, 0.15), description="Patches of sand differ in albedo by a standard deviation in this range."
    )
    walled_share: float = Field(
        0.7, ge=0, le=1, description="This share of scenes has the sandbox's walls, which are seen and throw shade."
    )
    hapke_w: Range = Field(
        (0.15, 0.6), description="Hapke's single-scattering albedo is in this range; a higher one makes brighter sand."
    )
    roughness: Range = Field(
        (0.5, 1.0), description="The principled model's roughness is in this range; 1 has no highlight."
    )
    specular: Range = Field(
        (0.0, 0.7), description="The principled model's specular part is in this range; 0 has no highlight."
    )

    hall: HallOptions | None = Field(
        HallOptions(), description="This is around the sand; none: all but sand and rocks is dark and bare."
    )
    blur_px: Range = Field((0.0, 1.0), description="The lens blurs pictures by so much, px of the picture.")
    lens_flare: Range = Field(
        (0.0, 0.003), description="The lens scatters a share of a lamp's light in this range over the picture."
    )
    noise: bool = Field(True, description="Pictures have shot and read noise.")
    electrons_per_grey_value: Range = Field(
        (3, 20), description="The sensor counts so many electrons a grey value; the fewer, the noisier."
    )
    exposure: Range = Field(
        (0.15, 1.0),
        description="Bright sand (90th percentile) has a grey value in this range, white being 1; darker pictures are "
        "noisier.",
    )
    gamma: Range = Field(
        (1.0, 2.0),
        description="The curve from 12 to 8 bits has an exponent in this range; a larger one lifts shade.",
    )
    strokes: int = Field(
        30,
        ge=0,
        description="From one to so many boxes and digits are drawn into half of the pictures and taken out again, as "
        "on cover photos; 0: none.",
    )
    least_contrast: float = Field(
        0.06,
        ge=0,
        description="A rock or shadow whose edge has less contrast in the picture than this share of white has no "
        "label: people do not draw what they cannot see.",
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
