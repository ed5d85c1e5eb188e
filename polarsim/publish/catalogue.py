"""What a run has to give, read once from `results/<run>/`: every form is written from this and from nothing else.

A catalogue names files and holds what is small (keys, poses, lamps); labels are read a terrain at a time.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from polarsim.detect.options import DetectOptions
from polarsim.detect.split import read_split
from polarsim.errors import ConfigError, FormatError
from polarsim.formats import tables
from polarsim.formats.coco import Annotation, read_coco
from polarsim.geometry.camera import Camera
from polarsim.photo import NO_ROCK, SUNS, TERRAINS, PhotoKey
from polarsim.run_files import lamps, rigs, scene
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rigs import SURVEYED, LocalisedRig
from polarsim.run_files.run import CONFIG, PHOTO, Run

Origin = Literal["measured", "fitted", "synthetic"]
# What a real sandbox was measured as, an analog was made up as: nothing of it was ever measured.
MEASURED: dict[str, Origin] = {"analog": "synthetic", "polar": "measured", "release": "measured"}
PHOTO_DOMAINS = {"analog": "analog", "polar": "real", "release": "real"}  # by kind of source
MAPS = {  # of renders/maps: unit of a step, the step, and what it is; all are computed from fitted meshes and poses
    "depth": ("mm", 1.0, "Depth along the optical axis; 65535: nothing is seen."),
    "incidence": ("deg", 0.01, "Incidence of the lamp's light; 65535: nothing is seen."),
    "emergence": ("deg", 0.01, "Emergence towards the camera; 65535: nothing is seen."),
    "phase": ("deg", 0.01, "Phase angle; 65535: nothing is seen."),
    "lit": ("", 0.0001, "Share of the lamp that the surface sees; 65535: nothing is seen."),
    "shading": ("", 1.0, "Why a pixel is dark: 0 nothing is seen, 1 lit, 2 ground's shadow, 3 a wall's, 4 faces away, "
                "1000 + k and 2000 + k shadows of rock k on itself and on others."),
    "normal": ("", 1.0, "Normal in the sandbox frame: x, y, z as (n + 1) / 2 of 65535; 0 in all: nothing is seen."),
}  # fmt: skip
# Where the values of a label come from. A seed is what a person measured by eye; all else was computed from it, from
# meshes and from lamps, which were fitted; the renderer's are exact of a synthetic picture.
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
class Picture:
    """A photo or twin: its domain (`real`, `analog`, or a reflectance model), key, file and size."""

    domain: str
    key: PhotoKey
    path: Path
    width: int
    height: int
    sha256: str = ""  # where a table of the run states it
    part: str = ""  # of `Catalogue.split`: train, val or test; empty in none of them

    @property
    def name(self) -> str:
        """The same in all forms: domain and key, without a folder or a suffix."""
        return f"{self.domain}/{self.key}"

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height


@dataclass(frozen=True)
class Terrain:
    """What is known of a terrain beside its pictures."""

    number: int
    kind: str  # of the source
    rigs: Mapping[str, LocalisedRig]  # by position
    suns: Mapping[str, np.ndarray]  # by azimuth, sandbox frame, metres
    fitted_suns: frozenset[str]  # those that photos place; the others stand where NASA surveyed them
    meshes: Mapping[int, Path]  # by rock, the ground is NO_ROCK
    made_from: Mapping[str, str]  # of each mesh file
    rocks: pd.DataFrame | None  # `schemas.ROCKS`
    maps: Mapping[str, tuple[Path, ...]]  # renders/maps: depth, normals, photometric angles by name

    @property
    def name(self) -> str:
        return f"Terrain{self.number:02d}"

    def sun_origin(self, azimuth: str) -> Origin:
        return "fitted" if azimuth in self.fitted_suns else MEASURED[self.kind]

    def pose_origin(self, position: str) -> Origin:
        """A pose that nothing but the survey gives was measured; all others were fitted."""
        return MEASURED[self.kind] if self.rigs[position].method == SURVEYED else "fitted"


@dataclass(frozen=True)
class Catalogue:
    """Everything of a run that leaves it."""

    run: Path
    kind: str  # of the source: analog, polar or release
    terrains: Mapping[int, Terrain]
    pictures: tuple[Picture, ...]  # in the order of domains and keys
    drives: tuple[Path, ...] = ()  # folders
    tables: tuple[Path, ...] = ()
    split: str = ""  # name of the split whose parts pictures have; empty where the run drew none
    config: str = ""  # hash of the run's configuration
    made_on: str = ""  # the day (UTC, YYYY-MM-DD) of the run's newest picture, label, pose or mesh
    left_out: tuple[str, ...] = field(default_factory=tuple)  # what is not published, in sentences

    @property
    def name(self) -> str:
        return self.run.name

    @property
    def photo_domain(self) -> str:
        return PHOTO_DOMAINS[self.kind]

    @cached_property
    def domains(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(picture.domain for picture in self.pictures))

    def of_domain(self, domain: str) -> list[Picture]:
        return [picture for picture in self.pictures if picture.domain == domain]

    def picture_origin(self, picture: Picture) -> Origin:
        """Only a real photo was measured: the analog's come out of a computer, as twins do."""
        return "measured" if picture.domain == "real" else "synthetic"

    def label_origin(self, label: Annotation) -> Origin:
        """Of its box and mask."""
        origin = LABEL_ORIGINS.get(label.source, "fitted")
        return MEASURED[self.kind] if origin == "measured" else origin

    def is_photo(self, picture: Picture) -> bool:
        return picture.domain == self.photo_domain

    def camera(self, picture: Picture) -> Camera | None:
        """Where the picture was taken; None where nobody localised its position."""
        localised = self.terrains[picture.key.terrain].rigs.get(picture.key.position)
        if localised is None:
            return None
        camera = localised.camera(picture.key.camera)
        return camera if picture.width == camera.lens.width else camera.scaled(picture.width / camera.lens.width)

    def labels(self, picture: Picture) -> list[Annotation]:
        """Rocks and shadows that the picture shows, with masks; photos have propagated ones, twins exact ones."""
        path = self.label_file(picture)
        return _coco(path, picture.size).get(picture.key, []) if path else []

    def label_file(self, picture: Picture) -> Path | None:
        """Where the labels stand; None of a run that has not come so far."""
        stage = "labels" if self.is_photo(picture) else "renders"
        path = self.run / stage / "coco" / f"Terrain{picture.key.terrain:02d}.json"
        return path if path.is_file() else None

    def sources(self, picture: Picture) -> list[Path]:
        """Files that what is made of a picture and its labels and its pose depends on."""
        files = (picture.path, self.label_file(picture), self.camera_file(picture))
        return [path for path in files if path and path.is_file()]

    def camera_file(self, picture: Picture) -> Path:
        """Where the pose of its rig stands."""
        return self.run / "cameras" / f"Terrain{picture.key.terrain:02d}" / f"Pos{picture.key.position}.json"

    def maps(self) -> list[tuple[str, Path]]:
        """Kind and file of the maps (depth, photometric angles ...) of what the pictures show."""
        keys = [one.key for one in self.pictures]
        wanted = {str(key).rpartition("_")[0] for key in keys}  # exposure brackets
        wanted |= {f"{key.terrain:02d}_{key.position}_{key.camera}" for key in keys}
        return [
            (name, path)
            for terrain in self.terrains.values()
            for name, paths in sorted(terrain.maps.items())
            for path in paths
            if name in MAPS and path.suffix == ".png" and path.stem in wanted
        ]

    def instances(self, picture: Picture) -> Path | None:
        """The exact map of ids of a twin."""
        path = Run(self.run).instances(picture.key)
        return path if not self.is_photo(picture) and path.is_file() else None

    def with_pictures(self, pictures: Iterator[Picture] | list[Picture], *notes: str) -> Catalogue:
        """The same with fewer pictures, and why."""
        kept = tuple(pictures)
        terrains = {key.terrain for key in (one.key for one in kept)}
        return replace(
            self,
            pictures=kept,
            terrains={number: one for number, one in self.terrains.items() if number in terrains},
            left_out=(*self.left_out, *notes),
        )


