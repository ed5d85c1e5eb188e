"""Photos that took part in the fits of a run, as recorded by the files of the fits."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ValidationError

from polarsim.errors import FormatError
from polarsim.formats.files import read_json
from polarsim.formats.readers import reader
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import PhotoKey
from polarsim.run_files.light_fields import read_light_fields
from polarsim.run_files.materials import TABLE_FILE

GROUND_FILE = "ground.json"  # in the folder of the meshes, if the ground was refined by photos


@dataclass(frozen=True)
class FittedPhotos:
    """Selection of photos of a terrain by Sun azimuth and position, of both cameras and all exposures."""

    azimuths: frozenset[str]
    positions: frozenset[str]

    def includes(self, key: PhotoKey) -> bool:
        return key.azimuth in self.azimuths and key.position in self.positions


class _Materials(BaseModel, extra="ignore"):
    azimuths: tuple[str, ...]
    positions: tuple[str, ...]
    models: dict[str, object]


class _Ground(BaseModel, extra="ignore"):
    refined: bool
    photos: tuple[str, ...]


def read_fits(
    domains: Collection[str], materials: Path | None, light: Path | None, meshes: Path
) -> dict[str, list[FittedPhotos]]:
    """Return the photos of a terrain that took part in fits of the twins of each domain, by domain.

    `materials`, `light`: folder of fitted materials and file of light fields; domains without entries were not fitted.
    `meshes`: folder of the meshes; a ground refined by photos is part of the twins of all domains.
    """
    by_domain: dict[str, list[FittedPhotos]] = {domain: read_photos_of_ground(meshes) for domain in domains}
    for domain, fit in (read_photos_of_materials(materials) if materials else {}).items():
        by_domain.setdefault(domain, []).append(fit)
    for domain, fields in (read_light_fields(light) if light else {}).items():
        fits = [FittedPhotos(frozenset({azimuth}), frozenset(field.positions)) for azimuth, field in fields.items()]
        by_domain.setdefault(domain, []).extend(fits)
    return by_domain


@reader("fitted photos")
def read_photos_of_materials(materials: Path) -> dict[str, FittedPhotos]:
    """Return the photos that took part in a fit of materials, by domain, from the folder of the fit."""
    path = materials / TABLE_FILE
    try:
        record = _Materials.model_validate(read_json(path))
    except ValidationError as error:
        raise FormatError(describe_error(error, "the file"), path=path) from error
    return dict.fromkeys(record.models, FittedPhotos(frozenset(record.azimuths), frozenset(record.positions)))


@reader("fitted photos")
def read_photos_of_ground(meshes: Path) -> list[FittedPhotos]:
    """Return the photos that refined the ground of a folder of meshes; empty for a ground without photos."""
    path = meshes / GROUND_FILE
    if not path.exists():
        return []
    try:
        record = _Ground.model_validate(read_json(path))
    except ValidationError as error:
        raise FormatError(describe_error(error, "the file"), path=path) from error
    keys = [PhotoKey.parse(name) for name in record.photos] if record.refined else []
    return [FittedPhotos(frozenset({key.azimuth}), frozenset({key.position})) for key in keys]
