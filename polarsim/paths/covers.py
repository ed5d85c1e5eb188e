"""Paths of cover photos and randomised scenes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from polarsim.cover_photos.options import CARVED
from polarsim.errors import ConfigError
from polarsim.formats.release import COVERS, cover_photos, label_files, released_meshes
from polarsim.paths.run import RunPaths
from polarsim.paths.wildcards import Options, Wildcards
from polarsim.photo import Terrain, parse_terrain, terrain_text
from polarsim.schemas.covers import CONTROL, FINE_TUNED, RENDERED


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
        """Return the folder of a terrain's closed rocks."""
        if parse_terrain(wildcards.terrain) == CARVED:
            return f"results/{wildcards.run}/covers/carved"
        return f"results/{wildcards.run}/{self.config.closed_meshes}/Terrain{wildcards.terrain}"

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
