"""What the configuration says about rendering."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import BaseModel, Field, PositiveFloat, field_validator, model_validator

from polarsim.geometry.rays import Device, RayEngine
from polarsim.render.models import CHRONO as CHRONO
from polarsim.render.models import MODELS as MODELS
from polarsim.render.models import Model as Model
from polarsim.render.sensor_options import SensorOptions
from polarsim.survey import SURELY_WALL, is_surveyed

MapName = Literal["depth", "depth_float", "normal", "angles", "shading", "lit"]


class HapkeParameters(BaseModel, extra="forbid", frozen=True):
    """The model is Hapke's of 2012, with macroscopic roughness; the letters are the literature's."""

    w: float = Field(
        ge=0, le=1, description="Grains scatter this share of the light that they meet (single-scattering albedo)."
    )
    b: float = Field(
        ge=0, lt=1, description="The phase function's lobes have this width; a larger one makes them narrower."
    )
    c: float = Field(ge=-1, le=1, description="The lobes are weighted by this; above 0 light is scattered backwards.")
    b_s0: float = Field(0, ge=0, description="The shadow-hiding opposition effect has this amplitude.")
    h_s: float = Field(1, gt=0, description="The opposition effect has this angular width, tan(g/2).")
    b_c0: float = Field(0, ge=0, description="The coherent-backscatter opposition effect has this amplitude.")
    h_c: float = Field(1, gt=0, description="The opposition effect has this angular width, tan(g/2).")
    theta_bar_deg: float = Field(
        0,
        ge=0,
        lt=60,
        description="The macroscopic roughness has this mean slope, degrees; rougher sand is darker under low light.",
    )
    filling: float = Field(0, ge=0, lt=0.75, description="The porosity term has this filling factor phi; 0 sets K = 1.")


# Lunar sets of Sato et al. 2014 (JGR Planets 119, 1775) at 566 and 643 nm, of Chrono's lunar demos, and of a laboratory
# measurement of Apollo 11 soil (Curtis et al. 2024; c and B_S0 assumed).
HAPKE_SETS: dict[str, HapkeParameters] = {
    name: HapkeParameters(w=w, b=b, c=c, b_s0=b_s0, h_s=h_s, theta_bar_deg=theta, filling=filling)
    for name, w, b, c, b_s0, h_s, theta, filling in (
        ("chrono_lunar", 0.32357, 0.23955, 0.30452, 1.80238, 0.07145, 23.4, 0.3),
        ("sato_map_median_643", 0.3854, 0.2375, 0.3253, 1.686, 0.0672, 23.657, 0),
        ("sato_highlands_643", 0.44, 0.23, 0.4025, 1.641, 0.074, 23.657, 0),
        ("sato_mare_643", 0.27, 0.26, 0.1067, 1.855, 0.050, 23.657, 0),
        ("sato_tranquility_566", 0.188, 0.254, 0.158, 2.134, 0.0623, 23.657, 0),
        ("sato_tranquility_643", 0.222, 0.254, 0.160, 1.993, 0.0597, 23.657, 0),
        ("curtis_apollo11_rough", 0.315, 0.261, 0.0976, 1.0, 0.039, 21.28, 0.41),
    )
}
HapkeSet = Literal[
    "chrono_lunar",
    "sato_map_median_643",
    "sato_highlands_643",
    "sato_mare_643",
    "sato_tranquility_566",
    "sato_tranquility_643",
    "curtis_apollo11_rough",
]


class PrincipledParameters(BaseModel, extra="forbid", frozen=True):
    """The model has Burley's diffuse lobe and a GGX mirror lobe, as Mitsuba 3 defines them."""

    base_color: float = Field(0.2, ge=0, le=1, description="The diffuse lobe has this albedo; more is brighter.")
    roughness: float = Field(
        0.8, ge=0, le=1, description="The square of this is the alpha of the GGX highlight; at 1 it is wide and faint."
    )
    specular: float = Field(
        0.5,
        ge=0,
        le=1,
        description="The dielectric mirror lobe has this strength; 0.5 is that of a refractive index of 1.5.",
    )
    metallic: float = Field(
        0, ge=0, le=1, description="This share of the surface reflects as metal does, without a diffuse lobe."
    )


