"""Photos that took part in a fit of a run, as recorded by the files of the fit."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ValidationError

from polarsim.errors import FormatError
from polarsim.formats.files import read_json
from polarsim.formats.readers import reader
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import PhotoKey
from polarsim.run_files.materials import TABLE_FILE


@dataclass(frozen=True)
class FittedPhotos:
    """Selection of photos of a terrain by Sun azimuth and position, of both cameras and all exposures."""

    azimuths: frozenset[str]
    positions: frozenset[str] | None = None  # None: all positions

    def includes(self, key: PhotoKey) -> bool:
        return key.azimuth in self.azimuths and (self.positions is None or key.position in self.positions)


class _Lamps(BaseModel, extra="ignore"):
    lamps: dict[str, float]


class _Record(BaseModel, extra="ignore"):
    """Fields of a file of a fit that describe the photos; without `azimuths`, the fitted lamps name the Suns."""

    azimuths: tuple[str, ...] | None = None
    positions: tuple[str, ...] | None = None
    models: dict[str, _Lamps]


@reader("fitted photos")
def read_fitted_photos(materials: Path) -> FittedPhotos | None:
    """Return the photos that took part in a fit of materials, from the folder of the fit; None if the fit failed."""
    try:
        record = _Record.model_validate(read_json(materials / TABLE_FILE))
    except ValidationError as error:
        raise FormatError(describe_error(error, "the file"), path=materials / TABLE_FILE) from error
    if not record.models:
        return None
    lamps = [lamp for fit in record.models.values() for lamp in fit.lamps]
    positions = None if record.positions is None else frozenset(record.positions)
    return FittedPhotos(frozenset(lamps if record.azimuths is None else record.azimuths), positions)
