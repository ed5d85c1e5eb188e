"""Configuration of a run: all keys with their units, and their validation."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, Field, ValidationError, field_validator, model_validator

from polarsim.acquire.options import NO_SEEDS, SeedChoice, SeedOptions, SourceOptions, seed_choice
from polarsim.analog.options import AnalogOptions
from polarsim.cameras.options import CamerasOptions
from polarsim.cover_photos.options import CoversOptions
from polarsim.detect.gap_options import GapOptions
from polarsim.detect.options import VIEWS, DetectOptions, PredictionOptions
from polarsim.errors import ConfigError, LabelError, with_path
from polarsim.formats.yaml_files import describe_error, parse_yaml, read_yaml
from polarsim.grid import GridOptions
from polarsim.labels.options import LabelsOptions
from polarsim.photo import NO_SUN, PhotoKey, Terrain, terrain_text
from polarsim.publish.options import PublishOptions
from polarsim.randomness import without_negative_zeros
from polarsim.render.models import FITTED, Domain, model_of
from polarsim.render.options import Model, RenderOptions
from polarsim.rocks.options import RocksOptions
from polarsim.rover.cameras.options import PACKAGED_FILES
from polarsim.rover.options import RoverOptions
from polarsim.rover.perception.options import FINE_TUNED, OnboardDetector
from polarsim.scoring.options import ScoringOptions
from polarsim.site import DEFAULT, Site, SiteChoice, polar, site_of
from polarsim.site_parts import TerrainName
from polarsim.sources.registry import SOURCES
from polarsim.sources.source import DataSource

RELEASE_ROOT = "POLAR_SIM_ROOT"  # environment variable that names a local copy of the release

_FOLDERS = {"corrections", "views"}  # options that name a folder of data


class LabelsSection(LabelsOptions):
    """Options of the labels stage, and the selection of seed labels."""

    seeds: SeedChoice = Field(
        SeedOptions(),
        description="Selection of the annotated label files to propagate; 'none': rocks and shadows are labelled from "
        "scans, light and photos only.",
    )

    @field_validator("seeds", mode="before")
    @classmethod
    def _options_or_none(cls, value: object) -> SeedChoice:
        return seed_choice(value)

    def stage_options(self) -> dict[str, Any]:
        """Return the options of the labels stage, without the seeds, which the acquire stage selects."""
        return self.model_dump(mode="json", exclude={"seeds"})


class Config(BaseModel, extra="forbid", frozen=True):
    """Configuration of one run."""

    run: str = Field(
        "demo",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$",
        description="Name of the run. Results are written to results/<run>/.",
    )
    site: SiteChoice = Field(
        default_factory=polar,
        description="Sandbox or test yard: the name of a site that polarsim ships, the path of a site file, or the "
        "content of such a file.",
    )
    terrains: tuple[TerrainName, ...] = Field(
        (1, 3, 6, 11), min_length=1, description="Terrains to process, of the site. Default of other sites: all."
    )
    positions: tuple[str, ...] = Field(
        ("A", "B", "C"), min_length=1, description="Positions whose photos are processed. Default: those of the site."
    )
    source: SourceOptions = Field(description="Source of the raw data.")
    grid: GridOptions = Field(GridOptions(), description="Part of the photo grid to process.")
    analog: AnalogOptions = Field(AnalogOptions(), description="Simulated sandbox, generated with source.kind analog.")
    cameras: CamerasOptions = Field(CamerasOptions(), description="Localisation and refinement of the stereo rigs.")
    rocks: RocksOptions = Field(RocksOptions(), description="Segmentation of scans into rocks and ground, and meshing.")
    labels: LabelsSection = Field(LabelsSection(), description="Propagation of seed labels to every photo.")
    render: RenderOptions = Field(RenderOptions(), description="Rendering of a twin of every photo.")
    detect: DetectOptions = Field(DetectOptions(), description="Training and comparison of detectors.")
    gap: GapOptions = Field(
        GapOptions(),
        description="Components of the twin that are replaced one by one to measure their contribution to the gap.",
    )
    covers: CoversOptions = Field(
        CoversOptions(),
        description="Detectors that are trained on randomised scenes and tested on real cover photos.",
    )
    rover: RoverOptions = Field(RoverOptions(), description="Rover drives over the digitised terrains.")
    scoring: ScoringOptions = Field(ScoringOptions(), description="Scoring of the results.")
    publish: PublishOptions = Field(PublishOptions(), description="Formats in which the run is published.")

    @model_validator(mode="before")
    @classmethod
    def _with_site(cls, content: Any) -> Any:
        """Read the site, and select all that it has where the configuration selects nothing."""
        if not isinstance(content, dict):
            return content
        try:
            site = Site.model_validate(site_of(content.get("site", DEFAULT)))
        except ValidationError as error:
            text = describe_error(error, "site")
            raise ValueError(text if text.startswith("site:") else f"site.{text}") from error
        whole = {"positions": site.positions, **content, "site": site}
        if site != polar():
            whole = {"terrains": tuple(site.terrains), **whole}
        chosen = {"lights": site.lights, "azimuths": site.azimuths, "cameras": site.cameras.sides}
        whole["grid"] = _with_defaults(content.get("grid"), chosen)
        labels = content.get("labels", {})
        if isinstance(labels, dict) and isinstance(seeds := labels.get("seeds", {}), dict):
            whole["labels"] = {**labels, "seeds": _with_defaults(seeds, {"azimuths": site.suns})}
        if isinstance(render := content.get("render", {}), dict):
            held_out = site.suns[0] if len(site.suns) > 1 else NO_SUN
            whole["render"] = {**render, "fitting": _with_defaults(render.get("fitting"), {"held_out": held_out})}
        return whole

    @field_validator("terrains")
    @classmethod
    def _each_once(cls, values: tuple[Terrain, ...]) -> tuple[Terrain, ...]:
        if len(set(values)) < len(values):
            raise ValueError("a terrain is listed twice")
        return values

    @model_validator(mode="after")
    def _of_site(self) -> Config:
        if wrong := next(self._names_not_of_site(), None):
            raise ValueError(wrong)
        return self

    def _names_not_of_site(self) -> Iterator[str]:
        """Yield a message for each name that the site does not have."""
        site = self.site
        for number, terrain in enumerate(self.terrains):
            if terrain not in site.terrains:
                yield f"terrains.{number}: terrain {terrain}, expected {site.terrains_text}"
        for position in self.positions:
            if position not in site.all_positions:
                yield f"positions: position {position!r}, expected {', '.join(site.all_positions)}"
        for terrain in self.terrains:
            if not set(self.positions) & set(site.positions_of(terrain)):
                known = " or ".join(self.positions)
                yield f"positions: terrain {terrain_text(terrain)} has no position {known}"
        yield from (f"grid.{wrong}" for wrong in self.grid.wrong_values(site))
        if isinstance(seeds := self.labels.seeds, SeedOptions):
            yield from (f"labels.seeds.{wrong}" for wrong in seeds.wrong_values(site))
        for key in self.labels.excluded_annotations:
            try:
                site.key(key)
            except LabelError as error:
                yield f"labels.excluded_annotations: {error}"
        for terrain in self.labels.min_shadow_exposure_ms_by_terrain:
            if terrain not in site.terrains:
                yield f"labels.min_shadow_exposure_ms_by_terrain.{terrain}: expected terrain {site.terrains_text}"

    @model_validator(mode="after")
    def _scans_without_seeds(self) -> Config:
        if self.labels.seeds == NO_SEEDS and not self.data_source.has_scans:
            raise ValueError(
                f"labels.seeds: {NO_SEEDS} requires scans for the localisation of cameras; source "
                f"{self.source.kind!r} has no scans"
            )
        if self.labels.seeds == NO_SEEDS and not self.has_scans:
            raise ValueError(
                f"labels.seeds: {NO_SEEDS} requires scans for the detection of rocks, expected source.scans: true and "
                "files.clouds or files.range_maps of the site"
            )
        return self

    @model_validator(mode="after")
    def _rover_on_terrains(self) -> Config:
        if not self.rover.run:
            return self
        for terrain in self.rover.world.terrains:
            if terrain not in self.terrains:
                raise ValueError(f"rover.world.terrains: {terrain}, expected terrains of the run {self.terrains}")
        if self.rover.detector is not None and self.rover.detector not in self.training_domains:
            known = ", ".join(self.training_domains) or "none: no detector is trained"
            raise ValueError(f"rover.detector: domain {self.rover.detector!r}, expected {known}")
        tuned = [FINE_TUNED] if self.rover.fine_tuning.drives else []
        known_detectors = [*PACKAGED_FILES, *tuned, *self.training_domains]
        if unknown := sorted(set(self.rover.autonomy.detectors) - set(known_detectors)):
            known = ", ".join(known_detectors)
            raise ValueError(f"rover.autonomy.detectors: {unknown[0]!r}, expected {known}")
        return self

    @model_validator(mode="after")
    def _terrains_of_folds(self) -> Config:
        if not self.covers.run:
            return self
        for fold in self.cover_folds:
            if unknown := sorted(set(fold) - set(self.terrains)):
                raise ValueError(f"covers.folds: {unknown[0]}, expected terrains of the run {self.terrains}")
            if not set(self.terrains) - set(fold):
                raise ValueError(f"covers.folds: {fold} contains all terrains, no terrain remains for training")
        for key in self.covers.keys:
            if PhotoKey.parse(key).terrain not in self.terrains:
                raise ValueError(f"covers.keys: {key}, expected terrains of the run {self.terrains}")
        return self

    @model_validator(mode="after")
    def _domains_of_mixes(self) -> Config:
        if not self.detect.run:
            return self
        single = {*self.domains, *([VIEWS] if self.detect.views else [])}
        for name, weights in self.detect.mixes.items():
            if name in single | {VIEWS}:
                raise ValueError(f"detect.mixes: {name} is the name of a domain, expected another name")
            if unknown := sorted(set(weights) - single):
                raise ValueError(f"detect.mixes.{name}: domain {unknown[0]!r}, expected {', '.join(sorted(single))}")
        return self

    @model_validator(mode="after")
    def _domains_of_others(self) -> Config:
        for name, other in self.detect.others.items() if self.domains else ():
            if unknown := sorted(set(other.trained_on) - set(self.training_domains)):
                known = ", ".join(self.training_domains)
                raise ValueError(f"detect.others.{name}.trained_on: {unknown[0]!r}, expected {known}")
        return self

    @model_validator(mode="after")
    def _possible_components(self) -> Config:
        if not self.gap.components:
            return self
        if not self.domains:
            raise ValueError("gap.components: the run has no twins to compare with photos")
        for name, component in self.gap.components.items():
            if component.needs_truth and not self.data_source.is_generated:
                raise ValueError(f"gap.components.{name}: the source {self.source.kind!r} has no ground truth")
            as_run = component.materials == "run" and self.render.materials_from_photos
            if (as_run or component.materials == "fitted") and component.meshes != "run":
                raise ValueError(f"gap.components.{name}: fitted materials require the meshes of the run (meshes: run)")
            try:
                self.render_options_of(name)
            except ValidationError as error:
                raise ValueError(f"gap.components.{name}.render.{describe_error(error, 'render')}") from error
        return self

    def render_options_of(self, component: str) -> RenderOptions:
        """Return the render options of the run with the changes of a component of the ablation."""
        changed, materials = self.gap.components[component].render, self.gap.components[component].materials
        fixed: dict[str, Any] = {"models": (self.ablation_model,), "maps": ()}
        fixed |= {"materials_from_photos": True} if materials == "fitted" else {}
        return RenderOptions.model_validate(self.render.model_dump(exclude_unset=True) | changed | fixed)

    @property
    def annotated_root(self) -> Path:
        """Folder of the annotated labels for scoring; default: the folder of the seeds, else of the source."""
        seeds = self.labels.seeds
        own = seeds.root if isinstance(seeds, SeedOptions) else None
        return self.scoring.annotated_root or own or self.source.root

    @property
    def ablation_model(self) -> Model:
        """Reflectance model of the ablation: the last model whose twins are compared."""
        return (self.compared_models or (model_of(FITTED),))[-1]

    @property
    def compared_models(self) -> tuple[Model, ...]:
        """Reflectance models on whose twins detectors are trained. Fitted twins show how well a twin can match."""
        return tuple(model_of(domain) for domain in self.render.models if domain != FITTED)

    @property
    def domains_to_fit(self) -> tuple[Domain, ...]:
        """Domains of twins whose light and materials are fitted to photos, with the ablation's."""
        of_ablation = any(component.materials == "fitted" for component in self.gap.components.values())
        return tuple(dict.fromkeys([*self.render.fitted_domains, *([self.ablation_model] if of_ablation else [])]))

    @property
    def ablation_detectors(self) -> tuple[str, ...]:
        """Training domains of the detectors that the ablation evaluates."""
        return self.photo_domain, self.ablation_model

    @property
    def data_source(self) -> DataSource:
        """The source of the raw data."""
        return SOURCES[self.source.kind]

    @property
    def has_scans(self) -> bool:
        """Whether scans are read: the source has scans, and `source.scans` and `files` of the site select them."""
        files = self.site.files
        return self.data_source.has_scans and self.source.scans and bool(files.clouds or files.range_maps)

    @property
    def measures_ranges(self) -> bool:
        """Whether ranges are measured in stereo photos, because scans are not read. A single camera cannot."""
        return self.data_source.has_scans and not self.has_scans and self.site.cameras.stereo

    @property
    def has_ranges(self) -> bool:
        """Whether scans, stereo photos or published meshes show the shape of the terrain."""
        return self.has_scans or self.measures_ranges or not self.data_source.has_scans

    @property
    def photo_domain(self) -> str:
        """Domain of the photos of this run."""
        return self.data_source.domain

    @property
    def domains(self) -> tuple[str, ...]:
        """Domains of the comparison of detectors; empty without photos or detectors."""
        compared = self.detect.run and self.data_source.has_photos
        return (self.photo_domain, *self.compared_models) if compared else ()

    @property
    def training_domains(self) -> tuple[str, ...]:
        """Training domains of detectors: the domains of the comparison, novel views and mixes."""
        views = [VIEWS] if self.domains and self.detect.views else []
        return (*self.domains, *views, *(self.detect.mixes if self.domains else ()))

    def detector_before_drives(self, run: Path) -> OnboardDetector | None:
        """Return the detector on board before `rover.fine_tuning`; None without a detector.

        A detector of the run uses the options of `detect.prediction`; other detectors use the defaults and its device.
        """
        if self.rover.detector is not None:
            return self._own_detector(run, self.rover.detector, self.detect.seeds[0])
        weights = self.rover.cameras.onboard.weights_file
        return None if weights is None else self._other_detector(weights)

    def detector_on_board(self, run: Path) -> OnboardDetector | None:
        """Return the detector on board, after `rover.fine_tuning` if configured; None without a detector."""
        before = self.detector_before_drives(run)
        if before is None or not self.rover.fine_tuning.drives:
            return before
        return before.model_copy(update={"weights": run / f"rover/{FINE_TUNED}.pt"})

    def deciding_detectors(self, run: Path) -> dict[str, OnboardDetector | None]:
        """Return the detectors of autonomous drives by name; default: the detector on board.

        Names are those of packaged detectors, `<domain>-seed<N>` of a run, and `fine_tuned`.
        """
        names, weights, seeds = self.rover.autonomy.detectors, self.rover.cameras.onboard.weights, self.detect.seeds
        on_board = self.detector_on_board(run)
        if not names and self.rover.fine_tuning.drives and on_board:
            names = (FINE_TUNED,)
        elif not names and self.rover.detector is not None:
            names, seeds = (self.rover.detector,), seeds[:1]
        found: dict[str, OnboardDetector | None] = {}
        for name in names:
            if name in PACKAGED_FILES:
                found[name] = self._other_detector(PACKAGED_FILES[name])
            elif name == FINE_TUNED:
                found[name] = on_board
            else:
                found |= {f"{name}-seed{seed}": self._own_detector(run, name, seed) for seed in seeds}
        single = weights.stem if isinstance(weights, Path) else weights or "none"
        return found or {single: on_board}

    def _own_detector(self, run: Path, domain: str, seed: int) -> OnboardDetector:
        weights = run / f"detect/{self.detect.splits[0]}/seed{seed}/detectors/{domain}.pt"
        return OnboardDetector(weights=weights, prediction=self.detect.prediction)

    def _other_detector(self, weights: Path) -> OnboardDetector:
        own = self.detect.prediction
        return OnboardDetector(
            weights=weights, prediction=PredictionOptions(device=own.device, precision=own.precision)
        )

    @property
    def cover_folds(self) -> tuple[tuple[Terrain, ...], ...]:
        """Test terrains of each fold of cover photos; default: one fold per terrain."""
        return self.covers.folds or tuple((terrain,) for terrain in self.terrains)

    def digest(self) -> str:
        """Return a digest of all options that can change a result, for tables.

        The digest does not depend on the name of the run, on folders and downloads of data, or on unused sections.
        """
        content = self.model_dump(exclude=self._without_effect())
        if self.domains_to_fit and self.render.set_to_default:
            content["set_to_default"] = self.render.set_to_default
        text = json.dumps(_without_places(content), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]

    def _without_effect(self) -> dict[str, Any]:
        """Return the options that change no result of this run, in the form of pydantic's `exclude`."""
        unused = {
            "analog": not self.data_source.is_generated,
            "detect": not (self.domains or self.covers.run or self.rover.run),
            "gap": not self.gap.components,
            "covers": not self.covers.run,
            "rover": not self.rover.run,
        }
        parts: dict[str, Any] = {
            "source": {"root", "urls"},
            "labels": {"seeds": {"root"}} if isinstance(self.labels.seeds, SeedOptions) else set(),
            "scoring": {"annotated_root"},
            "detect": {"elsewhere"},
            "covers": {"publish"},
            "rover": {"bags": True, "cameras": {"videos"}},
        }
        unused["site"] = self.site == polar()
        return {"run": True, "publish": True, **parts, **{name: True for name, without in unused.items() if without}}


