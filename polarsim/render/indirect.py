"""Indirect light: path tracing with one to n bounces.

Surfaces scatter by their reflectance model; walls with `wall_albedo` are diffuse. The light of the lamps is added at
every bounce by shadow rays (next-event estimation, Kajiya, SIGGRAPH 1986). All lamps and models share a set of paths.

Most of the hemisphere above a sandbox is black sky, and the walls and rocks that reflect light are near the horizon.
Therefore half of the paths are sampled by the cosine and half by a density that is highest at the horizon. The balance
heuristic (Veach and Guibas, SIGGRAPH 1995) weights each path by the combined density: the mean is unchanged and the
noise is lower.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.rays import START_OFFSET
from polarsim.geometry.vectors import dot, normalise
from polarsim.randomness import generator
from polarsim.render.hits import Hits, cast_strip, for_strips, nearest_surface_hits, sample_offsets
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import lighting
from polarsim.render.materials import Materials
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.render.upsampling import LightGrid

_HORIZON = 0.15  # sine of the elevation at which the second density is half of the density at the horizon
_SPAN = float(np.arctan(1 / _HORIZON))
# Roberts' R2 sequence ("The unreasonable effectiveness of quasirandom sequences", 2018): even in two dimensions.
_STEPS = np.array([0.7548776662, 0.5698402910])
_MIN_COSINE = np.float32(1e-6)
_PIXELS_THICK = 2.0  # distance from a plane, coarse pixels, at which a point is treated as a different surface
OlatImages = dict[tuple[Model, str], np.ndarray]


class Paths:
    """Random light paths in a scene, shared by several models and lamps."""

    def __init__(
        self,
        surfaces: Surfaces,
        lamps: Mapping[str, Lamp],
        models: Sequence[Model],
        materials: Materials,
        options: RenderOptions,
    ) -> None:
        self._surfaces, self._materials, self._options = surfaces, materials, options
        self._models = tuple(models)
        # Lamps are points here: the radius of a disc softens shadow edges but hardly changes indirect light.
        self._lamps = [replace(lamp, radius_m=0.0) for lamp in lamps.values()]
        ambient = [options.ambient * lamp.intensity / np.pi for lamp in self._lamps]
        self._ambient = np.array(ambient, np.float32)[:, None]  # ambient radiance

    @property
    def kinds(self) -> int:
        """Number of model and lamp pairs."""
        return len(self._models) * len(self._lamps)

    def radiance(self, hits: Hits, rays: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Return reflected and arriving indirect light of the hits (n,), averaged over `rays` paths per hit.

        `sent` (kinds, n) float32 is the radiance towards the viewer, `vector` (kinds, 3, n) the light vector: the
        integral of radiance times direction, whose component along the normal is the irradiance. Kinds are the lamps of
        the first model, the lamps of the second, and so on.
        """
        sent = np.zeros((len(self._models), len(self._lamps), len(hits.pixel)), np.float32)
        vector = np.zeros((len(self._models), len(self._lamps), 3, len(hits.pixel)), np.float32)
        rotation = rng.random((len(hits.pixel), 2))
        for number in range(rays):
            direction, weight = scattered(hits, ((rotation + number * _STEPS) % 1).astype(np.float32))
            lit, arriving = self._arriving(hits, direction, weight, rng)
            along, weight = direction.take(lit, axis=0), weight.take(lit)
            sent[:, :, lit] += arriving * (weight * self._scattered(hits, lit, along))[:, None]
            per_angle = weight / np.maximum(dot(along, hits.normal.take(lit, axis=0)), _MIN_COSINE)
            for axis in range(3):
                vector[:, :, axis, lit] += arriving * (per_angle * along[:, axis])
        sent /= np.float32(rays)
        vector /= np.float32(rays)
        return sent.reshape(self.kinds, -1), vector.reshape(self.kinds, 3, -1)

    def _arriving(
        self, start: Hits, direction: np.ndarray, weight: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """Trace one path per hit (n,) along `direction` (n, 3); return the numbers (m,) of lit hits and the radiance.

        The radiance is (models, lamps, m). Hits with `weight` (n,) 0 are skipped.
        """
        lit = path = going = np.flatnonzero(weight)  # `path`: number of the hit at which the path of a ray starts
        radiance = np.zeros((len(self._models), len(self._lamps), len(start.pixel)), np.float32)
        carried = np.ones((len(self._models), len(path)), np.float32)  # throughput of the path
        for number in range(self._options.bounces):
            point, plane = start.point.take(going, axis=0), start.plane.take(going, axis=0)
            origins = point + np.float32(START_OFFSET) * plane
            next_hits = nearest_surface_hits(self._surfaces, start.rows, origins, direction.take(going, axis=0))
            if self._options.ambient:
                lost = np.delete(np.arange(len(path)), next_hits.pixel)
                radiance[:, :, path[lost]] += carried[:, None, lost] * self._ambient
            path, carried = path[next_hits.pixel], carried[:, next_hits.pixel]
            if not number and not self._options.ambient:
                lit = path
            self._add_lamps(radiance, next_hits, path, carried)
            start = next_hits
            if number + 1 < self._options.bounces:
                direction, weight = scattered(start, rng.random((len(path), 2), np.float32))
                going = np.flatnonzero(weight)
                path = path[going]
                carried = (
                    carried[:, going] * weight[going] * self._scattered(start, going, direction.take(going, axis=0))
                )
        if self._options.ambient:
            albedo = np.stack([self._materials.albedo(model, start) for model in self._models])
            radiance[:, :, path] += (carried * albedo)[:, None] * self._ambient
        return lit, radiance[:, :, lit]

    def _add_lamps(self, radiance: np.ndarray, hits: Hits, path: np.ndarray, carried: np.ndarray) -> None:
        for number, lamp in enumerate(self._lamps):
            lit, to_lamp, irradiance = lighting(self._surfaces, hits, lamp, falloff=self._options.falloff)
            radiance[:, number, path[lit]] += carried[:, lit] * irradiance * self._scattered(hits, lit, to_lamp)

    def _scattered(self, hits: Hits, chosen: np.ndarray, to_lamp: np.ndarray) -> np.ndarray:
        """Return f_r (models, m) of the chosen hits (m,) for light from unit vectors (m, 3)."""
        normal, to_viewer = hits.normal.take(chosen, axis=0), hits.to_viewer.take(chosen, axis=0)
        vectors = (normal, to_lamp, to_viewer)
        reflectances = [self._materials.reflectance(model, hits, chosen, *vectors) for model in self._models]
        return np.stack(reflectances)


def scattered(hits: Hits, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return random unit vectors (n, 3) from the hits, and cosine over density (n,); 0 for vectors into the surface.

    `at` (n, 2) float32: uniform samples between 0 and 1.
    """
    by_cosine = at[:, 0] < np.float32(0.5)
    height = 1 - 4 * (at[:, 0] - np.where(by_cosine, np.float32(0), np.float32(0.5)))  # -1 to 1
    # Lorentzian in the sine of the elevation; the measured noise is 0.4 of the noise of cosine sampling only.
    height = np.where(by_cosine, height, np.float32(_HORIZON) * np.tan(np.float32(_SPAN) * height))
    angle = np.float32(2 * np.pi) * at[:, 1]
    level = np.sqrt(np.maximum(1 - height * height, np.float32(0)))
    sphere = np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1)
    # The direction to a uniform point of the unit sphere around the tip of the normal is cosine-distributed.
    outwards = np.where(dot(sphere, hits.normal) < 0, np.float32(-1), np.float32(1))[:, None] * sphere
    direction = np.where(by_cosine[:, None], normalise(hits.normal + sphere), outwards)
    cosine = dot(direction, hits.normal)
    used = (cosine > 0) & (dot(direction, hits.plane) > 0)
    near_horizon = np.float32(_HORIZON / (2 * np.pi * _SPAN)) / (direction[:, 2] ** 2 + np.float32(_HORIZON**2))
    density = (cosine / np.float32(np.pi) + near_horizon) / 2
    return direction, np.divide(cosine, density, out=np.zeros_like(cosine), where=used)


def indirect_olat_images(
    surfaces: Surfaces,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    models: Sequence[Model],
    materials: Materials,
    options: RenderOptions,
    threads: int = 1,
) -> OlatImages:
    """Trace the indirect light (h, w) float32 of a view by model and lamp, in the units of `Rendering.olat_images`."""
    height, width = camera.lens.shape
    olat_images = {(model, name): np.zeros((height, width), np.float32) for model in models for name in lamps}
    if not olat_images:
        return olat_images
    surfaces.prepare(shadows=False)
    paths = Paths(surfaces, lamps, models, materials, options)
    offsets = sample_offsets(options)
    rays = -(-options.bounce_rays // len(offsets))
    # The noise of two cameras must differ: stereo matching would match identical noise at zero disparity.
    purpose = ("indirect", np.round(camera.world_from_camera.matrix, 6).tolist())
    grid = None
    if options.bounce_scale > 1:
        grid = _coarse_light(surfaces, camera, paths, options, purpose, threads)

    def work(rows: slice) -> None:
        rng = generator(options.seed, *purpose, rows.start)
        for offset in offsets:
            hits = cast_strip(surfaces, camera, rows, offset)
            if grid is None:
                light, _ = paths.radiance(hits, rays, rng)
            else:
                light, missing = grid.at(hits, width, offset)
                light[:, missing], _ = paths.radiance(hits.part(missing), rays, rng)
            for olat_image, kind in zip(olat_images.values(), light, strict=True):
                olat_image[rows].reshape(-1)[hits.pixel] += kind / np.float32(len(offsets))

    for_strips(height, threads, work)
    return olat_images


def _coarse_light(
    surfaces: Surfaces,
    camera: Camera,
    paths: Paths,
    options: RenderOptions,
    purpose: tuple[object, ...],
    threads: int,
) -> LightGrid:
    """Trace and smooth the light at every `bounce_scale`-th pixel."""
    coarse = camera.scaled(1 / options.bounce_scale)
    size = height, width = coarse.lens.shape
    point, normal = np.zeros((*size, 3), np.float32), np.zeros((*size, 3), np.float32)
    hit, thickness = np.zeros(size, bool), np.zeros(size, np.float32)
    light, vector = np.zeros((paths.kinds, *size), np.float32), np.zeros((paths.kinds, 3, *size), np.float32)
    pixel_size = _PIXELS_THICK / coarse.lens.fx  # at unit distance

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, coarse, rows)
        sent, arriving = paths.radiance(
            hits, options.bounce_rays, generator(options.seed, *purpose, "coarse", rows.start)
        )
        from_camera = hits.point - camera.centre.astype(np.float32)
        for picture, values in (
            (point, hits.point),
            (normal, hits.normal),
            (hit, True),
            (thickness, np.float32(pixel_size) * np.sqrt(dot(from_camera, from_camera))),
        ):
            picture[rows].reshape(-1, *picture.shape[2:])[hits.pixel] = values
        high = rows.stop - rows.start
        filled = np.zeros((paths.kinds, 4, high * width), np.float32)
        filled[:, 0, hits.pixel], filled[:, 1:, hits.pixel] = sent, arriving
        filled = filled.reshape(paths.kinds, 4, high, width)
        light[:, rows], vector[:, :, rows] = filled[:, 0], filled[:, 1:]

    for_strips(height, threads, work)
    return LightGrid.smoothed(options.bounce_scale, hit, point, normal, thickness, light, vector)
