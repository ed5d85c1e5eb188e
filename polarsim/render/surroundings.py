"""Light from around that nothing shades: what walls return from above, and even light from all sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from polarsim.render.hits import Hits
from polarsim.render.lamps import Lamp
from polarsim.render.materials import Materials
from polarsim.render.options import CHRONO, Model, RenderOptions

_SEEN: dict[str, Callable[[np.ndarray], np.ndarray]] = {  # share of the light that a normal (n, 3) faces
    "bounce": lambda normal: (1 + normal[:, 2]) / np.float32(2),
    "ambient": lambda normal: np.ones(len(normal), np.float32),
}


class Surroundings:
    """Collects how much of such light the pixels of a view face; nothing where paths are traced instead."""

    def __init__(self, options: RenderOptions, materials: Materials, size: tuple[int, int]) -> None:
        self._options, self._materials = options, materials
        self._amounts = {} if options.bounces else {kind: getattr(options, kind) for kind in _SEEN}
        self._amounts = {kind: amount for kind, amount in self._amounts.items() if amount}
        plain = (False,) if options.rim_albedo is None else (False, True)
        self._shares = {(kind, of): np.zeros(size, np.float32) for kind in self._amounts for of in plain}

    def add(self, hits: Hits, samples: int) -> None:
        """Count the hits of one of so many samples a pixel."""
        plain = self._materials.plain(hits.face) if self._options.rim_albedo is not None else None
        for (kind, of), share in self._shares.items():
            seen = _SEEN[kind](hits.normal) / np.float32(samples)
            if plain is not None:
                seen = np.where(plain == of, seen, np.float32(0))
            share[hits.rows].reshape(-1)[hits.pixel] += seen

    def into(self, layers: Mapping[tuple[Model, str], np.ndarray], lamps: Mapping[str, Lamp]) -> None:
        """Add the light to layers; Chrono's models have none."""
        for (model, name), layer in layers.items():
            if model in CHRONO:
                continue
            for (kind, plain), share in self._shares.items():
                albedo = self._options.rim_albedo if plain else self._materials.model_albedo[model]
                layer += np.float32(self._amounts[kind] * lamps[name].intensity * (albedo or 0.0) / np.pi) * share