def _with_defaults(section: Any, values: Mapping[str, Any]) -> Any:
    """Return a section of a configuration with values for keys that it does not set; other content is returned."""
    if section is None:
        return dict(values)
    if not isinstance(section, dict):
        return section
    missing = {name: value for name, value in values.items() if section.get(name) is None}
    return {**section, **missing}


def _without_places(value: Any, key: str = "") -> Any:
    """Return options as JSON values in which a file is replaced by its name and a folder by `given`."""
    if isinstance(value, Mapping):
        return {name: _without_places(part, name) for name, part in value.items()}
    if isinstance(value, list | tuple):
        return [_without_places(part, key) for part in value]
    if isinstance(value, Path):
        return "given" if key in _FOLDERS else value.name
    # The default may be an integer and the file contain a float; -0.0 equals 0.0.
    return float(value) + 0.0 if isinstance(value, int | float) and not isinstance(value, bool) else value


def parse_config(content: Mapping[str, Any]) -> Config:
    """Check a configuration."""
    if endless := [f"{key}: should be a finite number, found {value}" for key, value in _not_finite(content, "")]:
        raise ConfigError("; ".join(endless))
    try:
        return Config.model_validate(_with_release_root(without_negative_zeros(dict(content))))
    except ValidationError as error:
        raise ConfigError(describe_error(error, "configuration")) from error


