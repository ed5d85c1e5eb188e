"""Options of rendering."""

from __future__ import annotations

import math
from typing import Any, Literal, Self

from pydantic import BaseModel, Field, NonNegativeFloat, PositiveFloat, field_validator, model_validator

from polarsim.geometry.ray_engines import Device, RayEngine
from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS, Azimuth
from polarsim.render.models import CHRONO as CHRONO
from polarsim.render.models import FITTED, Domain, model_of
from polarsim.render.models import MODELS as MODELS
from polarsim.render.models import Model as Model

MapName = Literal["depth", "depth_float", "normal", "angles", "shading", "lit"]


class HapkeParameters(BaseModel, extra="forbid", frozen=True):
    """Hapke's reflectance model (2012) with macroscopic roughness, in the symbols of the literature."""

    w: float = Field(ge=0, le=1, description="Single-scattering albedo: higher is brighter.")
    b: float = Field(ge=0, lt=1, description="Asymmetry of the phase function: higher values make the lobes narrower.")
    c: float = Field(ge=-1, le=1, description="Balance of the two lobes: positive values scatter light backwards.")
    b_s0: float = Field(0, ge=0, description="Amplitude of the shadow-hiding opposition effect.")
    h_s: float = Field(1, gt=0, description="Angular width of the shadow-hiding opposition effect, tan(g/2).")
    b_c0: float = Field(0, ge=0, description="Amplitude of the coherent-backscatter opposition effect.")
    h_c: float = Field(1, gt=0, description="Angular width of the coherent-backscatter opposition effect, tan(g/2).")
    theta_bar_deg: float = Field(
        0,
        ge=0,
        lt=60,
        description="Mean slope of the macroscopic roughness, degrees: higher is darker under low light.",
    )
    filling: float = Field(0, ge=0, lt=0.75, description="Filling factor of the porosity term; 0 sets K = 1.")

    @property
    def porosity(self) -> float:
        """K of Hapke, Icarus 195 (2008) 918."""
        u = 1.209 * self.filling ** (2 / 3)
        return -math.log1p(-u) / u if u > 0 else 1.0


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
    """Burley's diffuse lobe and a GGX specular lobe, as defined by Mitsuba 3."""

    base_color: float = Field(0.2, ge=0, le=1, description="Albedo of the diffuse lobe: higher is brighter.")
    roughness: float = Field(0.8, ge=0, le=1, description="Square root of GGX's alpha: higher is wider and fainter.")
    specular: float = Field(
        0.5, ge=0, le=1, description="Strength of the specular lobe; 0.5 is a refractive index of 1.5."
    )
    metallic: float = Field(0, ge=0, le=1, description="Share of the surface that reflects as metal.")

    @property
    def alpha2(self) -> float:
        """Square of the alpha of GGX."""
        return max(0.001, self.roughness * self.roughness) ** 2

    @property
    def eta(self) -> float:
        """Refractive index."""
        return 2 / (1 - math.sqrt(0.08 * self.specular)) - 1


class LambertParameters(BaseModel, extra="forbid", frozen=True):
    """Lambert's model: the same radiance in all directions."""

    albedo: float = Field(0.2, ge=0, le=1, description="Share of the light that is reflected.")


class LunarLambertParameters(BaseModel, extra="forbid", frozen=True):
    """McEwen's mix of Lommel-Seeliger and Lambert."""

    albedo: float = Field(0.12, ge=0, le=0.6, description="Albedo at normal incidence and emergence.")
    weight: Literal["mcewen"] | float = Field(
        "mcewen",
        description="Weight of the Lommel-Seeliger term, the rest is Lambert; mcewen: a function of the phase angle.",
    )


