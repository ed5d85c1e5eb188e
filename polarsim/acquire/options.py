"""Options of the acquire stage: source of the raw data and selection of the seeds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, PositiveInt, field_validator, model_validator

from polarsim.grid import text_values
from polarsim.photo import Azimuth, Light, PhotoKey
from polarsim.photo import CameraSide as Camera
from polarsim.site import Site
from polarsim.sources.registry import SOURCES
from polarsim.user_path import UserPath

NO_SEEDS = "none"  # instead of seed options: labels are computed from geometry and light only


@dataclass(frozen=True)
class FetchLimits:
    """Limits of downloads. NASA's archives have about 0.9 GB each."""

    tries: int = 5  # maximum number of attempts; each attempt resumes the download
    backoff_s: float = 2.0  # pause before the second attempt, doubled before each further attempt
    timeout_s: float = 60.0  # maximum time without data from the server


class SourceOptions(BaseModel, extra="forbid", frozen=True):
    """Source of the raw data."""

    kind: str = Field(
        default="analog",
        json_schema_extra={"enum": list(SOURCES)},
        description="Source of the raw data: 'analog' (generated), 'release' (published labels) or 'files' (photos "
        "and scans with the file names of the site).",
    )
    root: UserPath = Field(
        default=Path("data/analog"), description="Folder of the raw data. Required for 'release' and 'files'."
    )
    scans: bool = Field(
        default=True,
        description="Read scans. False: cameras, rocks and ground are measured in stereo photos; requires photos.",
    )
    urls: dict[str, str] = Field(
        default_factory=dict,
        description="Archives to download into the root: file name -> http(s) address. TerrainNN at the start of a "
        "name limits the archive to a terrain.",
    )

    @field_validator("urls")
    @classmethod
    def _archives_by_http(cls, urls: dict[str, str]) -> dict[str, str]:
        for name, url in urls.items():
            if Path(name).name != name or not name.lower().endswith(".zip") or name.startswith("."):
                raise ValueError(
                    f"{name!r}, expected the file name of a zip archive, such as Terrain11_FreshCrater.zip"
                )
            if not url.startswith(("http://", "https://")):
                raise ValueError(f"{name}: {url!r}, expected an http or https address")
        return urls

    @field_validator("kind")
    @classmethod
    def _known_kind(cls, kind: str) -> str:
        if kind == "polar":
            raise ValueError("'polar' is now called 'files': write kind: files")
        if kind not in SOURCES:
            raise ValueError(f"source {kind!r}, expected {', '.join(SOURCES)}")
        return kind

    @model_validator(mode="after")
    def _photos_without_scans(self) -> SourceOptions:
        if not self.scans and not SOURCES[self.kind].has_photos:
            raise ValueError(f"scans: false requires stereo photos, the source {self.kind!r} has none")
        return self

    @model_validator(mode="after")
    def _root_is_stated(self) -> SourceOptions:
        if not SOURCES[self.kind].is_generated and "root" not in self.model_fields_set:
            raise ValueError(f"root is missing, expected the folder of the data of the source {self.kind!r}")
        return self


class SeedOptions(BaseModel, extra="forbid", frozen=True):
    """Selection of the label files from which propagation starts. Only scoring reads other label files."""

    root: UserPath | None = Field(
        default=None,
        description="Folder of seeds, in the layout of the release or with label files. null: folder of the source.",
    )
    light: Light = Field(
        default="off",
        description="Rover light of the seeds, 'on' or 'off'. Quote the value: YAML reads off as false.",
    )
    camera: Camera = Field(default="L", description="Camera of the seeds, L or R.")
    azimuths: tuple[Azimuth, ...] | None = Field(
        default=None,
        description="Azimuths of the Sun lamps of the seeds, quoted. Missing label files are allowed. null: all lamps.",
    )
    exposure: Literal["best"] | PositiveInt = Field(
        default="best",
        description="Exposure of the seeds, ms, or 'best': most boxes, then nearest to the usual exposure.",
    )

    def allow(self, key: PhotoKey) -> bool:
        """Return whether a photo may be a seed, regardless of the exposure."""
        lamp = key.has_sun if self.azimuths is None else key.azimuth in self.azimuths
        return lamp and key.light == self.light and key.camera == self.camera

    def wrong_values(self, site: Site) -> Iterator[str]:
        """Return messages about selected values that the site does not have."""
        return site.wrong_choices(
            (
                ("light", [self.light], site.lights),
                ("camera", [self.camera], site.cameras.sides),
                ("azimuths", self.azimuths or (), site.azimuths),
                ("exposure", [self.exposure], (*site.all_exposures_ms, "best")),
            )
        )

    @field_validator("light", "azimuths", mode="before")
    @classmethod
    def _words(cls, value: object) -> object:
        return text_values(value)


SeedChoice = SeedOptions | Literal["none"]


def describe_seeds(seeds: SeedChoice) -> str:
    """Return the selection of the seeds as a text for tables."""
    if not isinstance(seeds, SeedOptions):
        return NO_SEEDS
    exposure = seeds.exposure if seeds.exposure == "best" else f"{seeds.exposure} ms"
    azimuths = " ".join(seeds.azimuths or ["all"])
    return f"{seeds.camera}, rover light {seeds.light}, azimuths {azimuths}, exposure {exposure}"


def seed_choice(content: object) -> SeedChoice:
    """Parse seed options, or `NO_SEEDS`, from a configuration."""
    if content == NO_SEEDS:
        return "none"
    if content is None or isinstance(content, str):
        raise ValueError(f"{content!r}, expected options of seeds or {NO_SEEDS!r}")
    return SeedOptions.model_validate(content)
