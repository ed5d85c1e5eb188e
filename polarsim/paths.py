"""Paths and options of jobs that depend on the configuration and on wildcards.

Rule files contain literal paths where possible. Other paths are computed by methods of these classes. Snakemake calls a
method with the argument `wildcards` for each job. Paths of a method without `wildcards` may contain wildcards such as
`{run}`.

- `RunPaths`: terrains, raw data, labels, detectors, tables and figures
- `GapPaths`: the ablation
- `CoverPaths`: cover photos and randomised scenes
- `RoverPaths`: drives of the rover
"""

from __future__ import annotations

import hashlib
import operator
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import describe_seeds
from polarsim.config import Config
from polarsim.cover_photos.options import CARVED
from polarsim.detect.options import PACKAGED, VIEWS, DetectorOptions, PredictionOptions
from polarsim.errors import ConfigError
from polarsim.formats.files import resolve_packaged
from polarsim.formats.release import (
    COVERS,
    cover_photos,
    label_files,
    label_folder,
    polygon_folder,
    released_meshes,
)
from polarsim.photo import Terrain, parse_terrain, terrain_text
from polarsim.rover.cameras.options import rover_render
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.planning.cases import cases
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.schemas.covers import CONTROL, FINE_TUNED, RENDERED

TABLES_OF_DETECTORS = ("detection", "differences", "detection_breakdown", "false_positives", "ipd")

Options = dict[str, Any]  # values for `params` of a rule, as of JSON


class Wildcards(Protocol):
    """Values of the wildcards of a job."""

    def __getattr__(self, name: str) -> str:
        """Return the value of a wildcard."""
        ...


def memory_per_attempt(mem_mb: int) -> Callable[[Wildcards, int], int]:
    """Return the memory of a job, MB: doubled at each further attempt (`--retries`)."""

    def of_attempt(wildcards: Wildcards, attempt: int) -> int:  # noqa: ARG001
        return int(mem_mb * 2 ** (attempt - 1))

    return of_attempt


