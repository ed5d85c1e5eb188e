"""Materials: reflectance and albedo of each object under each reflectance model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from polarsim.render import brdf
from polarsim.render.hits import Hits
from polarsim.render.options import CHRONO, MODELS, Model, RenderOptions
from polarsim.render.parameters import Parameters
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, BODY, GROUND, ROCK_IDS

Reflectance = Callable[[Parameters, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
_NAMES = {BACKGROUND: ("walls",), GROUND: ("ground",)}


@dataclass(frozen=True)
class Kinds:
    """Distinct parameters of one model in a scene, with the parameters and the albedo factor of each id."""

    parameters: tuple[Parameters, ...]
    of_id: np.ndarray | None  # index into `parameters` by id; None if all ids have the same parameters
    factor: np.ndarray | None  # float32 albedo factor by id; None if all factors are 1


@dataclass(frozen=True)
class Materials:
    """Reflectance of every hit under every model."""

    surfaces: Surfaces
    options: RenderOptions
    engine: Reflectance  # evaluates models

    def reflectance(
        self,
        model: Model,
        hits: Hits,
        chosen: np.ndarray,
        normal: np.ndarray,
        to_lamp: np.ndarray,
        to_viewer: np.ndarray,
    ) -> np.ndarray:
        """Return f_r (m,), 1/sr, of the chosen hits (m,) for unit vectors (m, 3); 0 below the surface."""
        kinds = self._kinds[model]
        if kinds.of_id is None:
            values = self.engine(kinds.parameters[0], normal, to_lamp, to_viewer)
        else:
            kind = kinds.of_id.take(self.surfaces.id_of_face.take(hits.face.take(chosen)))
            values = np.zeros(len(chosen), normal.dtype)
            for number, parameters in enumerate(kinds.parameters):
                of_kind = np.flatnonzero(kind == number)
                if len(of_kind):
                    vectors = (vector.take(of_kind, axis=0) for vector in (normal, to_lamp, to_viewer))
                    values[of_kind] = self.engine(parameters, *vectors)
        self._multiply_albedo(values, model, hits, chosen)
        if self.options.wall_albedo is not None:
            values[self.plain(hits.face.take(chosen)) & (values > 0)] = self.options.wall_albedo / np.pi
        return values

    def albedo(self, model: Model, hits: Hits) -> np.ndarray:
        """Return the hemispherical albedo (n,) float32 of the hits; 0 for Chrono's models."""
        kinds = self._kinds[model]
        albedos = np.array([_diffuse_albedo(model, parameters) for parameters in kinds.parameters], np.float32)
        if kinds.of_id is None:
            values = np.full(len(hits.face), albedos[0])
        else:
            values = albedos.take(kinds.of_id.take(self.surfaces.id_of_face.take(hits.face)))
        self._multiply_albedo(values, model, hits, None)
        if self.options.wall_albedo is not None:
            values[self.plain(hits.face)] = self.options.wall_albedo
        return values

    def same_everywhere(self, model: Model) -> float | None:
        """Return the albedo if all surfaces except diffuse walls have the same albedo, else None."""
        kinds = self._kinds[model]
        if kinds.of_id is not None or kinds.factor is not None or model in self.surfaces.albedo:
            return None
        return _diffuse_albedo(model, kinds.parameters[0])

    def plain(self, face: np.ndarray) -> np.ndarray:
        """Return which faces (n,) are diffuse walls, with the albedo `wall_albedo`."""
        if self.options.wall_albedo is None:
            return np.zeros(len(face), bool)
        return np.asarray(self.surfaces.id_of_face[face] == BACKGROUND)

    def _multiply_albedo(self, values: np.ndarray, model: Model, hits: Hits, chosen: np.ndarray | None) -> None:
        """Multiply the values (m,) of the chosen hits, or of all hits, by the albedo factors of the hits."""
        factor, of_vertex = self._kinds[model].factor, self.surfaces.albedo.get(model)
        if factor is None and of_vertex is None:
            return
        face = hits.face if chosen is None else hits.face.take(chosen)
        if factor is not None:
            values *= factor.take(self.surfaces.id_of_face.take(face))
        if of_vertex is not None:
            weights = hits.weights if chosen is None else hits.weights.take(chosen, axis=0)
            values *= between_corners(of_vertex, self.surfaces.faces.take(face, axis=0), weights)

    @cached_property
    def _kinds(self) -> dict[Model, Kinds]:
        return {model: kinds_of(model, self.surfaces, self.options) for model in MODELS}


def kinds_of(model: Model, surfaces: Surfaces, options: RenderOptions) -> Kinds:
    """Return the parameters and albedo factors of all objects of a scene under a model."""
    if not options.materials:
        return Kinds((options.parameters(model),), None, None)
    size = int(surfaces.ids.max(initial=GROUND)) + 1
    of_id, factor = np.zeros(size, np.int64), np.ones(size, np.float32)
    parameters: list[Parameters] = []
    for number in surfaces.ids.tolist():
        names = _names(number)
        of_object = options.parameters(model, *names)
        if of_object not in parameters:
            parameters.append(of_object)
        of_id[number], factor[number] = parameters.index(of_object), options.albedo_factor(*names)
    if not parameters:
        parameters = [options.parameters(model)]
    return Kinds(tuple(parameters), of_id if len(parameters) > 1 else None, None if (factor == 1).all() else factor)


def _names(number: int) -> tuple[str, ...]:
    """Return the names of the materials of an id in the options, from specific to general."""
    if BODY <= number < ROCK_IDS:
        return f"body{number - BODY}", "body"
    return _NAMES.get(number, (str(number - ROCK_IDS), "rocks"))


def between_corners(of_vertex: np.ndarray, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Interpolate vertex values at points of triangles, (n,) float32.

    `corners` (n, 3): vertex numbers of the triangle of each point. `weights` (n, 2): barycentric weights of the second
    and third corner.
    """
    first, second, third = (of_vertex.take(corners[:, number]) for number in range(3))
    return np.asarray(first + weights[:, 0] * (second - first) + weights[:, 1] * (third - first), np.float32)


def _diffuse_albedo(model: Model, parameters: Parameters) -> float:
    """Return `hemispherical_albedo`, or 0 for Chrono's models, which have no ambient light."""
    return 0.0 if model in CHRONO else hemispherical_albedo(parameters)


@lru_cache(maxsize=64)
def hemispherical_albedo(parameters: Parameters) -> float:
    """Return the bihemispherical albedo, the reflected share of uniform light, by a fixed quadrature."""
    shares = (np.arange(12) + 0.5) / 12  # quantiles of sin^2: equal shares of cosine-weighted light
    cos_i, cos_e, psi = (a.ravel() for a in np.meshgrid(np.sqrt(shares), np.sqrt(shares), shares * np.pi))
    sin_i, sin_e, zero = np.sqrt(1 - cos_i**2), np.sqrt(1 - cos_e**2), np.zeros_like(psi)
    normal = np.stack([zero, zero, zero + 1], axis=1)
    to_lamp = np.stack([sin_i, zero, cos_i], axis=1)
    to_viewer = np.stack([sin_e * np.cos(psi), sin_e * np.sin(psi), cos_e], axis=1)
    return float(np.pi * brdf.reflectance(parameters, normal, to_lamp, to_viewer).mean())
