"""All keys of the configuration of a run with their units, and values derived from several keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, field_validator

from polarsim.acquire.options import SeedChoice, SeedOptions, SourceOptions, seed_choice
from polarsim.analog.options import AnalogOptions
from polarsim.cameras.options import CamerasOptions
from polarsim.cover_photos.options import CoversOptions
from polarsim.detect.gap_options import GapOptions
from polarsim.detect.options import VIEWS, DetectOptions, PredictionOptions
from polarsim.grid import GridOptions
from polarsim.labels.options import LabelsOptions
from polarsim.photo import Terrain, terrain_text
from polarsim.publish.options import PublishOptions
from polarsim.render.models import FITTED, Domain, model_of
from polarsim.render.options import Model, RenderOptions
from polarsim.rocks.options import RocksOptions
from polarsim.rover.cameras.options import PACKAGED_FILES
from polarsim.rover.options import RoverOptions
from polarsim.rover.perception.options import FINE_TUNED, OnboardDetector
from polarsim.scoring.options import ScoringOptions
from polarsim.site import SiteChoice, polar
from polarsim.site_parts import TerrainName
from polarsim.sources.registry import SOURCES
from polarsim.sources.source import DataSource
from polarsim.wording import alternatives


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


class Sections(BaseModel, extra="forbid", frozen=True):
    """Keys and sections of a configuration, and values that are derived from several keys."""

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
    def terrains_text(self) -> str:
        """The terrains of the run, for messages."""
        return f"{alternatives(map(terrain_text, self.terrains))} (terrains of the run)"

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
    def closed_meshes(self) -> str:
        """Folder of the run with closed rocks: repaired copies of published meshes, which have holes."""
        return "meshes" if self.data_source.has_scans else "repaired"

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
