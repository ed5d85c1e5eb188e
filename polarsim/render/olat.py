"""One-light-at-a-time (OLAT) images and id maps of a view, from one set of camera rays.

A photo is a weighted sum of OLAT images. Unshadowed diffuse light is added: light of the walls from above
(`bounce`) and uniform light from all directions (`ambient`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.kernels import NUMBA
from polarsim.render import brdf
from polarsim.render.hit_engine import hit_kernels
from polarsim.render.hits import Hits, cast_strip, for_strips, sample_offsets
from polarsim.render.indirect import indirect_olat_images
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import disc_share, lighting, visible_lamp_share
from polarsim.render.materials import Materials, Reflectance
from polarsim.render.options import CHRONO, Model, RenderOptions
from polarsim.render.shadows import SHADOW_BELOW, ground_shadows
from polarsim.render.surfaces import Surfaces

log = logging.getLogger("polarsim")

_FACED_SHARE: dict[str, Callable[[np.ndarray], np.ndarray]] = {  # share of the light that a normal (n, 3) faces
    "bounce": lambda normal: (1 + normal[:, 2]) / np.float32(2),
    "ambient": lambda normal: np.ones(len(normal), np.float32),
}


class DiffuseLight:
    """Unshadowed diffuse light of a view, accumulated over samples; empty if `bounces` traces paths instead.

    Models with uniform albedo share one accumulated image; each model with varying albedo has a separate image.
    """

    def __init__(
        self, options: RenderOptions, materials: Materials, models: Sequence[Model], size: tuple[int, int]
    ) -> None:
        self._options, self._materials = options, materials
        amounts = {} if options.bounces else {kind: getattr(options, kind) for kind in _FACED_SHARE}
        self._amounts = {kind: amount for kind, amount in amounts.items() if amount}
        models = [model for model in models if model not in CHRONO] if self._amounts else []
        albedos = {model: materials.same_everywhere(model) for model in models}
        self._even = {model: albedo for model, albedo in albedos.items() if albedo is not None}
        self._varied = [model for model, albedo in albedos.items() if albedo is None]
        plain = (False,) if options.wall_albedo is None else (False, True)
        pairs = [(kind, of) for kind in self._amounts for of in plain] if self._even else []
        self._shares = {pair: np.zeros(size, np.float32) for pair in pairs}
        self._sent = {(kind, model): np.zeros(size, np.float32) for kind in self._amounts for model in self._varied}

    @property
    def even(self) -> bool:
        """Return whether all surfaces have the same albedo, so that `accumulate` is sufficient."""
        return not self._varied and (self._options.wall_albedo is None or not self._amounts)

    def accumulate(self, faced: Mapping[str, np.ndarray]) -> None:
        """Add the shares (h, w) of each kind of light that pixels face, means over the samples of a pixel."""
        for (kind, _), share in self._shares.items():
            share += faced[kind]

    def add(self, hits: Hits, samples: int) -> None:
        """Add the hits of one sample per pixel; `samples` is the number of samples per pixel."""
        if not self._amounts:
            return
        plain = self._materials.plain(hits.face) if self._options.wall_albedo is not None else None
        albedos = {model: self._materials.albedo(model, hits) for model in self._varied}
        for kind in self._amounts:
            faced = _FACED_SHARE[kind](hits.normal) / np.float32(samples)
            for on_walls in (walls for other, walls in self._shares if other == kind):
                chosen = faced if plain is None else np.where(plain == on_walls, faced, np.float32(0))
                self._shares[kind, on_walls][hits.rows].reshape(-1)[hits.pixel] += chosen
            for model, albedo in albedos.items():
                self._sent[kind, model][hits.rows].reshape(-1)[hits.pixel] += albedo * faced

    def add_to(self, olat_images: Mapping[tuple[Model, str], np.ndarray], lamps: Mapping[str, Lamp]) -> None:
        """Add the diffuse light to OLAT images, except those of Chrono's models."""
        for (model, name), olat_image in olat_images.items():
            for kind, amount in self._amounts.items():
                irradiance = amount * lamps[name].intensity
                if model in self._even:
                    for plain in (plain for other, plain in self._shares if other == kind):
                        albedo = self._options.wall_albedo if plain else self._even[model]
                        olat_image += np.float32(irradiance * (albedo or 0.0) / np.pi) * self._shares[kind, plain]
                elif model in self._varied:
                    olat_image += np.float32(irradiance / np.pi) * self._sent[kind, model]


NO_LAMP = "none"  # name of the id map without shadows
_CENTRE = (0.0, 0.0)  # offset of the ray that determines the id of a pixel


@dataclass(frozen=True)
class Rendering:
    """OLAT images (h, w) float32 of a view by model and lamp, and id maps (h, w) uint16 by lamp of the shadows.

    Radiance 1 is that of a surface with f_r = 1 under a Sun lamp 4 m above the surface; pixels without surface are 0.
    `indirect` is the traced indirect light, if enabled; it is not included in `olat_images`.

    Ids are BACKGROUND, GROUND, RELIEF_SHADOW (ground shaded by relief or a wall), ROCK_IDS + k for rock k, SHADOW_IDS +
    k for ground shaded by rock k. The map `NO_LAMP` has no shadows.
    """

    olat_images: dict[tuple[Model, str], np.ndarray]
    ids: dict[str, np.ndarray]
    indirect: dict[tuple[Model, str], np.ndarray] = field(default_factory=dict)

    @property
    def whole(self) -> dict[tuple[Model, str], np.ndarray]:
        """OLAT images plus the traced indirect light."""
        return {
            key: olat_image + self.indirect[key] if key in self.indirect else olat_image
            for key, olat_image in self.olat_images.items()
        }


