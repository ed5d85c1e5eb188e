"""Options of rendering."""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import BaseModel, Field, NonNegativeFloat, PositiveFloat, field_validator, model_validator

from polarsim.geometry.ray_engines import Device, RayEngine
from polarsim.photo import ELECTRONS_PER_DN, READ_NOISE_ELECTRONS, Azimuth
from polarsim.render.models import CHRONO as CHRONO
from polarsim.render.models import FITTED, Domain, model_of
from polarsim.render.models import MODELS as MODELS
from polarsim.render.models import Model as Model
from polarsim.render.parameters import DEFAULT_PARAMETERS, HAPKE_SETS, Material, Parameters

MapName = Literal["depth", "depth_float", "normal", "angles", "shading", "lit"]


DEFAULT = "default"  # material of all objects
_THINGS = (DEFAULT, "ground", "rocks", "walls", "body")


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
        parameters: Parameters | str = self._first(model, things, DEFAULT_PARAMETERS[model])
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
