"""Parameters of the reflectance models, published sets of them, and materials of objects."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import BaseModel, Field, PositiveFloat

from polarsim.render.models import Model


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


# Default parameters, for models that no material specifies.
DEFAULT_PARAMETERS: dict[Model, Parameters] = {
    "hapke": HAPKE_SETS["chrono_lunar"],
    "principled": PrincipledParameters(),
    "lambert": LambertParameters(),
    "lunar_lambert": LunarLambertParameters(),
    "hapke_chrono": HapkeChronoParameters(),
    "principled_chrono": PrincipledChronoParameters(),
}
