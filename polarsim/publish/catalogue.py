"""Catalogue of a run, the only input of the writers of formats; `catalogue_reader` reads it.

A catalogue contains paths of files and small data (keys, poses, lamps); labels are read per terrain on demand.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.formats.coco import read_coco
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.camera import Camera
from polarsim.photo import NO_ROCK, PhotoKey, Terrain, terrain_text
from polarsim.run_files.rigs import SURVEYED, LocalisedRig
from polarsim.run_files.run import Run
from polarsim.site import Site

Origin = Literal["measured", "fitted", "synthetic"]
# Origin of raw data by source: all data of the analog are synthetic.
MEASURED: dict[str, Origin] = {"analog": "synthetic", "files": "measured", "release": "measured"}
PHOTO_DOMAINS = {"analog": "analog", "files": "real", "release": "real"}  # by kind of source
MAPS = {  # kinds of renders/maps: unit, step and meaning of the values; all are computed from fitted meshes and poses
    "depth": ("mm", 1.0, "Depth along the optical axis; 65535: nothing is seen."),
    "incidence": ("deg", 0.01, "Incidence of the lamp's light; 65535: nothing is seen."),
    "emergence": ("deg", 0.01, "Emergence towards the camera; 65535: nothing is seen."),
    "phase": ("deg", 0.01, "Phase angle; 65535: nothing is seen."),
    "lit": ("", 0.0001, "Share of the lamp that the surface sees; 65535: nothing is seen."),
    "shading": ("", 1.0, "Why a pixel is dark: 0 nothing is seen, 1 lit, 2 ground's shadow, 3 a wall's, 4 faces away, "
                "1000 + k and 2000 + k shadows of rock k on itself and on others."),
    "normal": ("", 1.0, "Normal in the sandbox frame: x, y, z as (n + 1) / 2 of 65535; 0 in all: nothing is seen."),
}  # fmt: skip
# Origin of labels by label source: human annotations are measured; propagated labels are computed from seeds, meshes
# and lamps, which are fitted; rendered labels are exact labels of synthetic images.
LABEL_ORIGINS: dict[str, Origin] = {
    "seed": "measured",
    "annotated": "measured",
    "fused": "fitted",
    "translated": "fitted",
    "projected": "fitted",
    "cast": "fitted",
    "rendered": "synthetic",
}


@dataclass(frozen=True, order=True)
class CatalogueImage:
    """Photo or twin: domain (`real`, `analog`, or a reflectance model), key, file and size."""

    domain: str
    key: PhotoKey
    path: Path
    width: int
    height: int
    sha256: str = ""  # of photos listed in a table of the run
    part: str = ""  # of `Catalogue.split`: train, val or test; empty if in no part

    @property
    def name(self) -> str:
        """Domain and key, without folder and suffix; the same in all formats."""
        return f"{self.domain}/{self.key}"

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height


@dataclass(frozen=True)
class CatalogueTerrain:
    """Cameras, lamps, meshes and rocks of a terrain."""

    number: Terrain  # or name
    site: Site
    kind: str  # of the source
    rigs: Mapping[str, LocalisedRig]  # by position
    suns: Mapping[str, np.ndarray]  # by azimuth, sandbox frame, metres
    fitted_suns: frozenset[str]  # azimuths of lamps located in photos; the positions of other lamps are surveyed
    meshes: Mapping[int, Path]  # by rock, NO_ROCK for the ground
    made_from: Mapping[str, str]  # source of each mesh file
    rocks: pd.DataFrame | None  # `schemas.ROCKS`
    maps: Mapping[str, tuple[Path, ...]]  # renders/maps: depth, normals, photometric angles by name

    @property
    def rig_lamps(self) -> Iterator[tuple[str, np.ndarray, Origin]]:
        """Position, place (3,) and origin of the rig's lamp at each localised position; empty without such a lamp."""
        if lamp := self.site.rig_lamp:
            for position, localised in sorted(self.rigs.items()):
                yield position, localised.rover_light(lamp), self.pose_origin(position)

    @property
    def name(self) -> str:
        return f"Terrain{terrain_text(self.number)}"

    def sun_origin(self, azimuth: str) -> Origin:
        return "fitted" if azimuth in self.fitted_suns else MEASURED[self.kind]

    def pose_origin(self, position: str) -> Origin:
        """Return the origin of a pose: poses from the survey are raw data, all other poses are fitted."""
        return MEASURED[self.kind] if self.rigs[position].method == SURVEYED else "fitted"