class LambertParameters(BaseModel, extra="forbid", frozen=True):
    """The model is Lambert's: the surface looks as bright from all sides."""

    albedo: float = Field(0.2, ge=0, le=1, description="The surface scatters this share of light back.")


class LunarLambertParameters(BaseModel, extra="forbid", frozen=True):
    """The model is McEwen's mix of Lommel-Seeliger and Lambert."""

    albedo: float = Field(
        0.12, ge=0, le=0.6, description="The surface has this albedo, lit and seen from above; more is brighter."
    )
    weight: Literal["mcewen"] | float = Field(
        "mcewen",
        description="Lommel-Seeliger has this share L, the rest is Lambert; mcewen: the share follows the phase angle.",
    )


class HapkeChronoParameters(BaseModel, extra="forbid", frozen=True):
    """Chrono::Sensor's Hapke shader of 2025 has these; by its slip, i <= g tells rough slopes apart, not i <= e."""

    soil: HapkeSet = Field("chrono_lunar", description="Parameter set of the Hapke model.")
    k_d: float = Field(0.7, ge=0, le=1, description="Diffuse colour, a factor of the reflectance.")

    @property
    def hapke(self) -> HapkeParameters:
        """Without coherent backscatter, which that shader leaves out."""
        return HAPKE_SETS[self.soil].model_copy(update={"b_c0": 0.0})


class PrincipledChronoParameters(BaseModel, extra="forbid", frozen=True):
    """Parameters are those of Chrono::Sensor's Principled shader of 2025; f_r is its factor over pi."""

    k_d: float = Field(0.7, ge=0, le=1, description="The diffuse lobe has this albedo; more is brighter.")
    k_s: float = Field(
        1.0,
        ge=0,
        le=1,
        description="The highlight has this specular colour, which counts in the specular workflow alone; "
        "more is brighter.",
    )
    roughness: float = Field(
        0.8, ge=0.001, le=1, description="This is the alpha of the GGX highlight itself; more is wider and weaker."
    )
    metallic: float = Field(
        0, ge=0, le=1, description="This share of the surface is metal, which counts in the metallic workflow alone."
    )
    workflow: Literal["specular", "metallic"] = Field(
        "specular", description="The mirror-like share is set by k_s (specular) or by metallic."
    )

    @property
    def albedo(self) -> float:
        """Of what is not mirrored."""
        return self.k_d if self.workflow == "specular" else self.k_d * (1 - self.metallic)

    @property
    def mirrored(self) -> float:
        """Share of the light that is mirrored at normal incidence."""
        return 0.08 * self.k_s if self.workflow == "specular" else self.metallic * self.k_d + (1 - self.metallic) * 0.04

    @property
    def grazing(self) -> float:
        """Share of the rest that is mirrored too at grazing incidence."""
        return 1.0 if self.workflow == "specular" else 0.0


Parameters = (
    HapkeParameters
    | PrincipledParameters
    | LambertParameters
    | LunarLambertParameters
    | HapkeChronoParameters
    | PrincipledChronoParameters
)


_OWN = "Parameters of this model; none: those of the material that this one refines."


class Material(BaseModel, extra="forbid", frozen=True):
    """Reflectance of a thing. Keys that are left out come from the kind of the thing, then from `default`."""

    albedo: PositiveFloat | None = Field(None, description="Factor of the reflectance; none: as above, in the end 1.")
    hapke: HapkeSet | HapkeParameters | None = Field(
        None, description="A parameter set is named, or the parameters are given."
    )
    principled: PrincipledParameters | None = Field(None, description=_OWN)
    lambert: LambertParameters | None = Field(None, description=_OWN)
    lunar_lambert: LunarLambertParameters | None = Field(None, description=_OWN)
    hapke_chrono: HapkeChronoParameters | None = Field(None, description=_OWN)
    principled_chrono: PrincipledChronoParameters | None = Field(None, description=_OWN)


