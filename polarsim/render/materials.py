"""What surfaces are made of: every thing scatters by a model, with parameters and an albedo that may be its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from polarsim.render import brdf
from polarsim.render.hits import Hits
from polarsim.render.options import CHRONO, MODELS, Model, Parameters, RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import BACKGROUND, BODY, GROUND, ROCK_IDS

Reflectance = Callable[[Parameters, np.ndarray, np.ndarray, np.ndarray], np.ndarray]
_NAMES = {BACKGROUND: ("walls",), GROUND: ("ground",)}


@dataclass(frozen=True)
class Kinds:
    """Under one model: the parameters that occur, and by id which of them and what factor of albedo; none: one kind."""

    parameters: tuple[Parameters, ...]
    of_id: np.ndarray | None  # number of the parameters
    factor: np.ndarray | None  # float32


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
        """(m,) f_r in 1/sr of chosen hits (m,) along their unit vectors (m, 3), which the surface faces or 0."""
        kinds = self._kinds[model]
        if kinds.of_id is None:
            values = self.engine(kinds.parameters[0], normal, to_lamp, to_viewer)
        else:
            kind = kinds.of_id.take(self.surfaces.id_of_face.take(hits.face.take(chosen)))
            values = np.zeros(len(chosen), normal.dtype)
            for number, parameters in enumerate(kinds.parameters):
                own = np.flatnonzero(kind == number)
                if len(own):
                    vectors = (vector.take(own, axis=0) for vector in (normal, to_lamp, to_viewer))
                    values[own] = self.engine(parameters, *vectors)
        self._paint(values, model, hits, chosen)
        if self.options.rim_albedo is not None:
            values[self.plain(hits.face.take(chosen)) & (values > 0)] = self.options.rim_albedo / np.pi
        return values

    def albedo(self, model: Model, hits: Hits) -> np.ndarray:
        """(n,) float32 share of light from all sides that the hits scatter back; Chrono's models know no such light."""
        kinds = self._kinds[model]
        albedos = np.array([_even_albedo(model, parameters) for parameters in kinds.parameters], np.float32)
        if kinds.of_id is None:
            values = np.full(len(hits.face), albedos[0])
        else:
            values = albedos.take(kinds.of_id.take(self.surfaces.id_of_face.take(hits.face)))
        self._paint(values, model, hits, None)
        if self.options.rim_albedo is not None:
            values[self.plain(hits.face)] = self.options.rim_albedo
        return values

    def same_everywhere(self, model: Model) -> float | None:
        """The albedo, where all surfaces have the same one but for plain walls; else None."""
        kinds = self._kinds[model]
        if kinds.of_id is not None or kinds.factor is not None or model in self.surfaces.albedo:
            return None
        return _even_albedo(model, kinds.parameters[0])

    def plain(self, face: np.ndarray) -> np.ndarray:
        """(n,) bool: faces that are diffuse with the walls' own albedo."""
        if self.options.rim_albedo is None:
            return np.zeros(len(face), bool)
        return np.asarray(self.surfaces.id_of_face[face] == BACKGROUND)

    def _paint(self, values: np.ndarray, model: Model, hits: Hits, chosen: np.ndarray | None) -> None:
        """Multiply values (m,) of chosen hits, or of all, by the albedo factors there."""
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
    """What a scene's things are made of under a model."""
    if not options.materials:
        return Kinds((options.parameters(model),), None, None)
    size = int(surfaces.ids.max(initial=GROUND)) + 1
    of_id, factor = np.zeros(size, np.int64), np.ones(size, np.float32)
    parameters: list[Parameters] = []
    for number in surfaces.ids.tolist():
        names = _names(number)
        own = options.parameters(model, *names)
        if own not in parameters:
            parameters.append(own)
        of_id[number], factor[number] = parameters.index(own), options.albedo_factor(*names)
    if not parameters:
        parameters = [options.parameters(model)]
    return Kinds(tuple(parameters), of_id if len(parameters) > 1 else None, None if (factor == 1).all() else factor)


def _names(number: int) -> tuple[str, ...]:
    """What the options call an id's material, its own name first."""
    if BODY <= number < ROCK_IDS:
        return f"body{number - BODY}", "body"
    return _NAMES.get(number, (str(number - ROCK_IDS), "rocks"))


def between_corners(of_vertex: np.ndarray, corners: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(n,) float32 values between those of a triangle's corners (n, 3), by weights (n, 2) of the second and third."""
    first, second, third = (of_vertex.take(corners[:, number]) for number in range(3))
    return np.asarray(first + weights[:, 0] * (second - first) + weights[:, 1] * (third - first), np.float32)


def _even_albedo(model: Model, parameters: Parameters) -> float:
    """`hemispherical_albedo`; none of Chrono's models, which know no light from all sides."""
    return 0.0 if model in CHRONO else hemispherical_albedo(parameters)


@lru_cache(maxsize=64)
def hemispherical_albedo(parameters: Parameters) -> float:
    """Share of light from all sides that a surface scatters back (bihemispherical albedo), by a fixed quadrature."""
    shares = (np.arange(12) + 0.5) / 12  # of sin^2: equal shares of cosine-weighted light
    cos_i, cos_e, psi = (a.ravel() for a in np.meshgrid(np.sqrt(shares), np.sqrt(shares), shares * np.pi))
    sin_i, sin_e, zero = np.sqrt(1 - cos_i**2), np.sqrt(1 - cos_e**2), np.zeros_like(psi)
    normal = np.stack([zero, zero, zero + 1], axis=1)
    to_lamp = np.stack([sin_i, zero, cos_i], axis=1)
    to_viewer = np.stack([sin_e * np.cos(psi), sin_e * np.sin(psi), cos_e], axis=1)
    return float(np.pi * brdf.reflectance(parameters, normal, to_lamp, to_viewer).mean())
