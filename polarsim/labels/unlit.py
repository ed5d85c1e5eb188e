"""Photos that no lamp lights: black, but for stray light at some positions, where people drew rocks all the same."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from polarsim.labels.seeds import Drawings
from polarsim.photo import Azimuth, Light, PhotoKey


def is_unlit(light: Light, azimuth: Azimuth) -> bool:
    """Neither a Sun lamp nor the rover light shines."""
    return azimuth == "no" and light == "off"


@dataclass(frozen=True)
class UnlitStarts:
    """Shortest exposure with rocks that people drew without any lamp, by position."""

    annotated_ms: Mapping[str, int]

    @classmethod
    def of(cls, drawings: Drawings) -> UnlitStarts:
        """Each position speaks for itself: a light leak at one does not reach the others."""
        annotated_ms: dict[str, int] = {}
        for key, annotated in drawings.items():
            if is_unlit(key.light, key.azimuth) and len(annotated.rocks):
                annotated_ms[key.position] = min(annotated_ms.get(key.position, key.exposure_ms), key.exposure_ms)
        return cls(annotated_ms)

    def shown(self, key: PhotoKey) -> bool:
        """Whether an unlit photo shows anything, as far as somebody drew it; nobody did: it is black."""
        start = self.annotated_ms.get(key.position)
        return start is not None and key.exposure_ms >= start