class HapkeChronoParameters(BaseModel, extra="forbid", frozen=True):
    """Hapke shader of Chrono::Sensor (2025). It selects the branch of the roughness by i <= g instead of i <= e."""

    soil: HapkeSet = Field("chrono_lunar", description="Parameter set of the Hapke model.")
    k_d: float = Field(0.7, ge=0, le=1, description="Diffuse colour, a factor of the reflectance.")

    @property
    def hapke(self) -> HapkeParameters:
        """Parameters of Hapke's model without coherent backscatter, which the shader omits."""
        return HAPKE_SETS[self.soil].model_copy(update={"b_c0": 0.0})


class PrincipledChronoParameters(BaseModel, extra="forbid", frozen=True):
    """Principled shader of Chrono::Sensor (2025), specular workflow. f_r is the value of the shader divided by pi."""

    k_d: float = Field(0.7, ge=0, le=1, description="Albedo of the diffuse lobe: higher is brighter.")
    k_s: float = Field(1.0, ge=0, le=1, description="Specular colour, same for all wavelengths.")
    roughness: float = Field(0.8, ge=0.001, le=1, description="Alpha of GGX: higher is wider and fainter.")

    @property
    def mirrored(self) -> float:
        """Specular share at normal incidence."""
        return 0.08 * self.k_s


Parameters = (
    HapkeParameters
    | PrincipledParameters
    | LambertParameters
    | LunarLambertParameters
    | HapkeChronoParameters
    | PrincipledChronoParameters
)


_OF_MODEL = "Parameters of this reflectance model."


class Material(BaseModel, extra="forbid", frozen=True):
    """Reflectance of an object. Missing keys are read from the material of the kind of object, then from `default`."""

    albedo: PositiveFloat | None = Field(None, description="Factor of the reflectance.")
    hapke: HapkeSet | HapkeParameters | None = Field(None, description="Name of a parameter set, or the parameters.")
    principled: PrincipledParameters | None = Field(None, description=_OF_MODEL)
    lambert: LambertParameters | None = Field(None, description=_OF_MODEL)
    lunar_lambert: LunarLambertParameters | None = Field(None, description=_OF_MODEL)
    hapke_chrono: HapkeChronoParameters | None = Field(None, description=_OF_MODEL)
    principled_chrono: PrincipledChronoParameters | None = Field(None, description=_OF_MODEL)


DEFAULT = "default"  # material of all objects
_THINGS = (DEFAULT, "ground", "rocks", "walls", "body")
# Default parameters, for models that no material specifies.
_PARAMETERS: dict[Model, Parameters] = {
    "hapke": HAPKE_SETS["chrono_lunar"],
    "principled": PrincipledParameters(),
    "lambert": LambertParameters(),
    "lunar_lambert": LunarLambertParameters(),
    "hapke_chrono": HapkeChronoParameters(),
    "principled_chrono": PrincipledChronoParameters(),
}


# Options of fitted twins, unless the run sets them (`model_fields_set`). On published cover photos, a disc with the
# radius of the site raises the correlation by 0.013 and leaves PSNR as it is. The lamp is probed at every
# 8th pixel: 1.7 instead of 3.4 s a view, no measurable difference. Not included, because images at quarter size hardly
# improve: traced indirect light (+0.25 dB for 4 s a view), blur, noise.
OF_FITTED: dict[str, Any] = {
    "falloff": True,  # of lamps without light field
    "lamp_radius_m": None,  # of the site
    "lamp_probe_px": 8,
    "lamp_samples": 8,
    "vignetting": True,
}


class FittingOptions(BaseModel, extra="forbid", frozen=True):
    """Fit of light and materials to a terrain's photos."""

    parameters: dict[Model, tuple[str, ...]] = Field(
        {
            "principled": ("roughness", "specular"),
            "hapke": ("w", "b", "c", "b_s0", "h_s", "theta_bar_deg"),
        },
        description="Parameters to fit, by model. Other models are not fitted.",
    )
    held_out: Azimuth | None = Field(
        None,
        description="Sun azimuth whose photos are not fitted but validate the fit; 'no': fit all photos; null: the "
        "first lamp of the site if it has several.",
    )