@dataclass(frozen=True)
class Catalogue:
    """Data of a run that can be published."""

    run: Path
    site: Site
    kind: str  # of the source: analog, files or release
    terrains: Mapping[Terrain, CatalogueTerrain]
    pictures: tuple[CatalogueImage, ...]  # in the order of domains and keys
    drives: tuple[Path, ...] = ()  # folders
    tables: tuple[Path, ...] = ()
    split: str = ""  # name of the split that `CatalogueImage.part` refers to; empty if the run has no split
    config: str = ""  # hash of the run's configuration
    made_on: str = ""  # date (UTC, YYYY-MM-DD) of the run's newest image, label, pose or mesh
    left_out: tuple[str, ...] = field(default_factory=tuple)  # sentences on excluded data

    @property
    def name(self) -> str:
        return self.run.name

    @property
    def photo_domain(self) -> str:
        return PHOTO_DOMAINS[self.kind]

    @cached_property
    def domains(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(picture.domain for picture in self.pictures))

    def of_domain(self, domain: str) -> list[CatalogueImage]:
        return [picture for picture in self.pictures if picture.domain == domain]

    def picture_origin(self, picture: CatalogueImage) -> Origin:
        """Return the origin of an image: real photos are measured, photos of the analog and twins are synthetic."""
        return "measured" if picture.domain == "real" else "synthetic"

    def label_origin(self, label: Annotation) -> Origin:
        """Return the origin of the box and mask of a label."""
        origin = LABEL_ORIGINS.get(label.source, "fitted")
        return MEASURED[self.kind] if origin == "measured" else origin

    def is_photo(self, picture: CatalogueImage) -> bool:
        return picture.domain == self.photo_domain

    def camera(self, picture: CatalogueImage) -> Camera | None:
        """Return the camera of an image; None if the position is not localised."""
        localised = self.terrains[picture.key.terrain].rigs.get(picture.key.position)
        if localised is None:
            return None
        camera = localised.camera(picture.key.camera)
        return camera if picture.width == camera.lens.width else camera.scaled(picture.width / camera.lens.width)

    def labels(self, picture: CatalogueImage) -> list[Annotation]:
        """Return the labels of an image with masks: propagated labels of photos, exact labels of twins."""
        path = self.label_file(picture)
        return _coco(path, picture.size).get(picture.key, []) if path else []

    def label_file(self, picture: CatalogueImage) -> Path | None:
        """Return the COCO file with the labels of an image; None if the run has no labels yet."""
        stage = "labels" if self.is_photo(picture) else "renders"
        path = self.run / stage / "coco" / f"Terrain{terrain_text(picture.key.terrain)}.json"
        return path if path.is_file() else None

    def sources(self, picture: CatalogueImage) -> list[Path]:
        """Return the files of an image, its labels and its pose."""
        files = (picture.path, self.label_file(picture), self.camera_file(picture))
        return [path for path in files if path and path.is_file()]

    def camera_file(self, picture: CatalogueImage) -> Path:
        """Return the file with the pose of the stereo rig."""
        return self.run / "cameras" / f"Terrain{terrain_text(picture.key.terrain)}" / f"Pos{picture.key.position}.json"

    def maps(self) -> list[tuple[str, Path]]:
        """Return kind and file of the maps (depth, photometric angles ...) of all views and brackets."""
        keys = [picture.key for picture in self.pictures]
        wanted = {str(key).rpartition("_")[0] for key in keys}  # exposure brackets
        wanted |= {f"{terrain_text(key.terrain)}_{key.position}_{key.camera}" for key in keys}
        return [
            (name, path)
            for terrain in self.terrains.values()
            for name, paths in sorted(terrain.maps.items())
            for path in paths
            if name in MAPS and path.suffix == ".png" and path.stem in wanted
        ]

    def instances(self, picture: CatalogueImage) -> Path | None:
        """Return the instance map of a twin; None for photos."""
        path = Run(self.run).instances(picture.key)
        return path if not self.is_photo(picture) and path.is_file() else None

    def with_pictures(self, pictures: Iterator[CatalogueImage] | list[CatalogueImage], *notes: str) -> Catalogue:
        """Return the catalogue with these images only; `notes` are the reasons."""
        kept = tuple(pictures)
        terrains = {picture.key.terrain for picture in kept}
        return replace(
            self,
            pictures=kept,
            terrains={number: terrain for number, terrain in self.terrains.items() if number in terrains},
            left_out=(*self.left_out, *notes),
        )


@lru_cache(maxsize=4)  # images are processed by terrain, in at most three domains
def _coco(path: Path, size: tuple[int, int]) -> dict[PhotoKey, list[Annotation]]:
    return read_coco(path, size, PhotoKey.parse)


def shadow_casters(labels: list[Annotation]) -> list[int]:
    """Return for each shadow the index of the label of the rock that casts it; -1 for rocks and unknown rocks."""
    first: dict[int, int] = {}
    for index, label in enumerate(labels):
        if label.kind == "rock" and label.rock != NO_ROCK:
            first.setdefault(label.rock, index)
    return [first.get(label.rock, -1) if label.kind == "shadow" and label.rock != NO_ROCK else -1 for label in labels]
