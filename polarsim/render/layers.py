"""Layers: linear images of one view under one lamp. Photos are sums of them, so light is computed once a lamp."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from polarsim.errors import RenderError
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.render import brdf
from polarsim.render.hits import Hits, cast_strip, dot, for_strips, sample_offsets, unit
from polarsim.render.lamps import Lamp
from polarsim.render.options import Model, Parameters, RenderOptions
from polarsim.render.surfaces import Surfaces

Reflectance = Callable[[Parameters, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def render_layers(
    surfaces: Surfaces,
    sandbox_from_camera: Pose,
    lens: Lens,
    lamps: Mapping[str, Lamp],
    models: Sequence[Model],
    options: RenderOptions,
    threads: int = 1,
) -> dict[tuple[Model, str], np.ndarray]:
    """Radiance (h, w) float32 of every model under every lamp; 1 is what unit reflectance f_r sends back under a Sun
    lamp that stands 4 m off, straight above the surface. Nothing is black.
    """
    reflectance = reflectance_engine(options, threads)
    albedo = {model: hemispherical_albedo(options.parameters(model)) for model in models}
    offsets = sample_offsets(options.samples)
    surfaces.prepare()
    size = (lens.height, lens.width)
    layers = {(model, name): np.zeros(size, np.float32) for model in models for name in lamps}
    from_above = np.zeros(size, np.float32)  # share of the sky that a surface faces: light bounced from all around

    def work(rows: slice) -> None:
        for offset in offsets:
            hits = cast_strip(surfaces, sandbox_from_camera, lens, rows, offset)
            if options.bounce:
                from_above[rows].reshape(-1)[hits.pixel] += (1 + hits.normal[:, 2]) / np.float32(2 * len(offsets))
            for name, lamp in lamps.items():
                lit, to_lamp, irradiance = lighting(surfaces, hits, lamp, falloff=options.falloff)
                for model in models:
                    strip = layers[model, name][rows].reshape(-1)  # a view: rows are whole
                    value = reflectance(options.parameters(model), hits.normal[lit], to_lamp, hits.to_viewer[lit])
                    strip[hits.pixel[lit]] += value * irradiance / np.float32(len(offsets))

    for_strips(lens.height, 1 if options.engine == "taichi" else threads, work)
    if options.bounce:
        for (model, name), layer in layers.items():
            layer += np.float32(options.bounce * lamps[name].intensity * albedo[model] / np.pi) * from_above
    return layers


def lighting(surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers (m,) of the hits that a lamp lights, unit vectors (m, 3) to it, irradiance (m,) of the surface there."""
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    # A flat face that looks away gets no light, whatever its smooth normal says: else light leaks past the terminator.
    facing = (dot(hits.plane, to_lamp) > 0) & (dot(hits.normal, to_lamp) > 0)
    lit = np.flatnonzero(facing)
    lit = lit[~surfaces.all.blocked(hits.point[lit], to_lamp[lit], 1.0)]
    to_lamp = unit(to_lamp[lit])
    return lit, to_lamp, irradiance[lit] * dot(hits.normal[lit], to_lamp)


def reflectance_engine(options: RenderOptions, threads: int) -> Reflectance:
    """The function that evaluates reflectance.

    Raises
    ------
    RenderError
        The engine cannot be loaded.
    """
    if options.engine == "numpy":
        return brdf.reflectance
    try:
        from polarsim.render import brdf_taichi
    except ImportError as error:
        raise RenderError(f"render.engine: 'taichi' cannot be loaded ({error}); install taichi") from error
    brdf_taichi.start(threads)
    return brdf_taichi.reflectance


def hemispherical_albedo(parameters: Parameters) -> float:
    """Share of light from all sides that a surface scatters back (bihemispherical albedo), by a fixed quadrature."""
    places = (np.arange(12) + 0.5) / 12  # of sin^2: equal shares of cosine-weighted light
    cos_i, cos_e, psi = (a.ravel() for a in np.meshgrid(np.sqrt(places), np.sqrt(places), places * np.pi))
    sin_i, sin_e, zero = np.sqrt(1 - cos_i**2), np.sqrt(1 - cos_e**2), np.zeros_like(psi)
    normal = np.stack([zero, zero, zero + 1], axis=1)
    to_lamp = np.stack([sin_i, zero, cos_i], axis=1)
    to_viewer = np.stack([sin_e * np.cos(psi), sin_e * np.sin(psi), cos_e], axis=1)
    return float(np.pi * brdf.reflectance(parameters, normal, to_lamp, to_viewer).mean())
