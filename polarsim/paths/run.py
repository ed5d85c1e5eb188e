"""Paths of the tables, figures and pages of a run."""

from __future__ import annotations

from collections.abc import Sequence

from polarsim.formats.release import polygon_folder
from polarsim.paths.detectors import DetectorPaths
from polarsim.paths.wildcards import Wildcards
from polarsim.photo import parse_terrain, terrain_text

TABLES_OF_DETECTORS = ("detection", "differences", "detection_breakdown", "false_positives", "ipd")


class RunPaths(DetectorPaths):
    """Paths of a run: those of its terrains and detectors, and its tables, figures and pages."""

    @property
    def stand_ins(self) -> list[str]:
        """The model whose twins replace missing photos in figures; none for a source without gaps."""
        return [] if self.config.data_source.is_generated else self.models[:1]

    @property
    def outlined_terrains(self) -> list[str]:
        """The terrains with annotated polygons."""
        return [terrain for terrain in self.terrains if self._annotated(polygon_folder, parse_terrain(terrain))]

    def evaluation_parts(self, wildcards: Wildcards) -> list[str]:
        """Return the evaluation of each stage and terrain that has something to compare with."""
        generated = self.config.data_source.is_generated
        compared = {
            "labels": self.scored_terrains,
            "outlines": self.outlined_terrains,
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

    def _tables(self, names: Sequence[str], ending: str) -> list[str]:
        return [f"results/{self.run}/tables/{name}.{ending}" for name in names]

    def _figures(self, names: Sequence[str]) -> list[str]:
        return [f"results/{self.run}/figures/{name}.png" for name in names]
