"""Light from around that nothing shades: what walls return from above, and even light from all sides."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

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
    """Collects how much of such light the pixels of a view face; nothing where paths are traced instead.

    Models with one albedo share what they collect; those whose albedo differs from place to place have their own.
    """

    def __init__(
        self, options: RenderOptions, materials: Materials, models: Sequence[Model], size: tuple[int, int]
    ) -> None:
        self._options, self._materials = options, materials
        amounts = {} if options.bounces else {kind: getattr(options, kind) for kind in _SEEN}
        self._amounts = {kind: amount for kind, amount in amounts.items() if amount}
        models = [model for model in models if model not in CHRONO] if self._amounts else []
        albedos = {model: materials.same_everywhere(model) for model in models}
        self._even = {model: albedo for model, albedo in albedos.items() if albedo is not None}
        self._varied = [model for model, albedo in albedos.items() if albedo is None]
        plain = (False,) if options.rim_albedo is None else (False, True)
        pairs = [(kind, of) for kind in self._amounts for of in plain] if self._even else []
        self._shares = {pair: np.zeros(size, np.float32) for pair in pairs}
        self._sent = {(kind, model): np.zeros(size, np.float32) for kind in self._amounts for model in self._varied}

    @property
    def even(self) -> bool:
        """All surfaces scatter such light alike: what `take_in` takes is enough."""
        return not self._varied and (self._options.rim_albedo is None or not self._amounts)

    def take_in(self, faced: Mapping[str, np.ndarray]) -> None:
        """Take the shares (h, w) of each kind of light that pixels face, the mean over their samples."""
        for (kind, _), share in self._shares.items():
            share += faced[kind]

    def add(self, hits: Hits, samples: int) -> None:
        """Count the hits of one of so many samples a pixel."""
        if not self._amounts:
            return
        plain = self._materials.plain(hits.face) if self._options.rim_albedo is not None else None
        albedos = {model: self._materials.albedo(model, hits) for model in self._varied}
        for kind in self._amounts:
            seen = _SEEN[kind](hits.normal) / np.float32(samples)
            for of in (of for found, of in self._shares if found == kind):
                own = seen if plain is None else np.where(plain == of, seen, np.float32(0))
                self._shares[kind, of][hits.rows].reshape(-1)[hits.pixel] += own
            for model, albedo in albedos.items():
                self._sent[kind, model][hits.rows].reshape(-1)[hits.pixel] += albedo * seen

    def into(self, olat_images: Mapping[tuple[Model, str], np.ndarray], lamps: Mapping[str, Lamp]) -> None:
        """Add the light to OLAT images; Chrono's models have none."""
        for (model, name), olat_image in olat_images.items():
            for kind, amount in self._amounts.items():
                irradiance = amount * lamps[name].intensity
                if model in self._even:
                    for plain in (plain for found, plain in self._shares if found == kind):
                        albedo = self._options.rim_albedo if plain else self._even[model]
                        olat_image += np.float32(irradiance * (albedo or 0.0) / np.pi) * self._shares[kind, plain]
                elif model in self._varied:
                    olat_image += np.float32(irradiance / np.pi) * self._sent[kind, model]
