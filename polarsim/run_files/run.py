"""Contents of a run's folder: terrains, photos and twins, labels, tables, splits, predictions, drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.errors import ConfigError
from polarsim.formats.tables import LABEL_COLUMNS, label_table, read_csv, read_parquet
from polarsim.formats.yaml_files import read_yaml
from polarsim.photo import TERRAINS, PhotoKey
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.detect import PREDICTIONS

PHOTO = "photo"  # the domain of photos; all others are models of twins
TRACE = "trace.parquet"  # in the folder of each drive
CONFIG = "config.yaml"  # the run's merged configuration
_NO_MODELS = ("boxes", "instances", "coco", "tables", "maps", "materials")  # of the folders below renders/


@dataclass(frozen=True)
class Run:
    """The folder of a run, `results/<run>`. Nothing is read before it is asked for."""

    folder: Path

    @classmethod
    def at(cls, folder: Path) -> Run:
        """Return the run in a folder.

        Raises
        ------
        ConfigError
            The folder has neither photos, labels nor meshes.
        """
        run = cls(folder)
        if not run.terrains:
            raise ConfigError("no run: neither photos, labels nor meshes of a terrain are there", path=folder)
        return run

    @property
    def name(self) -> str:
        return self.folder.resolve().name

    @cached_property
    def terrains(self) -> tuple[int, ...]:
        """Terrains with photos, labels or meshes."""
        paths = ("acquire/{}/photos.parquet", "labels/tables/{}.parquet", "meshes/{}")
        return tuple(
            terrain
            for terrain in TERRAINS
            if any((self.folder / path.format(f"Terrain{terrain:02d}")).exists() for path in paths)
        )

    @cached_property
    def models(self) -> tuple[str, ...]:
        """Models that twins were rendered with."""
        folders = sorted(path for path in (self.folder / "renders").glob("*") if path.is_dir())
        return tuple(path.name for path in folders if path.name not in _NO_MODELS and any(path.glob("Terrain??/*.png")))

    @property
    def domains(self) -> tuple[str, ...]:
        """Domains of pictures: photos, and the models of twins."""
        return (PHOTO, *self.models)

    def domain_of(self, evaluated: str) -> str:
        """Return the domain here of a domain of the detect stage: `analog`, `real` or a model's name."""
        return evaluated if evaluated in self.models else PHOTO

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the splits that were drawn."""
        return tuple(sorted(path.parent.name for path in (self.folder / "detect").glob("*/split.csv")))

    def pictures_of(self, domain: str, terrain: int) -> dict[PhotoKey, Path]:
        """Return a terrain's photos or the twins of a model by key; empty where the run has no twins of the model."""
        folder = f"Terrain{terrain:02d}"
        if domain == PHOTO:
            return pictures_at(self.folder / "acquire" / folder / "photos.parquet")
        twins = self.folder / "renders" / domain / folder
        return pictures_at(twins) if twins.is_dir() else {}

    @cached_property
    def pictures(self) -> dict[tuple[str, PhotoKey], Path]:
        """Every photo and twin by domain and key, in the order of keys."""
        found = []
        for terrain in self.terrains:
            for domain in self.domains:
                if domain != PHOTO or (self.folder / f"acquire/Terrain{terrain:02d}/photos.parquet").exists():
                    found += [((domain, key), path) for key, path in self.pictures_of(domain, terrain).items()]
        return dict(sorted(found, key=lambda item: (item[0][1], self.domains.index(item[0][0]))))

    def polygons(self, key: PhotoKey) -> Path:
        """Return the file of the outlines of a photo's propagated labels."""
        return self.folder / "labels" / "polygons" / f"Terrain{key.terrain:02d}" / f"{key}.txt"

    def instances(self, key: PhotoKey) -> Path:
        """Return the instance map of the twins of a photo's exposure bracket."""
        bracket = str(key).rpartition("_")[0]
        return self.folder / "renders" / "instances" / f"Terrain{key.terrain:02d}" / f"{bracket}.png"

    def labels(self, terrain: int, *, of_twins: bool = False) -> pd.DataFrame:
        """Return a terrain's labels, propagated to photos or rendered with twins; no row without a table."""
        path = self.folder / ("renders" if of_twins else "labels") / "tables" / f"Terrain{terrain:02d}.parquet"
        return read_parquet(path, LABEL_COLUMNS) if path.exists() else label_table([])

    def all_labels(self, *, of_twins: bool = False) -> pd.DataFrame:
        """Return `labels` of all terrains."""
        return pd.concat([self.labels(terrain, of_twins=of_twins) for terrain in self.terrains])

    def table(self, path: str) -> pd.DataFrame | None:
        """Return a table below the run's folder; None where the run has none."""
        file = self.folder / path
        if not file.exists():
            return None
        return read_csv(file) if file.suffix == ".csv" else read_parquet(file)

    @cached_property
    def predictions(self) -> dict[str, Path]:
        """Prediction files by `<split>/seed<seed>/<trained>_on_<evaluated>`."""
        found = sorted((self.folder / "detect").glob("*/seed*/predictions/*_on_*.parquet"))
        return {f"{path.parts[-4]}/{path.parts[-3]}/{path.stem}": path for path in found}

    def predicted(self, name: str) -> pd.DataFrame:
        return read_parquet(self.predictions[name], PREDICTIONS.columns)

    @cached_property
    def drives(self) -> tuple[Path, ...]:
        """Folders of the rover's drives."""
        return tuple(sorted(path.parent for path in (self.folder / "rover").glob(f"seed*/{TRACE}")))

    def configured(self, section: str) -> Mapping[str, Any]:
        """Return a section of the run's merged configuration; empty where the run has none."""
        path = self.folder / CONFIG
        content = read_yaml(path) if path.is_file() else None
        found = content.get(section) if isinstance(content, Mapping) else None
        return found if isinstance(found, Mapping) else {}