def read_config(path: str | Path) -> Config:
    """Read a configuration file."""
    content = read_yaml(path)
    if not isinstance(content, Mapping):
        raise ConfigError("no keys, expected a configuration", path=path)
    with with_path(path):
        return parse_config(content)


def render_options(assignments: Sequence[str]) -> RenderOptions:
    """Return render options from `key=value`, such as `materials.default.principled.roughness=0.5`.

    Values are YAML, for example `gain={hapke: 150}`. Later assignments override earlier ones.
    """
    content: dict[str, Any] = {}
    for assignment in assignments:
        key, value = parse_assignment(assignment)
        *sections, last = key.split(".")
        part = content
        for section in sections:
            inner = part.get(section)
            part[section] = part = dict(inner) if isinstance(inner, dict) else {}
        part[last] = value
    try:
        return RenderOptions.model_validate(content)
    except ValidationError as error:
        raise ConfigError(describe_error(error, "options")) from error


def parse_assignment(assignment: str) -> tuple[str, Any]:
    """Return key and value of `KEY=VALUE` with the value in YAML."""
    key, equals, text = assignment.partition("=")
    if not key or not equals:
        raise ConfigError(f"{assignment!r}: expected KEY=VALUE")
    try:
        return key, parse_yaml(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"{key}: {text!r} is not a YAML value") from error


def config_schema() -> str:
    """Return the JSON schema of the configuration; editors use the copy in `config/schema.json`."""
    return json.dumps(Config.model_json_schema(), indent=1, sort_keys=True) + "\n"


def _not_finite(content: Any, key: str) -> Iterator[tuple[str, float]]:
    """Yield key and value of every infinite or NaN number."""
    if isinstance(content, float) and not math.isfinite(content):
        yield key, content
    elif isinstance(content, Mapping):
        for name, inner in content.items():
            yield from _not_finite(inner, f"{key}.{name}".removeprefix("."))
    elif isinstance(content, (list, tuple)):
        for number, inner in enumerate(content):
            yield from _not_finite(inner, f"{key}.{number}")


def _with_release_root(content: dict[str, Any]) -> dict[str, Any]:
    source = content.get("source")
    root = os.environ.get(RELEASE_ROOT)
    if root and isinstance(source, Mapping) and source.get("kind") == "release":
        return {**content, "source": {**source, "root": root}}
    return content
