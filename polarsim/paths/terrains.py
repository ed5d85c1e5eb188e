"""Paths of terrains, of their raw data and of the stages up to the twins."""

from __future__ import annotations

import operator
from collections.abc import Callable
from pathlib import Path

from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import describe_seeds
from polarsim.config import Config
from polarsim.errors import ConfigError
from polarsim.formats.release import cover_photos, label_folder, polygon_folder
from polarsim.paths.wildcards import Options, Wildcards
from polarsim.photo import Terrain, parse_terrain, terrain_text


class TerrainPaths:
    """Terrains and raw data of a run, options of its jobs, and inputs of the stages up to the twins."""

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
        self.first_shown = self.terrains[-1]  # on the first page; in the demo, the fastest terrain
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
        return (
            self.fitted_light
            if self.config.render.fitted_domains and (self.config.data_source.has_photos or self._has_covers)
            else []
        )

    @property
    def photo_tables(self) -> list[str]:
        """The tables of photos of all terrains; empty tables for a source without photos."""
        return [f"results/{{run}}/acquire/Terrain{terrain}/photos.parquet" for terrain in self.terrains]

    @property
    def photos_or_covers(self) -> list[str]:
        """The tables of photos, or the folder of published cover photos if the source has only these."""
        only_covers = self._has_covers and not self.config.data_source.has_photos
        return ["results/{run}/covers/photos"] if only_covers else self.photo_tables

    @property
    def _has_covers(self) -> bool:
        return any(cover_photos(self.config.annotated_root, terrain) for terrain in self.config.terrains)

    @property
    def _has_fit(self) -> bool:
        return bool(self.config.render.fitted_domains) and self.config.data_source.has_photos

    def twins_of_another_terrain(self, wildcards: Wildcards) -> list[str]:
        """Return the twins of the next terrain of the run with every model; empty for a single terrain."""
        if len(self.terrains) < 2:
            return []
        other = self.terrains[(self.terrains.index(wildcards.terrain) + 1) % len(self.terrains)]
        return [f"results/{wildcards.run}/renders/{model}/Terrain{other}" for model in self.models]

    def _positions(self, terrain: Terrain) -> list[str]:
        return [name for name in self.config.site.positions_of(terrain) if name in self.config.positions]

    def _annotated(self, folder_of: Callable[[Path, Terrain], Path], terrain: Terrain) -> str | None:
        """Return a folder of annotations; None for the analog, whose annotations are generated."""
        folder = folder_of(self.config.annotated_root, terrain)
        return str(folder) if not self.config.data_source.is_generated and folder.is_dir() else None

    def _can_score_labels(self, terrain: str) -> bool:
        return self.config.data_source.is_generated or self._annotated(label_folder, parse_terrain(terrain)) is not None
