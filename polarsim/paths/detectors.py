"""Paths of data sets, trainings and predictions of detectors."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence

from polarsim.detect.options import PACKAGED, VIEWS, DetectorOptions, PredictionOptions
from polarsim.paths.terrains import TerrainPaths
from polarsim.paths.wildcards import Options, Wildcards
from polarsim.photo import Terrain, terrain_text


class DetectorPaths(TerrainPaths):
    """Pictures, labels, trainings and predictions of detectors."""

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
        """Return the folders of `cameras` or `meshes` for masking the sand; default: of all terrains of the run."""
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

    def photos_and_twins(self, domains: Sequence[str]) -> list[str]:
        """Return the tables of photos, and the folders of twins of all terrains in some domains."""
        twins = [domain for domain in domains if domain != self.config.photo_domain]
        return [f"results/{self.run}/acquire/Terrain{terrain}/photos.parquet" for terrain in self.terrains] + [
            f"results/{self.run}/renders/{model}/Terrain{terrain}" for model in twins for terrain in self.terrains
        ]

    def predictions_of_strip(self) -> str | list[str]:
        """Return the predictions on photos of the detector of photos, if it is trained."""
        photo = self.config.photo_domain
        return self.first_training(f"predictions/{photo}_on_{photo}.parquet") if photo in self.domains else []