class RunPaths:
    """Paths of a run."""

    fitted_materials = "results/{run}/renders/materials/Terrain{terrain}"
    fitted_light = "results/{run}/renders/light/Terrain{terrain}.json"

    def __init__(self, config: Config, placed: Callable[[str], str] = str) -> None:
        """Define the paths of a run.

        Parameters
        ----------
        placed
            Returns the place of a path below `results/`, which a module may have below a `prefix`. Snakemake places
            inputs and outputs itself, but not paths in `params`.
        """
        self.config, self.placed = config, placed
        self.run = config.run
        self.terrains = [terrain_text(terrain) for terrain in config.terrains]
        self.site: Options = config.site.model_dump(mode="json")
        self.domains = list(config.domains)
        self.trained = list(config.training_domains)
        self.splits, self.seeds = list(config.detect.splits), list(config.detect.seeds)
        self.others = config.detect.others if self.domains else {}
        self.models: list[str] = list(config.render.models)
        self.origin = {"run": self.run, "source": config.source.kind, "config": config.digest()}
        self.has_stereo = config.detect.stereo.run and bool(self.domains) and config.site.cameras.stereo
        self.only_covers = config.covers.run and not self.domains  # such a run has no other stage
        self.has_errata = not config.data_source.has_scans  # defects of published labels and meshes
        self.seeds_text = describe_seeds(config.labels.seeds)
        self.scored_terrains = [terrain for terrain in self.terrains if self._can_score_labels(terrain)]

    def options(self, section: str) -> Options:
        """Return a section of the configuration, such as `detect.split`, for `params`.

        Options of `render` that the run does not set are omitted: their values differ between plain and fitted twins.
        """
        if section == "labels":
            return self.config.labels.stage_options()
        chosen = operator.attrgetter(section)(self.config)
        found: Options = chosen.model_dump(mode="json", exclude_unset=section == "render")
        return found

    def gpus(self, section: str) -> int:
        """Return the number of GPUs of a job: 1 if a section of the configuration names a device other than the CPU."""
        return int(operator.attrgetter(section)(self.config).device not in ("auto", "cpu"))

    # Raw data, per terrain

    def positions(self, wildcards: Wildcards) -> list[str]:
        """Return the positions of the run that a terrain has."""
        return self._positions(parse_terrain(wildcards.terrain))

    @property
    def positions_to_draw(self) -> list[tuple[list[str], list[str]]]:
        """Two lists of positions, each with the terrains that have these positions; the second is often empty."""
        found: dict[tuple[str, ...], list[str]] = {}
        for terrain in self.config.terrains:
            found.setdefault(tuple(self._positions(terrain)), []).append(terrain_text(terrain))
        if len(found) > 2:
            others = ", ".join(next(iter(terrains)) for terrains in found.values())
            raise ConfigError(
                f"positions: {len(found)} different lists of positions (terrains {others}), expected at most two in a "
                "run: process the other terrains in a run of their own"
            )
        listed = [(list(names), terrains) for names, terrains in found.items()]
        return [*listed, ([self.config.positions[0]], [])][:2]

    def raw_data(self, wildcards: Wildcards) -> list[str]:
        """Return the receipt of a generated or fetched terrain, or the files of a local one."""
        config = self.config
        terrain = parse_terrain(wildcards.terrain)
        return [str(path) for path in raw_inputs(config.site, terrain, config.source, config.labels.seeds)]

    def raw_data_of_run(self, wildcards: Wildcards) -> list[str]:  # noqa: ARG002
        """Return the raw data of all terrains."""
        config = self.config
        site, source, seeds = config.site, config.source, config.labels.seeds
        return [str(path) for terrain in config.terrains for path in raw_inputs(site, terrain, source, seeds)]

    @property
    def photos_of_terrain(self) -> str | list[str]:
        """The index of a terrain's photos; empty for a source without photos."""
        has_photos = self.config.data_source.has_photos
        return "results/{run}/acquire/Terrain{terrain}/photos.parquet" if has_photos else []

    @property
    def photos_of_ground(self) -> str:
        """The photos that refine the ground: a terrain's own photos, else the published cover photos."""
        has_photos = self.config.data_source.has_photos
        return "results/{run}/acquire/Terrain{terrain}/photos.parquet" if has_photos else "results/{run}/covers/photos"

    @property
    def measures_ranges(self) -> bool:
        """Whether range maps are measured in stereo photos, because scans are not read."""
        return self.config.measures_ranges

    @property
    def inventory_of_ranges(self) -> str:
        """The inventory of a terrain's range maps: scanned, or measured in photos."""
        folder = "cameras/ranges" if self.measures_ranges else "acquire"
        return f"results/{{run}}/{folder}/Terrain{{terrain}}/inventory.json"

    @property
    def calibration_of_rig(self) -> str:
        """The stereo calibration of a terrain: as stated, or corrected by photos."""
        return self.inventory_of_ranges.replace("inventory.json", "calibration.json")

    @property
    def range_maps(self) -> str | list[str]:
        """The folder of a terrain's range maps from photos; empty with scans."""
        return "results/{run}/cameras/ranges/Terrain{terrain}/maps" if self.measures_ranges else []

    @property
    def unrefined_meshes(self) -> str:
        """The folder of a terrain's meshes before the ground is refined by photos: the final folder if it is not."""
        refined = self.config.rocks.ground_from_photos
        return "results/{run}/rocks/Terrain{terrain}/meshes" if refined else "results/{run}/meshes/Terrain{terrain}"

    def override_file(self, wildcards: Wildcards) -> str | list[str]:
        """Return the file of a terrain's cuboids that a person entered, if it exists."""
        path = Path(f"config/rocks/terrain{wildcards.terrain}.yaml")
        return str(path if self.placed(str(path)) == str(path) else path.absolute()) if path.exists() else []

    def corrections(self, wildcards: Wildcards) -> list[str]:
        """Return the corrected label files of a terrain, so that an edit is a changed input."""
        folder = self.config.labels.corrections
        if folder is None:
            return []
        return sorted(str(path) for path in (*folder.rglob(f"{wildcards.terrain}_*.txt"), *folder.rglob("*.json")))

    def truth(self, wildcards: Wildcards) -> str | None:
        """Return the folder of a terrain's ground truth; None without ground truth."""
        found = self.config.data_source.truth(self.config.source.root, parse_terrain(wildcards.terrain))
        return str(found) if found else None

    def true_labels(self, wildcards: Wildcards) -> str | None:
        """Return the true boxes of a terrain, else the folder of annotated ones, else None."""
        truth = self.truth(wildcards)
        return f"{truth}/labels.parquet" if truth else self.annotated_labels(wildcards)

    def annotated_labels(self, wildcards: Wildcards) -> str | None:
        """Return the folder of a terrain's annotated boxes; None without it."""
        return self._annotated(label_folder, parse_terrain(wildcards.terrain))

    def annotated_polygons(self, wildcards: Wildcards) -> str | list[str]:
        """Return the folder of a terrain's annotated polygons, if it exists."""
        return self._annotated(polygon_folder, parse_terrain(wildcards.terrain)) or []

    def annotated_polygons_of_covers(self) -> list[str]:
        """Return the folders of annotated polygons of terrains with cover photos; empty if detectors have no masks."""
        if not self.config.detect.training.masks:
            return []
        terrains = [terrain for terrain in self.config.terrains if cover_photos(self.config.annotated_root, terrain)]
        return [folder for terrain in terrains if (folder := self._annotated(polygon_folder, terrain))]

    @property
    def materials_of_terrain(self) -> str | list[str]:
        """The fitted materials of a terrain; empty if no twins are fitted or the source has no photos."""
        return self.fitted_materials if self._has_fit else []

    @property
    def light_of_terrain(self) -> str | list[str]:
        """The light fields of the lamps of a terrain; empty if no twins are fitted or no photos exist."""
        return self.fitted_light if self.config.render.fitted_domains and self.photos_for_light else []

    @property
    def photo_tables(self) -> list[str]:
        """The tables of photos of all terrains; empty tables for a source without photos."""
        return [f"results/{{run}}/acquire/Terrain{terrain}/photos.parquet" for terrain in self.terrains]

    @property
    def photos_for_light(self) -> list[str]:
        """The photos of the run that show its lamps: own photos, else published cover photos."""
        if self.config.data_source.has_photos:
            return self.photo_tables
        root = self.config.annotated_root
        has_covers = any(cover_photos(root, terrain) for terrain in self.config.terrains)
        return ["results/{run}/covers/photos"] if has_covers else []

    @property
    def _has_fit(self) -> bool:
        return bool(self.config.render.fitted_domains) and self.config.data_source.has_photos

    def twins_of_another_terrain(self, wildcards: Wildcards) -> list[str]:
        """Return the twins of the next terrain of the run with every model; empty for a single terrain."""
        if len(self.terrains) < 2:
            return []
        other = self.terrains[(self.terrains.index(wildcards.terrain) + 1) % len(self.terrains)]
        return [f"results/{wildcards.run}/renders/{model}/Terrain{other}" for model in self.models]

    # Detectors

    def pictures(self, wildcards: Wildcards) -> list[str]:
        """Return the table of photos, the index of novel views, or the folders of twins of a domain."""
        if wildcards.domain == self.config.photo_domain:
            return [f"results/{wildcards.run}/acquire/photos.parquet"]
        if wildcards.domain == VIEWS:
            return [f"{self.config.detect.views}/index.csv"]
        return [f"results/{self.run}/renders/{wildcards.domain}/Terrain{terrain}" for terrain in self.terrains]

    def pictures_folder(self, wildcards: Wildcards) -> str:
        """Return the table of photos, the folder of novel views, or the folder above the terrains of twins."""
        if wildcards.domain == VIEWS:
            return str(self.config.detect.views)
        is_photo = wildcards.domain == self.config.photo_domain
        name = "acquire/photos.parquet" if is_photo else f"renders/{wildcards.domain}"
        return self.placed(f"results/{wildcards.run}/{name}")

    def labels(self, domain: str) -> list[str]:
        """Return the table of the propagated labels of photos or the exact labels of twins."""
        stage = "labels" if domain == self.config.photo_domain else "renders"
        return [f"results/{self.run}/{stage}/labels.parquet"]

    def labels_of_domain(self, wildcards: Wildcards) -> list[str]:
        """Return the labels of a domain; empty for novel views, which include labels."""
        return [] if wildcards.domain == VIEWS else self.labels(wildcards.domain)

    def masks_of_domain(self, wildcards: Wildcards) -> list[str]:
        """Return the masks of photos or the instance maps of twins if detectors learn masks."""
        learns = self.config.detect.training.masks
        if not learns or wildcards.domain == VIEWS:
            return []
        kind = "labels/masks" if wildcards.domain == self.config.photo_domain else "renders/instances"
        return [f"results/{self.run}/{kind}/Terrain{terrain}" for terrain in self.terrains]

    def weights_of_mix(self, wildcards: Wildcards) -> dict[str, float]:
        """Return the share of each domain in a mix."""
        return dict(self.config.detect.mixes[wildcards.mix])

    def datasets_of_mix(self, wildcards: Wildcards) -> list[str]:
        """Return the data sets of the domains of a mix."""
        return [
            f"results/{{run}}/detect/{{split}}/datasets/{domain}" for domain in self.config.detect.mixes[wildcards.mix]
        ]

    def pictures_behind(self, domains: Iterable[str]) -> list[str]:
        """Return the converted pictures that data sets of these domains link to."""
        mixes = self.config.detect.mixes
        single = {part for domain in domains for part in mixes.get(domain, [domain])}
        return [f"results/{{run}}/detect/pictures/{domain}" for domain in sorted(single)]

    def pictures_behind_training(self, wildcards: Wildcards) -> list[str]:
        """Return the converted pictures that a detector is trained on."""
        return self.pictures_behind([wildcards.trained])

    def sand(self, stage: str, terrains: Sequence[Terrain] | None = None) -> list[str]:
        """Return the folders of `cameras` or `meshes` for masking the sand; empty if all detections are allowed.

        Default: all terrains of the run.
        """
        if not self.config.detect.prediction.sand_only:
            return []
        chosen = self.config.terrains if terrains is None else terrains
        return [f"results/{self.run}/{stage}/Terrain{terrain_text(terrain)}" for terrain in chosen]

    def validation_options(self, prediction: PredictionOptions | None = None) -> Options:
        """Return the options of predictions that a training's validation uses."""
        chosen = prediction or self.config.detect.prediction
        return chosen.model_dump(mode="json", include={"device", "confidence", "nms_iou"})

    def packaged_digest(self, training: DetectorOptions | None = None) -> str:
        """Return the digest of the packaged detector if a training starts from it: it is outside the run."""
        chosen = (training or self.config.detect.training).pretrained == "packaged"
        return hashlib.sha256(PACKAGED.read_bytes()).hexdigest()[:12] if chosen else ""

    def training_of_other(self, wildcards: Wildcards) -> Options:
        """Return the training options of a further detector."""
        other = self.others[wildcards.other].model_dump(mode="json", exclude={"trained_on"})
        return other | {"precision": self.config.detect.training.precision}

    def packaged_of_other(self, wildcards: Wildcards) -> str:
        """Return the digest of the packaged detector if a further detector starts from it."""
        return self.packaged_digest(self.others[wildcards.other])

    def predictions_of_other(self, wildcards: Wildcards) -> list[str]:
        """Return the predictions of a further detector for all its training domains and all evaluated domains."""
        folder = f"results/{wildcards.run}/detect/{wildcards.split}/others/{wildcards.other}/seed{wildcards.seed}"
        return [
            f"{folder}/predictions/{trained}_on_{evaluated}.parquet"
            for trained in self.others[wildcards.other].trained_on or self.trained
            for evaluated in self.domains
        ]

    @property
    def detection_of_others(self) -> str | list[str]:
        """Metrics of further detectors; empty without them."""
        return "results/{run}/detect/others.parquet" if self.others else []

    def first_training(self, name: str) -> str:
        """Return a file of the first split and seed, which figures show."""
        return f"results/{{run}}/detect/{self.splits[0]}/seed{self.seeds[0]}/{name}"

    def photos_and_twins(self) -> list[str]:
        """Return the pictures of all terrains in every domain that detectors are compared over."""
        twins = [domain for domain in self.domains if domain != self.config.photo_domain]
        return [f"results/{self.run}/acquire/Terrain{terrain}/photos.parquet" for terrain in self.terrains] + [
            f"results/{self.run}/renders/{model}/Terrain{terrain}" for model in twins for terrain in self.terrains
        ]

    def predictions_of_strip(self) -> str | list[str]:
        """Return the predictions on photos of the detector of photos, if it is trained."""
        photo = self.config.photo_domain
        return self.first_training(f"predictions/{photo}_on_{photo}.parquet") if photo in self.domains else []

    # Tables and figures

    @property
    def stand_ins(self) -> list[str]:
        """The model whose twins replace missing photos in figures; none for a source without gaps."""
        return [] if self.config.data_source.is_generated else self.models[:1]

    def evaluation_parts(self, wildcards: Wildcards) -> list[str]:
        """Return the evaluation of each stage and terrain that has something to compare with."""
        generated = self.config.data_source.is_generated
        compared = {
            "labels": self.scored_terrains,
            "outlines": [
                terrain for terrain in self.terrains if self._annotated(polygon_folder, parse_terrain(terrain))
            ],
            "materials": self.terrains if generated and self.materials_of_terrain else [],
        }
        return [
            f"results/{wildcards.run}/evaluation/{stage}_Terrain{terrain}.csv"
            for terrain in self.terrains
            for stage in ("cameras", "rocks", "consistency", "labels", "outlines", "twins", "materials")
            if terrain in compared.get(stage, self.terrains)
        ]

    def figures_of_terrains(self, name: str) -> list[str]:
        """Return a figure of every terrain, or of every position if the name contains `{position}`."""
        return [
            f"results/{self.run}/figures/{name.format(terrain=terrain_text(terrain), position=position)}.png"
            for terrain in self.config.terrains
            for position in (self._positions(terrain) if "{position}" in name else [""])
        ]

    def figures_of_geometry(self) -> list[str]:
        """Return the figures of residuals, and of offsets from the ground truth."""
        truth = self.figures_of_terrains("offsets_Terrain{terrain}") if self.config.data_source.is_generated else []
        return [*self.figures_of_terrains("residuals_Terrain{terrain}"), *truth]

    def tables_of_detectors(self) -> list[str]:
        """Return the tables of detectors, if any are trained."""
        return self._tables([*TABLES_OF_DETECTORS, "ipd_rocks"] if self.domains else [], "csv")

    def figures_of_detectors(self) -> list[str]:
        """Return the figures of detectors, if any are trained."""
        names = ["detection", "precision_recall", "ipd", "ipd_histogram"]
        names += [f"{page}_{domain}" for page in ("seen", "gap_rocks") for domain in self.domains]
        return self._figures([*names, "opposition"] if self.domains else [])

    def figures_of_stages(self) -> list[str]:
        """Return the figures of all stages except detectors."""
        names = ["comparison_Terrain{terrain}_Pos{position}", "contact_Terrain{terrain}_Pos{position}"]
        names += ["meshes_Terrain{terrain}", "crops_Terrain{terrain}", "residuals_Terrain{terrain}"]
        names += ["offsets_Terrain{terrain}"] if self.config.data_source.is_generated else []
        names_of_run = ["appearance", "reflectance", "rock_sizes", *(["reliability"] if self.scored_terrains else [])]
        return [
            *self._figures(names_of_run),
            *(path for name in names for path in self.figures_of_terrains(name)),
            *self._figures([f"label_errors_Terrain{terrain}" for terrain in self.scored_terrains]),
        ]

    def tables_of_page(self) -> list[str]:
        """Return the tables that the results page shows."""
        covers = self.config.covers.run
        stages = (
            []
            if self.only_covers
            else ["evaluation", "cameras", "alignment", "rocks", "rock_sizes", "rock_abundance", "meshes"]
        )
        twins = [] if self.only_covers else ["render", "appearance", "appearance_differences"]
        names = [*stages, *(twins if len(self.models) > 1 else twins[:2])]
        names += ["labels", "reliability"] if self.scored_terrains and not self.only_covers else []
        names += [*TABLES_OF_DETECTORS, "ipd_rocks"] if self.domains else []
        names += ["stereo"] if self.has_stereo else []
        names += ["gap"] if self._has_ablation else []
        names += ["covers", *(["masks"] if self.annotated_polygons_of_covers() else [])] if covers else []
        return self._tables(names, "md")

    def figures_of_page(self) -> list[str]:
        """Return the figures that the results page shows."""
        causes = self._figures(["gap"] if self._has_ablation else [])
        real = self._figures(["covers", "scenes"] if self.config.covers.run else [])
        return [*self.figures_of_detectors(), *causes, *real, *([] if self.only_covers else self.figures_of_stages())]

    def further_pages(self) -> dict[str, str]:
        """Return the titles of further pages by path relative to the folder of the run."""
        return {"errata.html": "Defects of the published labels"} if self.has_errata and not self.only_covers else {}

    @property
    def _has_ablation(self) -> bool:
        return bool(self.config.gap.components and self.domains)

    def _positions(self, terrain: Terrain) -> list[str]:
        return [name for name in self.config.site.positions_of(terrain) if name in self.config.positions]

    def _annotated(self, folder_of: Callable[[Path, Terrain], Path], terrain: Terrain) -> str | None:
        """Return a folder of annotations; None for the analog, whose annotations are generated."""
        folder = folder_of(self.config.annotated_root, terrain)
        return str(folder) if not self.config.data_source.is_generated and folder.is_dir() else None

    def _can_score_labels(self, terrain: str) -> bool:
        return self.config.data_source.is_generated or self._annotated(label_folder, parse_terrain(terrain)) is not None

    def _tables(self, names: Sequence[str], ending: str) -> list[str]:
        return [f"results/{self.run}/tables/{name}.{ending}" for name in names]

    def _figures(self, names: Sequence[str]) -> list[str]:
        return [f"results/{self.run}/figures/{name}.png" for name in names]