def render_view(
    surfaces: Surfaces,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    models: Sequence[Model],
    shadow_lamps: Collection[str] | None,
    options: RenderOptions,
    threads: int = 1,
) -> Rendering:
    """Render the OLAT images of every model under every lamp, and id maps with shadows.

    `shadow_lamps`: names of the lamps whose shadows are in the id maps; None: no id maps.
    """
    reflectance = reflectance_engine(options, threads)
    offsets = sample_offsets(options)
    surfaces.prepare(shadows=bool(shadow_lamps), threads=threads)
    size = camera.lens.shape
    olat_images = {(model, name): np.zeros(size, np.float32) for model in models for name in lamps}
    ids = {} if shadow_lamps is None else {name: np.zeros(size, np.uint16) for name in (NO_LAMP, *shadow_lamps)}
    materials = Materials(surfaces, options, reflectance)
    surroundings = DiffuseLight(options, materials, models, size)
    samples_lit = {name: np.zeros(size, np.uint8) for name in lamps}
    by_device = renders_on_device(surfaces, lamps)
    if by_device:
        from polarsim.render.device_olat import add_olat_images

        add_olat_images(olat_images, samples_lit, surroundings, surfaces, camera, lamps, offsets, options)

    def work(rows: slice) -> None:
        offset = None
        shares: dict[str, np.ndarray] = {}  # visible shares of discs at pixel centres
        for offset in () if by_device else offsets:
            hits = cast_strip(surfaces, camera, rows, offset)
            surroundings.add(hits, len(offsets))
            for name, lamp in lamps.items():
                if lamp.radius_m and offset == _CENTRE:
                    shares[name] = disc_share(surfaces, hits, lamp, options.lamp_samples, options.lamp_probe_px)
                centre_share = shares.get(name) if offset == _CENTRE else None
                lit, to_lamp, irradiance = lighting(
                    surfaces, hits, lamp, falloff=options.falloff, samples=options.lamp_samples, share=centre_share
                )
                pixel, share = hits.pixel.take(lit), irradiance / np.float32(len(offsets))
                if not lamp.radius_m:  # a pixel may be lit by only a part of a disc
                    samples_lit[name][rows].reshape(-1)[pixel] += 1
                normal, to_viewer = hit_kernels.rows(hits.normal, lit), hit_kernels.rows(hits.to_viewer, lit)
                for model in models:
                    strip = olat_images[model, name][rows].reshape(-1)  # an array view, not a copy
                    value = materials.reflectance(model, hits, lit, normal, to_lamp, to_viewer)
                    hit_kernels.add(strip, pixel, value, share)
        if not ids:
            return
        if offset != _CENTRE:
            shares = {}
            hits = cast_strip(surfaces, camera, rows, _CENTRE, smooth=False)
        pictures = {name: picture[rows].reshape(-1) for name, picture in ids.items()}
        lit_pixels = {name: lit[rows].reshape(-1) == len(offsets) for name, lit in samples_lit.items()}
        write_ids(pictures, surfaces, hits, lamps, lit_pixels, options, shares)

    if ids or not by_device:
        for_strips(camera.lens.height, threads, work)
    surroundings.add_to(olat_images, lamps)
    indirect = {}
    if options.bounces:
        bouncing = [model for model in models if model not in CHRONO]
        indirect = indirect_olat_images(surfaces, camera, lamps, bouncing, materials, options, threads)
    return Rendering(olat_images, ids, indirect)


def renders_on_device(surfaces: Surfaces, lamps: Mapping[str, Lamp]) -> bool:
    """Return whether Taichi renders the entire OLAT images; requires omnidirectional points without light field."""
    points = all(type(lamp) is Lamp and not lamp.radius_m and not lamp.light_field for lamp in lamps.values())
    return surfaces.rays == "taichi" and points


def write_ids(
    pictures: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    hits: Hits,
    lamps: Mapping[str, Lamp],
    lit: Mapping[str, np.ndarray],
    options: RenderOptions,
    shares: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write the ids of a strip into flat id maps by lamp.

    `lit`: by lamp, bool for every pixel of the strip: all samples are lit. `shares`: by lamp, visible share of the
    disc at the hits, if computed already.
    """
    surface_ids = surfaces.id_of_face.take(hits.face)
    for name, picture in pictures.items():
        if name == NO_LAMP:
            picture[hits.pixel] = surface_ids
            continue
        if not lamps[name].radius_m:
            dark = ~lit[name].take(hits.pixel)
        elif shares and name in shares:
            dark = shares[name] < SHADOW_BELOW
        else:
            flat = replace(hits, normal=hits.plane)  # the result must not depend on the number of samples
            dark = visible_lamp_share(surfaces, flat, lamps[name], options.lamp_samples) < SHADOW_BELOW
        picture[hits.pixel] = ground_shadows(surfaces, hits, surface_ids, lamps[name], dark, options.lamp_samples)


@cache
def _warn_of_numpy() -> None:
    log.warning("render.engine: Numba is not installed, NumPy is used: pip install 'polarsim[pipeline]'")


def reflectance_engine(options: RenderOptions, threads: int) -> Reflectance:
    """Return the function that evaluates reflectance; start Taichi if the options select it.

    Without Numba, NumPy replaces the default engine; an engine that the options set is never replaced.
    """
    if options.engine == "numpy":
        return brdf.reflectance
    if options.engine == "numba":
        if not NUMBA and "engine" not in options.model_fields_set:
            _warn_of_numpy()
            return brdf.reflectance
        from polarsim.render import brdf_numba

        return brdf_numba.reflectance
    from polarsim.geometry import taichi_device
    from polarsim.render import brdf_taichi

    taichi_device.start(threads, options.device)
    return brdf_taichi.reflectance
