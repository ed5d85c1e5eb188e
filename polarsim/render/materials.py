"""What surfaces are made of: ground and rocks scatter by a model, so do walls without an albedo of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.formats.instances import BACKGROUND
from polarsim.render.options import Model, Parameters, RenderOptions
from polarsim.render.surfaces import Surfaces

Reflectance = Callable[[Parameters, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Materials:
    """Reflectance of every face under every model."""

    surfaces: Surfaces
    options: RenderOptions
    engine: Reflectance  # evaluates models
    model_albedo: Mapping[Model, float]  # bihemispherical

    def reflectance(
        self, model: Model, face: np.ndarray, normal: np.ndarray, to_lamp: np.ndarray, to_viewer: np.ndarray
    ) -> np.ndarray:
        """(n,) f_r in 1/sr of faces (n,) along unit vectors (n, 3), which the surface faces or 0."""
        values = self.engine(self.options.parameters(model), normal, to_lamp, to_viewer)
        if self.options.rim_albedo is not None:
            values[self.plain(face) & (values > 0)] = self.options.rim_albedo / np.pi
        return values

    def albedo(self, model: Model, face: np.ndarray) -> np.ndarray:
        """(n,) float32 share of light from all sides that faces (n,) scatter back."""
        values = np.full(len(face), self.model_albedo[model], np.float32)
        if self.options.rim_albedo is not None:
            values[self.plain(face)] = self.options.rim_albedo
        return values

    def plain(self, face: np.ndarray) -> np.ndarray:
        """(n,) bool: faces that are diffuse with the walls' own albedo."""
        if self.options.rim_albedo is None:
            return np.zeros(len(face), bool)
        return np.asarray(self.surfaces.id_of_face[face] == BACKGROUND)
