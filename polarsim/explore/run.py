"""What a run holds that can be shown: terrains, domains, tables, detectors, drives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import ConfigError
from polarsim.formats.tables import LABEL_COLUMNS, label_table, read_csv, read_parquet
from polarsim.photo import TERRAINS, PhotoKey
from polarsim.run_files.pictures import PHOTO, models_of, pictures_of
from polarsim.schemas import PREDICTIONS


@dataclass(frozen=True)
class Run:
    """The folder of a run."""

    folder: Path

    @classmethod
    def at(cls, folder: Path) -> Run:
        """The run in a folder.

        Raises
        ------
        ConfigError
            Nothing there that can be shown.
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
        return models_of(self.folder)

    @cached_property
    def pictures(self) -> dict[tuple[str, PhotoKey], Path]:
        """Every photo and twin by domain and key, those alone that are there, in the order of keys."""
        found = []
        for terrain in self.terrains:
            for domain in (PHOTO, *self.models):
                if domain != PHOTO or (self.folder / f"acquire/Terrain{terrain:02d}/photos.parquet").exists():
                    found += [((domain, key), path) for key, path in pictures_of(self.folder, domain, terrain).items()]
        order = {domain: index for index, domain in enumerate((PHOTO, *self.models))}
        return dict(sorted(found, key=lambda item: (item[0][1], order[item[0][0]])))

    def labels(self, terrain: int, *, of_twins: bool = False) -> pd.DataFrame:
        """Labels that were propagated to photos, or those that the renderer knows of twins; no row without a table."""
        path = self.folder / ("renders" if of_twins else "labels") / "tables" / f"Terrain{terrain:02d}.parquet"
        return read_parquet(path, LABEL_COLUMNS) if path.exists() else label_table([])

    def table(self, path: str) -> pd.DataFrame | None:
        """A table below the run's folder; None where the run has none."""
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

    def domain_of(self, evaluated: str) -> str:
        """The domain here of what the detect stage calls `analog`, `real` or by a model's name."""
        return evaluated if evaluated in self.models else PHOTO

    @cached_property
    def drives(self) -> tuple[Path, ...]:
        return tuple(sorted(path.parent for path in (self.folder / "rover").glob("seed*/trace.parquet")))


def as_rows(values: np.ndarray) -> list[float]:
    """Numbers as a JSON file has them, to a ten-thousandth."""
    return [round(float(value), 4) for value in np.asarray(values).ravel()]