@lru_cache(maxsize=4)  # pictures come terrain by terrain, of at most three domains
def _coco(path: Path, size: tuple[int, int]) -> dict[PhotoKey, list[Annotation]]:
    return read_coco(path, size)


def read_catalogue(run: Path, split: str = "") -> Catalogue:
    """Read a run.

    Parameters
    ----------
    split
        Name of the split whose parts pictures have; empty: the first one of the run's configuration.

    Raises
    ------
    ConfigError
        No such run, one without labelled pictures, no such split, or several splits without a configuration.
    FormatError
        A file of it is broken.
    """
    run = Path(run)
    terrains = {number: _terrain(run, number) for number in TERRAINS if _has(run, number)}
    if not terrains:
        raise ConfigError("no run: no terrain below acquire/, was the name right and did snakemake run?", path=run)
    kind = next(iter(terrains.values())).kind
    split = _split(run, split)
    pictures = tuple(sorted(_pictures(Run(run), terrains, PHOTO_DOMAINS[kind], _parts(run, split))))
    if not pictures:
        raise ConfigError("no picture: neither photos below acquire/ nor twins below renders/", path=run)
    return Catalogue(
        run=run,
        kind=kind,
        terrains=terrains,
        pictures=pictures,
        drives=Run(run).drives,
        tables=tuple(sorted((run / "tables").glob("*.parquet"))),
        split=split,
        config=_config(run),
        made_on=_made_on(run, pictures),
    )


def _has(run: Path, number: int) -> bool:
    return (run / "acquire" / f"Terrain{number:02d}" / "inventory.json").is_file()