class GapPaths:
    """Paths of the ablation: the inputs of each component's twins, and the inputs of the evaluation."""

    def __init__(self, run: RunPaths) -> None:
        config = run.config
        self.run, self.config = run, config
        self.components = config.gap.components
        self.rendered = [name for name, component in self.components.items() if component.is_rendered]
        self.domains = [config.photo_domain, config.ablation_model, *self.components]
        self.pairs = [(trained, domain) for trained in config.ablation_detectors for domain in self.domains]

    def cameras(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's poses and lenses."""
        return {
            "run": "results/{run}/cameras/Terrain{terrain}",
            "located": "results/{run}/cameras/located/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
        }[self.components[wildcards.component].cameras]

    def lamps(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's lamps; that of located poses has none, so the survey's are used."""
        return {
            "run": "results/{run}/cameras/Terrain{terrain}",
            "survey": "results/{run}/cameras/located/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/cameras/Terrain{terrain}",
        }[self.components[wildcards.component].lamps]

    def meshes(self, wildcards: Wildcards) -> str:
        """Return the folder of a component's meshes."""
        return {
            "run": "results/{run}/meshes/Terrain{terrain}",
            "thinned": "results/{run}/gap/thinned/Terrain{terrain}",
            "truth": "results/{run}/gap/truth/meshes/Terrain{terrain}",
        }[self.components[wildcards.component].meshes]

    def materials(self, wildcards: Wildcards) -> str | list[str]:
        """Return the folder of a component's materials, if they are fitted."""
        chosen = self.components[wildcards.component].materials
        as_run = self.run.materials_of_terrain if self.config.render.materials_from_photos else []
        return {"run": as_run, "fitted": self.run.fitted_materials}.get(chosen, [])

    def light(self, wildcards: Wildcards) -> str | list[str]:
        """Return the light fields of a terrain, if the twins of a component are fitted."""
        fitted = self.config.render_options_of(wildcards.component).materials_from_photos
        return self.run.fitted_light if fitted else []

    def options(self, wildcards: Wildcards) -> Options:
        """Return the options of the renderer for a component."""
        return self.config.render_options_of(wildcards.component).model_dump(mode="json", exclude_unset=True)

    def predictions(self) -> list[str]:
        """Return the predictions on photos, on the twin, and on the twin of every component."""
        return [
            f"results/{{run}}/{self._stage(domain)}/{{split}}/seed{{seed}}/predictions/{trained}_on_{self._twin(domain)}.parquet"
            for trained, domain in self.pairs
        ]

    def datasets(self) -> list[str]:
        """Return the data sets of these domains."""
        return [
            f"results/{{run}}/{self._stage(domain)}/{{split}}/datasets/{self._twin(domain)}" for domain in self.domains
        ]

    def labels(self) -> list[str]:
        """Return the labels of these domains."""
        paths = []
        for domain in self.domains:
            propagated = domain in self.components and self.components[domain].labels == "propagated"
            if domain in self.rendered and not propagated:
                paths += [f"results/{{run}}/gap/twins/{domain}/labels.parquet"]
            else:
                paths += self.run.labels(self.config.photo_domain if propagated else self._twin(domain))
        return paths

    def _twin(self, domain: str) -> str:
        """Return the domain of the pictures; a component that is not rendered uses the twin's."""
        return self.config.ablation_model if domain in self.components and domain not in self.rendered else domain

    def _stage(self, domain: str) -> str:
        return "gap" if domain in self.rendered else "detect"


class CoverPaths:
    """Paths of detectors that are trained on randomised scenes and tested on cover photos, fold by fold."""

    def __init__(self, run: RunPaths) -> None:
        config, covers = run.config, run.config.covers
        self.run, self.config, self.covers = run, config, covers
        self.terrains = [terrain for terrain in config.terrains if cover_photos(config.annotated_root, terrain)]
        # Terrains whose rocks are used: a release may lack the meshes of a terrain.
        has_scans, root = config.data_source.has_scans, config.source.root
        self.strewn = [terrain for terrain in config.terrains if has_scans or released_meshes(root, terrain)]
        self.folds = {
            "_".join(terrain_text(terrain) for terrain in fold): fold
            for fold in config.cover_folds
            if set(fold) & set(self.terrains)
        }
        self.carved_rocks = min(300, covers.carved_scenes)  # a scene shows several
        # Further detectors: of carved rocks, the start of all other trainings, and of all terrains, for publication.
        self.not_tested: dict[str, list[Terrain]] = {"carved": [CARVED], "all": self.strewn}
        self.trainings = [RENDERED, *([FINE_TUNED] if covers.fine_tuning.windows else [])]  # the last is the best
        self.first_seed = run.seeds[0]
        self.best = f"{{fold}}/seed{self.first_seed}/{self.trainings[-1]}"
        # Domains of `real_tables`: images and labels, training of detectors, evaluation.
        self.domains = [config.photo_domain, *run.models]
        self.trained = [config.photo_domain, *config.compared_models]
        self.evaluated = [*self.domains, CONTROL]
        twins = {model: f"renders/{model}" for model in run.models} | {CONTROL: "covers/control/pictures"}
        self.folders_of_twins = {name: run.placed(f"results/{run.run}/{folder}") for name, folder in twins.items()}
        # Figure of twins before and after fits to photos. Cover photos refine the ground of a release without scans.
        self.refines_ground = config.rocks.ground_from_photos and not config.data_source.has_photos
        models = config.render.models
        self.model_before = next((model for model in models if not config.render.is_fitted(model)), models[0])
        self.model_after = next(iter(config.render.fitted_domains), models[0])
        self.title_before = f"{self.model_before}, smooth ground" if self.refines_ground else self.model_before

    @property
    def start(self) -> str:
        """Name in tables of the initial weights of the first training."""
        return "carved rocks" if self.covers.carved_scenes else self.config.detect.training.start

    def rocks(self, wildcards: Wildcards) -> str:
        """Return the folder of a terrain's closed rocks: repaired ones of a release, else the run's meshes."""
        if parse_terrain(wildcards.terrain) == CARVED:
            return f"results/{wildcards.run}/covers/carved"
        kind = "meshes" if self.config.data_source.has_scans else "repaired"
        return f"results/{wildcards.run}/{kind}/Terrain{wildcards.terrain}"

    def files(self) -> list[str]:
        """Return the cover photos and the annotated label files of the same terrains.

        Raises
        ------
        ConfigError
            No terrain of the run has a cover photo.
        """
        root = self.config.annotated_root
        if not self.terrains:
            raise ConfigError(
                f"no cover photos of terrains {', '.join(map(str, self.config.terrains))}, expected "
                f"{COVERS}/cover_photo_indexed_01_A.png; cover_photos, real_tables and rocks.ground_from_photos "
                "require the published release",
                path=root,
            )
        return [
            str(path)
            for terrain in self.terrains
            for files in (cover_photos(root, terrain), label_files(root, terrain))
            for path in files.values()
        ]

    def twins_before(self) -> list[str]:
        """Return the folders of the twins before the fits to photos.

        Raises
        ------
        ConfigError
            The run fits nothing to photos.
        """
        if not self.refines_ground and self.model_before == self.model_after:
            raise ConfigError(
                "before_after compares twins before and after fits to photos, but the run has none; add fitted to "
                "render.models, or set rocks.ground_from_photos"
            )
        folder = "covers/unrefined/pictures" if self.refines_ground else f"renders/{self.model_before}"
        return [f"results/{self.run.run}/{folder}/Terrain{terrain}" for terrain in self.run.terrains]

    def twins_after(self) -> list[str]:
        """Return the folders of the twins after the fits to photos."""
        return [f"results/{self.run.run}/renders/{self.model_after}/Terrain{terrain}" for terrain in self.run.terrains]

    def instead_of_photos(self, name: str) -> str | list[str]:
        """Return a folder of `covers` to compare twins with; empty if the source has photos, or no cover photos."""
        compared = not self.config.data_source.has_photos and self.terrains
        return f"results/{{run}}/covers/{name}" if compared else []

    def photos_or_covers(self) -> list[str]:
        """Return the tables of photos, or the folder of cover photos that replaces them."""
        return self.run.photos_for_light or self.run.photo_tables

    def number_of_scenes(self, wildcards: Wildcards) -> int:
        """Return the number of scenes with a terrain's rocks."""
        return self.covers.carved_scenes if parse_terrain(wildcards.terrain) == CARVED else self.covers.scenes.number

    def tested_in(self, wildcards: Wildcards) -> Sequence[Terrain]:
        """Return the terrains that a fold's detector is tested on."""
        return self.folds.get(wildcards.fold, ())

    def trained_in(self, wildcards: Wildcards) -> list[Terrain]:
        """Return the training terrains of a fold: all except the test terrains."""
        if wildcards.fold in self.not_tested:
            return self.not_tested[wildcards.fold]
        return [terrain for terrain in self.strewn if terrain not in self.tested_in(wildcards)]

    def photos_of_fold(self, wildcards: Wildcards) -> str | list[str]:
        """Return the folder of cover photos that select a fold's weights; empty for a fold without test."""
        return [] if wildcards.fold in self.not_tested else f"results/{wildcards.run}/covers/photos"

    def weights_before(self, wildcards: Wildcards) -> str | list[str]:
        """Return the detector that a fold's training starts from, the same for all folds and seeds."""
        if wildcards.fold == "carved" or not self.covers.carved_scenes:
            return []
        return f"results/{wildcards.run}/covers/folds/carved/seed{self.first_seed}/{RENDERED}/detector.pt"

    def training(self, wildcards: Wildcards) -> Options:
        """Return the training options of a fold."""
        chosen = self.run.options("detect.training")
        return chosen | {"epochs": self.covers.carved_epochs} if wildcards.fold == "carved" else chosen

    def fine_tuning(self) -> Options:
        """Return the training options of the fine-tuning."""
        tuning = self.covers.fine_tuning
        return self.run.options("detect.training") | {"epochs": tuning.epochs, "learning_rate": tuning.learning_rate}

    def last_training(self, wildcards: Wildcards) -> Options:
        """Return the options of a detector's last training."""
        return self.fine_tuning() if wildcards.cover_trained == FINE_TUNED else self.run.options("detect.training")

    def last_datasets(self, wildcards: Wildcards) -> list[str]:
        """Return the data set of each fold's last training."""
        name = "fine_tuning" if wildcards.cover_trained == FINE_TUNED else "dataset"
        return self._of_folds(f"{{fold}}/{name}")

    def scenes_of_fold(self, wildcards: Wildcards) -> list[str]:
        """Return the scenes that a fold's detector is trained on."""
        return [
            f"results/{wildcards.run}/covers/scenes/Terrain{terrain_text(number)}"
            for number in self.trained_in(wildcards)
        ]

    def scenes_behind(self, wildcards: Wildcards) -> list[str]:
        """Return the pictures that a fold's data set links to."""
        photos = self.photos_of_fold(wildcards)
        return [*self.scenes_of_fold(wildcards), *([photos] if isinstance(photos, str) else [])]

    def pictures_behind_fine_tuning(self, wildcards: Wildcards) -> list[str]:
        """Return the pictures that a fold's data set for fine-tuning links to."""
        return [*self.scenes_of_fold(wildcards), f"results/{wildcards.run}/covers/windows"]

    def of_folds(self, name: str) -> list[str]:
        """Return a file of every fold for a seed and training."""
        return self._of_folds(f"{{fold}}/seed{{{{seed}}}}/{{{{cover_trained}}}}/{name}")

    def masks(self) -> list[str]:
        """Return the masks of every fold."""
        return self._of_folds("{fold}/masks")

    def files_of_best(self, name: str) -> list[str]:
        """Return a file of every fold, of the best training and the first seed."""
        return self._of_folds(f"{self.best}/{name}")

    def published_weights(self) -> str:
        """Return the best detector of all terrains."""
        return f"results/{{run}}/covers/folds/{self.best.format(fold='all')}/detector.pt"

    def best_predictions(self) -> str:
        """Return the predictions that figures show."""
        chosen = "merged" if len(self.run.seeds) > 1 else f"seed{self.first_seed}"
        return f"results/{{run}}/covers/{self.trainings[-1]}/{chosen}/predictions.parquet"

    @cached_property
    def merged_predictions(self) -> str | list[str]:
        """The merged predictions of several seeds."""
        several = len(self.run.seeds) > 1
        return "results/{run}/covers/{cover_trained}/merged/predictions.parquet" if several else []

    def _of_folds(self, pattern: str) -> list[str]:
        return [f"results/{self.run.run}/covers/folds/{pattern.format(fold=fold)}" for fold in self.folds]


class RoverPaths:
    """Paths and options of the drives of the rover."""

    def __init__(self, run: RunPaths) -> None:
        self.run, self.config, self.rover = run, run.config, run.config.rover
        rover, folder = self.rover, Path(f"results/{run.run}")
        self.seeds = list(rover.seeds) if rover.run else []
        self.first = f"results/{{run}}/rover/seed{rover.seeds[0]}"  # folder of the drive that figures show
        self.views, self.suns = list(rover.cameras.views), list(rover.cameras.suns)
        self.picture_sets = list(rover.picture_sets)
        self.terrains = [terrain_text(terrain) for terrain in rover.world.terrains]  # from east to west
        self.tables = ["rover", "rover_drives", *(["rover_onboard"] if rover.onboard else [])]
        self.figures = ["rover_sequence", "rover_drive", *(["rover_front"] if rover.onboard else [])]
        self.detector = self.config.detector_on_board(folder)  # None: metrics on board use the ground truth only
        self.detector_before = self.config.detector_before_drives(folder)  # before fine-tuning on other drives
        self.deciding = self.config.deciding_detectors(folder)
        planned = cases(rover.autonomy, rover.cameras, rover.seeds, list(self.deciding))
        self.cases = {case.name: case for case in planned} if rover.run and rover.autonomy.run else {}
        self.detectors_driven = {case.detector for case in self.cases.values()} & set(self.deciding)
        # Whether the run has metrics of these detectors: it evaluates only detectors that it trains.
        self.has_gap = bool(set(rover.autonomy.detectors) & set(run.trained))

    @property
    def vehicle(self) -> str:
        """The table of the vehicle, in this folder or in the package."""
        return str(resolve_packaged(self.rover.drive.vehicle))

    @property
    def soils(self) -> str:
        """The table of soils, in this folder or in the package."""
        return str(resolve_packaged(self.rover.soil.table))

    @property
    def elevation_model(self) -> str | list[str]:
        """The file of the elevation model that is driven over; empty without a file."""
        dem = self.rover.world.dem
        return str(dem.path) if dem and dem.path else []

    @property
    def weights(self) -> str | list[str]:
        """The weights of the detector on board; empty without a detector."""
        return str(self.detector.weights) if self.detector else []

    @property
    def weights_before_fine_tuning(self) -> str | list[str]:
        """The weights that the training on other drives starts from; empty without a detector."""
        return str(self.detector_before.weights) if self.detector_before else []

    @property
    def shown_sun(self) -> str:
        """The Sun under which figures show a drive."""
        return self.rover.shown_set.split("_")[0]

    def camera_options(self, *excluded: str) -> Options:
        """Return the options of the pictures of a drive without the named ones."""
        return self.rover.cameras.model_dump(mode="json", exclude=set(excluded))

    def detector_options(self) -> Options | None:
        """Return the options of the detector on board; None without a detector."""
        return self._placed(self.detector)

    def validation_options(self) -> Options | None:
        """Return the options of the validation during the training on other drives; None without a detector."""
        return self.run.validation_options(self.detector.prediction) if self.detector else None

    def poses_of_other_drives(self) -> list[str]:
        """Return the last written file of each drive that the detector on board is trained on."""
        return [f"{drive}/{FRONT}/poses.parquet" for drive in self.rover.fine_tuning.drives]

    def pictures_of_drive(self) -> list[str]:
        """Return the camera poses and the labels of every view, which are written together with the pictures."""
        folders = [f"results/{{run}}/rover/seed{{seed}}/{view}" for view in self.views]
        labels = [f"{folder}/{sun}_truth.parquet" for folder in folders for sun in self.suns]
        return [*(f"{folder}/poses.parquet" for folder in folders), *labels]

    def detections(self) -> list[str]:
        """Return the detections in each picture set of the front camera; empty without a detector on board."""
        if not self.rover.onboard or self.detector is None:
            return []
        return [f"results/{{run}}/rover/seed{{seed}}/{FRONT}/{name}/detections.parquet" for name in self.picture_sets]

    def shown_detections(self) -> str | list[str]:
        """Return the detections in the pictures that figures show; empty without a detector on board."""
        return f"{self.first}/{FRONT}/{self.rover.shown_set}/detections.parquet" if self.detector else []

    # Autonomous drives, one per case

    def autonomy_options(self) -> Options:
        """Return the options of a case. More seeds or modes leave finished drives valid, so these are excluded."""
        excluded = {"run", "modes", "headlights", "auto_exposure", "detectors", "poses"}
        return self.rover.autonomy.model_dump(mode="json", exclude=excluded)

    def cameras_of_case(self, wildcards: Wildcards) -> Options:
        """Return the options of cameras that change a drive: of the pictures, if the mode uses them, and of boxes."""
        names = set() if self._is_unlit(wildcards) else {"sun_elevation_deg", "scale", "stars"}
        included = dict.fromkeys(names, True) | {"onboard": {"confidence", "ground"}}
        return self.rover.cameras.model_dump(mode="json", include=included)

    def render_of_case(self, wildcards: Wildcards) -> Options:
        """Return the options of the renderer that change a drive."""
        options = rover_render(self.config.render)
        return {"skirt_m": options["skirt_m"]} if self._is_unlit(wildcards) else options

    def detector_of_case(self, wildcards: Wildcards) -> Options | None:
        """Return the options of the detector of a case; None for a mode without detector."""
        return self._placed(self.deciding.get(self.cases[wildcards.case].detector))

    def weights_of_case(self, wildcards: Wildcards) -> str | list[str]:
        """Return the weights of the detector of a case; empty for a mode without detector."""
        detector = self.deciding.get(self.cases[wildcards.case].detector)
        return str(detector.weights) if detector else []

    def _placed(self, detector: OnboardDetector | None) -> Options | None:
        placed = {"weights": self.run.placed(str(detector.weights))} if detector else {}
        return detector.model_dump(mode="json") | placed if detector else None

    def _is_unlit(self, wildcards: Wildcards) -> bool:
        return not self.cases[wildcards.case].has_pictures
