"""One view under its lamps from one cast of rays: layers, of which photos are sums, and pictures of ids."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.errors import RenderError
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.vectors import dot, length, scaled
from polarsim.render import brdf
from polarsim.render.hits import Hits, cast_strip, for_strips, sample_offsets
from polarsim.render.lamps import Lamp
from polarsim.render.options import CHRONO, Model, Parameters, RenderOptions
from polarsim.render.penumbra import visible_share
from polarsim.render.shadows import ground_shadows
from polarsim.render.surfaces import Surfaces

NO_LAMP = "none"  # name of the picture of ids without any shadow
_SCATTER = (0.6180339887, 0.7548776662)  # steps that never come near a place of before: turns of neighbours differ
_CENTRE = (0.0, 0.0)  # of a pixel: ids are those of what it meets
Reflectance = Callable[[Parameters, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Rendering:
    """A view: its layers by model and lamp, and its ids by the lamp that throws the shadows.

    layers : (h, w) float32
        Radiance; 1 is what unit reflectance f_r sends back under a Sun lamp that stands 4 m off, straight above the
        surface. Nothing is black.
    ids : (h, w) uint16
        BACKGROUND, GROUND, RELIEF_SHADOW (ground that the relief or a wall hides from the lamp), ROCK_IDS + k for rock
        k, SHADOW_IDS + k for ground that rock k hides from the lamp. `NO_LAMP` is without any shadow.
    """

    layers: dict[tuple[Model, str], np.ndarray]
    ids: dict[str, np.ndarray]


def render_view(
    surfaces: Surfaces,
    sandbox_from_camera: Pose,
    lens: Lens,
    lamps: Mapping[str, Lamp],
    models: Sequence[Model],
    throwing: Collection[str] | None,
    options: RenderOptions,
    threads: int = 1,
) -> Rendering:
    """Layers of every model under every lamp, and ids with the shadows of the lamps named in `throwing`; None: no ids.

    Raises
    ------
    RenderError
        The engine cannot be loaded.
    """
    reflectance = reflectance_engine(options, threads)
    albedo = {model: 0.0 if model in CHRONO else hemispherical_albedo(options.parameters(model)) for model in models}
    offsets = sample_offsets(options.samples)
    surfaces.prepare(shadows=bool(throwing))
    size = (lens.height, lens.width)
    layers = {(model, name): np.zeros(size, np.float32) for model in models for name in lamps}
    ids = {} if throwing is None else {name: np.zeros(size, np.uint16) for name in (NO_LAMP, *throwing)}
    from_above = np.zeros(size, np.float32)  # share of the sky that a surface faces: light bounced from all around

    def work(rows: slice) -> None:
        samples_lit = {name: np.zeros((rows.stop - rows.start) * lens.width, np.uint8) for name in lamps}
        for offset in offsets:
            hits = cast_strip(surfaces, sandbox_from_camera, lens, rows, offset)
            if options.bounce:
                from_above[rows].reshape(-1)[hits.pixel] += (1 + hits.normal[:, 2]) / np.float32(2 * len(offsets))
            for name, lamp in lamps.items():
                lit, to_lamp, irradiance = lighting(
                    surfaces, hits, lamp, falloff=options.falloff, samples=options.lamp_samples
                )
                pixel, share = hits.pixel.take(lit), irradiance / np.float32(len(offsets))
                if not lamp.radius_m:  # else it may be a part of the disc alone that lights them
                    samples_lit[name][pixel] += 1
                normal, to_viewer = hits.normal.take(lit, axis=0), hits.to_viewer.take(lit, axis=0)
                for model in models:
                    strip = layers[model, name][rows].reshape(-1)  # a view: rows are whole
                    strip[pixel] += reflectance(options.parameters(model), normal, to_lamp, to_viewer) * share
        if not ids:
            return
        if offset != _CENTRE:
            hits = cast_strip(surfaces, sandbox_from_camera, lens, rows, _CENTRE, smooth=False)
        pictures = {name: picture[rows].reshape(-1) for name, picture in ids.items()}
        identify(pictures, surfaces, hits, lamps, {name: lit == len(offsets) for name, lit in samples_lit.items()})

    for_strips(lens.height, 1 if options.engine == "taichi" else threads, work)
    if options.bounce:
        for (model, name), layer in layers.items():
            layer += np.float32(options.bounce * lamps[name].intensity * albedo[model] / np.pi) * from_above
    return Rendering(layers, ids)


def identify(
    pictures: Mapping[str, np.ndarray],
    surfaces: Surfaces,
    hits: Hits,
    lamps: Mapping[str, Lamp],
    lit: Mapping[str, np.ndarray],
) -> None:
    """Write a strip's ids into flat pictures by lamp.

    `lit`: by lamp, bool for every pixel of the strip: its samples are all lit, and so is what lies between them.
    """
    met = surfaces.id_of_face.take(hits.face)
    for name, picture in pictures.items():
        shown = met
        if name != NO_LAMP:
            shown = ground_shadows(surfaces, hits, met, lamps[name], np.flatnonzero(lit[name].take(hits.pixel)))
        picture[hits.pixel] = shown


def lighting(
    surfaces: Surfaces, hits: Hits, lamp: Lamp, *, falloff: bool, samples: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers (m,) of the hits that a lamp lights, unit vectors (m, 3) to it, irradiance (m,) of the surface there.

    `samples`: rays to a lamp that is a disc, where it is seen in part.
    """
    to_lamp, irradiance = lamp.light_at(hits.point, falloff=falloff)
    # A flat face that looks away gets no light, whatever its smooth normal says: else light leaks past the terminator.
    along_normal = dot(hits.normal, to_lamp)
    lit = np.flatnonzero((dot(hits.plane, to_lamp) > 0) & (along_normal > 0))
    if lamp.radius_m:
        turn = 2 * np.pi * ((hits.pixel[lit] * _SCATTER[0] + hits.rows.start * _SCATTER[1]) % 1)
        points, towards = hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0)
        share = visible_share(surfaces, points, towards, lamp.radius_m, samples, turn)
        irradiance[lit] *= share
        lit = lit[share > 0]
    else:
        lit = lit[~surfaces.all.blocked(hits.point.take(lit, axis=0), to_lamp.take(lit, axis=0), 1.0)]
    to_lamp = to_lamp.take(lit, axis=0)
    nearness = 1 / length(to_lamp)
    return lit, scaled(to_lamp, nearness), irradiance.take(lit) * along_normal.take(lit) * nearness


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