def _terrain(run: Path, number: int) -> Terrain:
    folder = f"Terrain{number:02d}"
    cameras, meshes, rocks = run / "cameras" / folder, run / "meshes" / folder, run / "rocks" / folder
    localised = rigs.read_all_localised(cameras)
    suns = lamps.read_suns(cameras, localised) if localised else {}
    maps = sorted(path for path in (run / "renders" / "maps" / folder).glob("*") if path.is_dir())
    return Terrain(
        number=number,
        kind=read_inventory(run / "acquire" / folder / "inventory.json").kind,
        rigs=localised,
        suns={azimuth: suns[azimuth] for azimuth in SUNS if azimuth in suns},
        fitted_suns=frozenset(lamps.read_found_suns(cameras)),
        meshes=scene.mesh_files(meshes, number) if meshes.is_dir() else {},
        made_from=scene.made_from(meshes) if meshes.is_dir() else {},
        rocks=tables.read_parquet(rocks / "rocks.parquet", ["rock"]) if (rocks / "rocks.parquet").is_file() else None,
        maps={path.name: tuple(sorted(path.iterdir())) for path in maps},
    )


def _pictures(
    run: Run, terrains: Mapping[int, Terrain], photo_domain: str, parts: Mapping[PhotoKey, str]
) -> Iterator[Picture]:
    for terrain in terrains.values():
        listed = run.folder / "acquire" / terrain.name / "photos.parquet"
        if listed.is_file():
            found = run.pictures_of(PHOTO, terrain.number)
            for row in tables.read_parquet(listed, tables.PHOTO_COLUMNS).to_dict("records"):
                key = PhotoKey.parse(row["key"])
                path = found[key]
                if not path.is_file():
                    raise FormatError(f"lists {path}, which is not there", listed)
                size = int(row["width"]), int(row["height"])
                yield Picture(photo_domain, key, path, *size, row["sha256"], parts.get(key, ""))
        for model in run.models:
            for key, path in run.pictures_of(model, terrain.number).items():
                yield Picture(model, key, path, *_size(path), "", parts.get(key, ""))


def _size(path: Path) -> tuple[int, int]:
    """Width and height as the PNG file's first bytes state them."""
    with path.open("rb") as file:
        head = file.read(24)
    if len(head) < 24 or head[1:4] != b"PNG":
        raise FormatError("no PNG file", path=path)
    width, height = struct.unpack(">II", head[16:24])
    return width, height


def _split(run: Path, wanted: str) -> str:
    """Name of the split that is wanted, else of the first one of the run's configuration, else of its only one.

    Raises
    ------
    ConfigError
        The split was not drawn, or nothing states which of several is the first.
    """
    drawn = Run(run).splits
    if wanted and wanted not in drawn:
        raise ConfigError(f"no split {wanted!r}; drawn: {', '.join(drawn) or 'none'}", path=run / "detect")
    if wanted or not drawn:
        return wanted
    if (run / CONFIG).is_file():
        first = str((Run(run).configured("detect").get("splits") or DetectOptions.model_fields["splits"].default)[0])
    else:
        first = drawn[0] if len(drawn) == 1 else ""
    if first not in drawn:
        reason = f"its first split {first!r} was not drawn" if first else f"no {CONFIG} states its first split"
        raise ConfigError(f"{reason}; name one of {', '.join(drawn)} with --split", path=run)
    return first


def _parts(run: Path, split: str) -> dict[PhotoKey, str]:
    """Part of each photo by a split; empty without one."""
    return read_split(run / "detect" / split / "split.csv") if split else {}


def _config(run: Path) -> str:
    """As the run's tables state it."""
    for path in sorted((run / "tables").glob("*.parquet")):
        table = tables.read_parquet(path)
        if "config" in table.columns and len(table):
            return str(table["config"].iloc[0])
    return ""


def _made_on(run: Path, pictures: tuple[Picture, ...]) -> str:
    """The day on which the run's newest file was written: a day of the call would give other bytes every day.

    A copy that does not keep the time stamps of files has another day; SOURCE_DATE_EPOCH states one, as reproducible
    builds do (https://reproducible-builds.org/specs/source-date-epoch/).

    Raises
    ------
    ConfigError
        SOURCE_DATE_EPOCH is no number of seconds.
    """
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    if stated:
        try:
            return datetime.fromtimestamp(int(stated), UTC).date().isoformat()
        except (ValueError, OverflowError, OSError) as error:
            raise ConfigError(f"SOURCE_DATE_EPOCH is {stated!r}, expected seconds since 1970") from error
    stages = ("labels/coco", "renders/coco", "cameras", "meshes")
    files = [path for stage in stages for path in (run / stage).rglob("*") if path.is_file()]
    newest = max(path.stat().st_mtime for path in [*files, *(one.path for one in pictures)])
    return datetime.fromtimestamp(newest, UTC).date().isoformat()


def shadow_casters(labels: list[Annotation]) -> list[int]:
    """The index in the list of the rock that casts each label; -1 of rocks, and where that rock is not seen."""
    first: dict[int, int] = {}
    for index, one in enumerate(labels):
        if one.kind == "rock" and one.rock != NO_ROCK:
            first.setdefault(one.rock, index)
    return [first.get(one.rock, -1) if one.kind == "shadow" and one.rock != NO_ROCK else -1 for one in labels]
