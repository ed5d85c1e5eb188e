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
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.run_files.instances import instance_map_name
from polarsim.run_files.pictures import pictures_at
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import DEFAULT, Site, site_of

PHOTO = "photo"  # domain of photos; the other domains are models of twins
TRACE = "trace.parquet"  # in the folder of each drive
CONFIG = "config.yaml"  # merged configuration of the run
_NO_MODELS = (
    "boxes",
    "instances",
    "coco",
    "tables",
    "maps",
    "materials",
    "light",
)  # in renders/


@dataclass(frozen=True)
class Run:
    """Folder of a run, `results/<run>`. Files are read on access."""

    folder: Path

    @classmethod
    def at(cls, folder: Path) -> Run:
        """Return the run in a folder."""
        run = cls(folder)
        if not run.terrains:
            raise ConfigError("no run: expected photos, labels or meshes of a terrain", path=folder)
        return run

    @property
    def name(self) -> str:
        return self.folder.resolve().name

    @cached_property
    def site(self) -> Site:
        """Site of the stored configuration of the run; NASA's POLAR without a configuration."""
        return Site.model_validate(site_of(self._configuration.get("site", DEFAULT)))

    @cached_property
    def terrains(self) -> tuple[Terrain, ...]:
        """Terrains with photos, labels or meshes, in the order of the site."""
        paths = ("acquire/{}/photos.parquet", "labels/tables/{}.parquet", "meshes/{}")
        return tuple(
            terrain
            for terrain in self.site.terrains
            if any((self.folder / path.format(f"Terrain{terrain_text(terrain)}")).exists() for path in paths)
        )

    @cached_property
    def models(self) -> tuple[str, ...]:
        """Reflectance models of the twins."""
        folders = sorted(path for path in (self.folder / "renders").glob("*") if path.is_dir())
        return tuple(path.name for path in folders if path.name not in _NO_MODELS and any(path.glob("Terrain*/*.png")))

    @property
    def domains(self) -> tuple[str, ...]:
        """Domains of images: photos, and the models of twins."""
        return (PHOTO, *self.models)

    def domain_of(self, evaluated: str) -> str:
        """Return the domain of the run for a domain of the detect stage: `analog`, `real` or the name of a model."""
        return evaluated if evaluated in self.models else PHOTO

    @property
    def splits(self) -> tuple[str, ...]:
        """Names of the training splits."""
        return tuple(sorted(path.parent.name for path in (self.folder / "detect").glob("*/split.csv")))

    def pictures_of(self, domain: str, terrain: Terrain) -> dict[PhotoKey, Path]:
        """Return the photos of a terrain or the twins of a model by photo key; empty without twins of the model."""
        folder = f"Terrain{terrain_text(terrain)}"
        if domain == PHOTO:
            return pictures_at(self.folder / "acquire" / folder / "photos.parquet")
        twins = self.folder / "renders" / domain / folder
        return pictures_at(twins) if twins.is_dir() else {}

    @cached_property
    def pictures(self) -> dict[tuple[str, PhotoKey], Path]:
        """All photos and twins by domain and photo key, sorted by key."""
        items = []
        for terrain in self.terrains:
            for domain in self.domains:
                if domain != PHOTO or (self.folder / f"acquire/Terrain{terrain_text(terrain)}/photos.parquet").exists():
                    items += [((domain, key), path) for key, path in self.pictures_of(domain, terrain).items()]
        return dict(sorted(items, key=lambda item: (item[0][1], self.domains.index(item[0][0]))))

    def polygons(self, key: PhotoKey) -> Path:
        """Return the file of the polygons of a photo's propagated labels."""
        return self.folder / "labels" / "polygons" / f"Terrain{terrain_text(key.terrain)}" / f"{key}.txt"

    def instances(self, key: PhotoKey) -> Path:
        """Return the instance map of the twins of an exposure bracket."""
        return self.folder / "renders" / "instances" / f"Terrain{terrain_text(key.terrain)}" / instance_map_name(key)

    def labels(self, terrain: Terrain, *, of_twins: bool = False) -> pd.DataFrame:
        """Return the labels of a terrain, propagated to photos or rendered with twins; empty without a table."""
        path = (
            self.folder / ("renders" if of_twins else "labels") / "tables" / f"Terrain{terrain_text(terrain)}.parquet"
        )
        return read_parquet(path, LABEL_COLUMNS) if path.exists() else label_table([])

    def all_labels(self, *, of_twins: bool = False) -> pd.DataFrame:
        """Return `labels` of all terrains."""
        return pd.concat([self.labels(terrain, of_twins=of_twins) for terrain in self.terrains])

    def table(self, path: str) -> pd.DataFrame | None:
        """Read a table below the folder of the run; None if the table does not exist."""
        file = self.folder / path
        if not file.exists():
            return None
        return read_csv(file) if file.suffix == ".csv" else read_parquet(file)

    @cached_property
    def predictions(self) -> dict[str, Path]:
        """Prediction files by `<split>/seed<seed>/<trained>_on_<evaluated>`."""
        files = sorted((self.folder / "detect").glob("*/seed*/predictions/*_on_*.parquet"))
        return {f"{path.parts[-4]}/{path.parts[-3]}/{path.stem}": path for path in files}

    def predicted(self, name: str) -> pd.DataFrame:
        return read_parquet(self.predictions[name], PREDICTIONS.columns)

    @cached_property
    def drives(self) -> tuple[Path, ...]:
        """Folders of the rover's drives."""
        return tuple(sorted(path.parent for path in (self.folder / "rover").glob(f"seed*/{TRACE}")))

    def configured(self, section: str) -> Mapping[str, Any]:
        """Return a section of the merged configuration of the run; empty if it does not exist."""
        options = self._configuration.get(section)
        return options if isinstance(options, Mapping) else {}

    @property
    def _configuration(self) -> Mapping[str, Any]:
        """Stored configuration; empty if it does not exist."""
        path = self.folder / CONFIG
        content = read_yaml(path) if path.is_file() else None
        return content if isinstance(content, Mapping) else {}