class SensorOptions(BaseModel, extra="forbid", frozen=True):
    """Conversion of radiance to DN. Black level (16) and clipping (12 bits) are those of polarsim's photo format."""

    samples: Literal[1, 4, 9, 16] = Field(1, description="Rays per pixel. More rays smooth edges and take longer.")
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
    vignetting: bool = Field(
        False,
        description="Darken by the fourth power of the cosine to the optical axis. If not set, true in fitted twins.",
    )

    noise: bool = Field(False, description="Add shot and read noise. Files are 1.5 times as large.")
    electrons_per_dn: float = Field(
        ELECTRONS_PER_DN, gt=0, description="Electrons per DN. Higher values reduce shot noise."
    )
    read_noise_electrons: float = Field(
        READ_NOISE_ELECTRONS, ge=0, description="Standard deviation of the read noise, electrons."
    )

    @model_validator(mode="after")
    def _check_shares(self) -> Self:
        if self.bloom + self.veiling_glare > 1:
            raise ValueError(f"bloom + veiling_glare is {self.bloom + self.veiling_glare:g}, expected at most 1")
        return self


class RenderOptions(SensorOptions):
    """Options of twins and rendered ground-truth labels."""

    models: tuple[Domain, ...] = Field(
        ("principled", "hapke"),
        description="Reflectance models of the twins; fitted: principled, with light and materials fitted to photos.",
    )
    engine: Literal["numba", "numpy", "taichi"] = Field(
        "numba", description="Engine: numba (CPU, rays by Embree), taichi (GPU, including rays), numpy (reference)."
    )
    device: Device = Field("cpu", description="Device of the engine taichi.")

    materials: dict[str, Material] = Field(
        default_factory=dict,
        description="Materials by object: `default` (all objects), `ground`, `rocks`, a rock number, `walls`, "
        "`body` (a rover), or a part of a rover: `body0`, `body1`.",
    )
    materials_from_photos: bool = Field(
        False,
        description="Fit light, lens and materials of all `models` to the photos, as for the model `fitted`.",
    )
    fitting: FittingOptions = FittingOptions()

    falloff: bool = Field(
        False,
        description="Inverse-square falloff of lamps; real spots are more even. If not set, true in fitted twins.",
    )
    lamp_radius_m: NonNegativeFloat | None = Field(
        0,
        description="Radius of the Sun lamps, metres; 0: points with sharp shadows; null: that of the site's lamps. "
        "If not set, null in fitted twins.",
    )
    lamp_samples: int = Field(
        16,
        ge=1,
        description="Rays to a partly visible lamp; more rays: less noise in penumbrae. If not set, 8 in fitted twins.",
    )
    lamp_probe_px: int = Field(
        1,
        ge=1,
        le=32,
        description="Step between pixels that probe the entire lamp: 8 halves the time. If not set, 8 in fitted twins.",
    )
    bounce: float = Field(
        0.01,
        ge=0,
        le=1,
        description="Irradiance from the walls, relative to a lamp 4 m away. Used only with `bounces: 0`.",
    )
    ambient: float = Field(0, ge=0, le=1, description="Uniform ambient irradiance, relative to a lamp 4 m away.")
    bounces: int = Field(
        0, ge=0, le=8, description="Maximum number of traced reflections between lamp and surface; 0: none."
    )
    bounce_rays: int = Field(128, ge=1, description="Random paths per pixel. More paths reduce noise and take longer.")
    bounce_scale: int = Field(
        4, ge=1, le=16, description="Step between pixels whose indirect light is traced; 1: every pixel."
    )
    skirt_m: float = Field(0.05, ge=0, description="Length by which open rock meshes are extended downwards, m.")
    walls: bool = Field(True, description="Walls of the sandbox (`walls.json`) cast shadows and are visible.")
    wall_albedo: float | None = Field(
        None, ge=0, le=1, description="Albedo of diffuse walls (cloth: 0.5); none: the `walls` material."
    )

    gain: dict[Model, PositiveFloat] = Field(
        default_factory=dict, description="Gain, DN per ms per unit radiance, by model. Other models are calibrated."
    )
    seed: int = Field(0, ge=0, description="Seed of noise and traced light paths.")

    maps: tuple[MapName, ...] = Field((), description="Maps written to `renders/maps`, per view or exposure bracket.")
    min_rock_area_px: int = Field(30, ge=1, description="Minimum number of visible pixels of a labelled rock.")
    min_shadow_area_px: int = Field(60, ge=1, description="Minimum number of visible pixels of a labelled shadow.")
    min_shadow_width_px: int = Field(
        3, ge=1, description="Minimum width of the parts of a shadow that extend its box, px."
    )
    min_part_area_px: int = Field(
        20, ge=1, description="Minimum pixels of a connected part that extends a shadow's box."
    )

    @field_validator("materials")
    @classmethod
    def _check_names(cls, materials: dict[str, Material]) -> dict[str, Material]:
        for name in materials:
            if name not in _THINGS and not name.removeprefix("body").isdecimal():
                raise ValueError(f"unknown material {name!r}, expected {', '.join(_THINGS)} or the number of a rock")
        return materials

    @model_validator(mode="after")
    def _check_models(self) -> Self:
        if self.materials_from_photos and {FITTED, model_of(FITTED)} <= set(self.models):
            raise ValueError(f"models: with materials_from_photos, {FITTED} and {model_of(FITTED)} are the same")
        return self

    @model_validator(mode="after")
    def _check_device(self) -> Self:
        if self.device != "cpu" and self.engine != "taichi":
            raise ValueError(f"device {self.device!r} requires engine 'taichi', got {self.engine!r}")
        return self

    @property
    def rays(self) -> RayEngine:
        """Ray engine. The NumPy reflectance engine also uses Embree: NumPy rays are too slow for entire terrains."""
        return "taichi" if self.engine == "taichi" else "embree"

    def is_fitted(self, domain: Domain) -> bool:
        """Return whether light, lens and materials of a domain of twins are fitted to photos."""
        return domain == FITTED or self.materials_from_photos

    @property
    def reflectance_models(self) -> tuple[Model, ...]:
        """Reflectance models of the domains."""
        return tuple(model_of(domain) for domain in self.models)

    @property
    def fitted_domains(self) -> tuple[Domain, ...]:
        """Domains of twins that are fitted to photos."""
        return tuple(domain for domain in self.models if self.is_fitted(domain))

    def as_fitted(self) -> Self:
        """Return the options of fitted twins. Options that the run sets are kept, even if set to their default."""
        return self.model_copy(update={name: OF_FITTED[name] for name in OF_FITTED.keys() - self.model_fields_set})

    @property
    def set_to_default(self) -> list[str]:
        """Options that the run sets to their default, which differs from the value in fitted twins."""
        fields = type(self).model_fields
        chosen = OF_FITTED.keys() & self.model_fields_set
        return sorted(name for name in chosen if getattr(self, name) == fields[name].default)

    def parameters(self, model: Model, *things: str) -> Parameters:
        """Return the parameters of a model for an object, given its names from specific to general."""
        parameters: Parameters | str = self._first(model, things, _PARAMETERS[model])
        return HAPKE_SETS[parameters] if isinstance(parameters, str) else parameters

    def albedo_factor(self, *things: str) -> float:
        """Return the reflectance factor of an object, given its names as in `parameters`."""
        return float(self._first("albedo", things, 1.0))

    def with_default(self, **parameters: object) -> Self:
        """Return validated options with the given model parameters in the default material."""
        default = self.materials.get(DEFAULT, Material()).model_dump() | parameters
        return self.model_validate(self.model_dump() | {"materials": {**self.materials, DEFAULT: default}})

    def _first(self, key: str, names: tuple[str, ...], fallback: Any) -> Any:
        """Return the first value of a key in the materials with these names, then in the default material."""
        values = (getattr(self.materials[name], key) for name in (*names, DEFAULT) if name in self.materials)
        return next((value for value in values if value is not None), fallback)