DEFAULT = "default"  # material of all things
_THINGS = (DEFAULT, "ground", "rocks", "walls", "body")
# Of models that no material names.
_PARAMETERS: dict[Model, Parameters] = {
    "hapke": HAPKE_SETS["chrono_lunar"],
    "principled": PrincipledParameters(),
    "lambert": LambertParameters(),
    "lunar_lambert": LunarLambertParameters(),
    "hapke_chrono": HapkeChronoParameters(),
    "principled_chrono": PrincipledChronoParameters(),
}


class FittingOptions(BaseModel, extra="forbid", frozen=True):
    """Materials are fitted to a terrain's photos."""

    parameters: dict[Model, tuple[str, ...]] = Field(
        {
            "principled": ("roughness", "specular"),
            "hapke": ("w", "b", "c", "b_s0", "h_s", "theta_bar_deg"),
        },
        description="These parameters of each model are fitted; a model left out keeps its own.",
    )
    held_out: Literal["no", "30", "180", "270", "350"] = Field(
        "30",
        description="Photos of this azimuth check the fit, and parameters are fitted without them; no: all photos "
        "are fitted.",
    )


class RenderOptions(SensorOptions):
    """These options say how twins and their rendered ground-truth labels are made."""

    models: tuple[Model, ...] = Field(
        ("principled", "hapke"), description="Twins are made in these reflectance models."
    )
    engine: Literal["numba", "numpy", "taichi"] = Field(
        "numba",
        description="Reflectance is evaluated by this, in float32: numba is the fastest on a CPU, taichi is for GPUs,"
        " numpy defines the result.",
    )
    rays: RayEngine = Field(
        "embree",
        description="Rays are cast by this; taichi is for GPUs, numpy, the only one in float64, for tiny scenes.",
    )
    device: Device = Field(
        "cpu",
        description="Taichi runs on this, for `engine` and `rays`. Where both are taichi, OLAT images of lamps that"
        " are points are made there from ray to sum.",
    )

    materials: dict[str, Material] = Field(
        default_factory=dict,
        description="Materials by thing: `default` (all things), `ground`, `rocks`, one rock by its number, `walls`, "
        "a rover's `body`, or one part of it: `body0`, `body1`.",
    )
    materials_from_photos: bool = Field(
        False,
        description="Albedo, the models' parameters and the lamps' brightness are fitted to the terrain's "
        "photos; where there are none, materials are constant. Fits go before `falloff`, "
        "`vignetting` and the models' parameters; a given `gain` goes before theirs.",
    )
    fitting: FittingOptions = FittingOptions()

    falloff: bool = Field(
        False, description="Lamps weaken with the square of the distance. Off: real spots light the sand more evenly."
    )
    lamp_radius_m: float = Field(
        0,
        ge=0,
        description="Sun lamps are discs of this radius, metres; 0: they are points, whose shadows have sharp edges.",
    )
    lamp_samples: int = Field(16, ge=1, description="Where a lamp's disc is seen in part, so many rays are cast to it.")
    lamp_probe_px: int = Field(
        1,
        ge=1,
        le=32,
        description="Only every n-th pixel of a row probes a lamp's disc at centre and rim, and pixels between two "
        "that agree look at its centre alone; 1: every pixel probes it. 8 takes half the time and moves"
        " few pixels.",
    )
    bounce: float = Field(
        0.01,
        ge=0,
        le=1,
        description="Light that walls return from above has this irradiance, over a lamp's irradiance 4 m "
        "away; 0: there is none. It counts while `bounces` is 0; more bounces trace this light "
        "instead. Chrono's models have none.",
    )
    ambient: float = Field(
        0,
        ge=0,
        le=1,
        description="Even light from all sides has this irradiance, over a lamp's irradiance 4 m away. "
        "Nothing shades it while `bounces` is 0; else surfaces do, but for the last one of a "
        "path. Chrono's models have none.",
    )
    bounces: int = Field(
        0,
        ge=0,
        le=8,
        description="Light is traced over so many reflections between its lamp and the surface that is seen; 0: "
        "over none, `bounce` stands for them. Chrono's models have none.",
    )
    bounce_rays: int = Field(
        128, ge=1, description="So many random paths are traced from a pixel; more take longer and have less noise."
    )
    bounce_scale: int = Field(
        4,
        ge=1,
        le=16,
        description="Paths start at every so many-th pixel of a row and of a column; pixels between take the light of "
        "alike neighbours. 1: at every pixel, unsmoothed.",
    )
    skirt_m: float = Field(
        0.05,
        ge=0,
        description="Open feet of rock meshes are drawn out downwards so far, metres: no light beneath them.",
    )
    rim: bool = Field(
        True,
        description="The sandbox has walls, which cast shadows and are seen; not on terrain 13, another box, whose "
        "walls nobody stated.",
    )
    rim_half_width_m: float = Field(2.05, gt=0, description="The sandbox is twice this wide inside, metres.")
    # Low rather than high: shade that no photo has would take away shadows that are there.
    rim_height_m: float = Field(SURELY_WALL, gt=0, description="Walls end so high above the median ground, metres.")
    rim_albedo: float | None = Field(
        None,
        ge=0,
        le=1,
        description="Walls are plain diffuse with this albedo (cloth: 0.5); none: they are as the ground.",
    )

    gain: dict[Model, PositiveFloat] = Field(
        default_factory=dict,
        description="A unit of radiance makes so many grey values per ms; a model left out is calibrated.",
    )
    calibration_photos: int = Field(
        6, ge=0, description="A gain is calibrated on so many photos; 0: built-in gains are taken."
    )
    seed: int = Field(0, ge=0, description="Noise and traced light are drawn from this seed.")

    maps: tuple[MapName, ...] = Field(
        (),
        description="These pictures are written beside twins, in renders/maps: depth (mm), depth_float (m), normal,"
        " angles (incidence, emergence, phase), shading (lit, or what hides the lamp), lit (share of "
        "the lamp that is seen).",
    )
    min_rock_px: int = Field(30, ge=1, description="Rocks with fewer visible pixels get no box.")
    min_shadow_px: int = Field(60, ge=1, description="Shadows with fewer visible pixels get no box.")
    min_shadow_width_px: int = Field(
        3,
        ge=1,
        description="Parts of a shadow thinner than this, lines along a rock's foot, do not widen its box. 1: all do.",
    )
    min_part_px: int = Field(20, ge=1, description="Connected parts of a shadow below this do not widen its box.")
    min_visible_share: float = Field(
        0, ge=0, le=1, description="Rocks of which others leave less than this share to be seen get no box."
    )

    @field_validator("materials")
    @classmethod
    def _known_things(cls, materials: dict[str, Material]) -> dict[str, Material]:
        for name in materials:
            if name not in _THINGS and not name.removeprefix("body").isdecimal():
                raise ValueError(f"{name!r} is no material, expected {', '.join(_THINGS)} or a rock's number")
        return materials

    @model_validator(mode="after")
    def _device_has_work(self) -> Self:
        if self.device != "cpu" and not self.uses_taichi:
            raise ValueError(f"device {self.device!r} is for Taichi, expected engine or rays to be 'taichi'")
        return self

    def of(self, terrain: int) -> Self:
        """These options, without walls where nobody stated those of a terrain."""
        return self if is_surveyed(terrain) else self.model_copy(update={"rim": False})

    @property
    def uses_taichi(self) -> bool:
        return "taichi" in (self.engine, self.rays)

    def parameters(self, model: Model, *things: str) -> Parameters:
        """Return the parameters of a model for a thing, named from its own name to that of its kind."""
        found: Parameters | str = self._first(model, things, _PARAMETERS[model])
        return HAPKE_SETS[found] if isinstance(found, str) else found

    def albedo_factor(self, *things: str) -> float:
        """Return the factor of a thing's reflectance, by its names as above."""
        return float(self._first("albedo", things, 1.0))

    def with_default(self, **parameters: object) -> Self:
        """Return these options with parameters of models in the default material, checked."""
        default = self.materials.get(DEFAULT, Material()).model_dump() | parameters
        return self.model_validate(self.model_dump() | {"materials": {**self.materials, DEFAULT: default}})

    def _first(self, key: str, things: tuple[str, ...], otherwise: Any) -> Any:
        """Return the first value of a key that the materials of these things, or the default one, have."""
        own = (getattr(self.materials[thing], key) for thing in (*things, DEFAULT) if thing in self.materials)
        return next((given for given in own if given is not None), otherwise)
