"""Options of the acquire stage: where the raw data come from, and which label files are the seeds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.grid import as_text
from polarsim.photo import SUNS, Azimuth, Light, PhotoKey, is_exposure
from polarsim.photo import CameraSide as Camera
from polarsim.sources.registry import SOURCES
from polarsim.user_path import UserPath

NO_SEEDS = "none"  # in the place of seed options: labels come from geometry and light alone


@dataclass(frozen=True)
class FetchLimits:
    """Limits of downloads and of archives; an archive of NASA has about 0.9 GB."""

    tries: int = 5  # each goes on from the bytes of the one before
    backoff_s: float = 2.0  # pause before the second try, doubled before each further one
    timeout_s: float = 60.0  # without a byte from the server
    max_file_mb: float = 4000.0  # of one file of an archive
    max_ratio: float = 200.0  # of a file's size to its compressed size: beyond it, an archive is a bomb


class SourceOptions(BaseModel, extra="forbid", frozen=True):
    """The section says where raw data come from."""

    kind: str = Field(
        default="analog",
        json_schema_extra={"enum": list(SOURCES)},
        description="Source of the raw data: 'analog' (generated), 'release' (published labels) or 'polar' (NASA).",
    )
    root: UserPath = Field(
        default=Path("data/analog"), description="Raw data lie in this folder; it is stated for 'release' and 'polar'."
    )
    urls: dict[str, str] = Field(
        default_factory=dict,
        description="These archives are downloaded into the root: file name -> http(s) address. A name that "
        "begins with TerrainNN is fetched for that terrain alone, every other one for all.",
    )

    @field_validator("urls")
    @classmethod
    def _archives_by_http(cls, urls: dict[str, str]) -> dict[str, str]:
        for name, url in urls.items():
            if Path(name).name != name or not name.lower().endswith(".zip") or name.startswith("."):
                raise ValueError(f"{name!r}: an archive is named like Terrain11_FreshCrater.zip")
            if not url.startswith(("http://", "https://")):
                raise ValueError(f"{name}: {url!r} is no http or https address")
        return urls

    @field_validator("kind")
    @classmethod
    def _known_kind(cls, kind: str) -> str:
        if kind not in SOURCES:
            raise ValueError(f"source {kind!r}, expected {', '.join(SOURCES)}")
        return kind

    @model_validator(mode="after")
    def _root_is_stated(self) -> SourceOptions:
        if not SOURCES[self.kind].is_generated and "root" not in self.model_fields_set:
            raise ValueError(f"the source {self.kind!r} needs a root: the folder of its data")
        return self


class SeedOptions(BaseModel, extra="forbid", frozen=True):
    """Propagation starts from these label files; no stage but scoring reads any other."""

    root: UserPath | None = Field(
        default=None,
        description="Seeds are read from this folder, in the release's layout or of label files; null: from the "
        "source's.",
    )
    light: Light = Field(
        default="off",
        description="Seeds are photos with the rover light 'on' or 'off' (quote it: YAML reads off as false).",
    )
    camera: Camera = Field(default="L", description="Seeds are photos of this camera.")
    azimuths: tuple[Azimuth, ...] = Field(
        default=SUNS, description="Seeds are photos under these Sun lamps (quote them); those that are there are used."
    )
    exposure: Literal["best"] | int = Field(
        default="best",
        description="Seeds have this exposure, ms; 'best': the file of an exposure bracket with most boxes, then "
        "the one nearest to 256 ms.",
    )

    def allow(self, key: PhotoKey) -> bool:
        """Whether a photo may be a seed's at some exposure."""
        return key.light == self.light and key.camera == self.camera and key.azimuth in self.azimuths

    @field_validator("light", "azimuths", mode="before")
    @classmethod
    def _words(cls, value: object) -> object:
        return as_text(value)

    @field_validator("exposure")
    @classmethod
    def _known_exposure(cls, value: str | int) -> str | int:
        if isinstance(value, int) and not is_exposure(value):
            raise ValueError(f"exposure {value} ms, expected 'best' or 16, 32, 64 ... 8192")
        return value


SeedChoice = SeedOptions | Literal["none"]


def describe_seeds(seeds: SeedChoice) -> str:
    """Which photos the seeds were annotated in, in a few words for tables."""
    if not isinstance(seeds, SeedOptions):
        return NO_SEEDS
    exposure = seeds.exposure if seeds.exposure == "best" else f"{seeds.exposure} ms"
    return f"{seeds.camera}, rover light {seeds.light}, azimuths {' '.join(seeds.azimuths)}, exposure {exposure}"


def seed_choice(content: object) -> SeedChoice:
    """Seed options, or `NO_SEEDS`, out of what a configuration says.

    Raises
    ------
    ValueError
        Neither of them; of options also a misspelt key or an impossible value.
    """
    if content == NO_SEEDS:
        return "none"
    if content is None or isinstance(content, str):
        raise ValueError(f"{content!r}, expected options of seeds or {NO_SEEDS!r}")
    return SeedOptions.model_validate(content)
