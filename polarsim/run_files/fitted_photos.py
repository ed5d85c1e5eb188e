"""Photos that took part in a fit of a run, as recorded by the files of the fit."""

from __future__ import annotations

from dataclasses import dataclass

from polarsim.photo import PhotoKey


@dataclass(frozen=True)
class FittedPhotos:
    """Selection of photos of a terrain by Sun azimuth and position, of both cameras and all exposures."""

    azimuths: frozenset[str]
    positions: frozenset[str] | None = None  # None: all positions

    def includes(self, key: PhotoKey) -> bool:
        return key.azimuth in self.azimuths and (self.positions is None or key.position in self.positions)
