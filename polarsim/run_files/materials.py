"""Fitted materials of a terrain: `albedo.parquet` (factor per vertex and model) and `materials.json` (other values)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pydantic import BaseModel, ValidationError

from polarsim.errors import FormatError
from polarsim.formats import tables
from polarsim.formats.files import read_json, write_json, writing_folder
from polarsim.formats.readers import reader
from polarsim.formats.yaml_files import describe_error
from polarsim.photo import NO_ROCK
from polarsim.run_files.scene import TerrainMesh

ALBEDO_FILE, TABLE_FILE = "albedo.parquet", "materials.json"


class _Fit(BaseModel, extra="forbid"):
    """Fields of `FittedMaterial` in `materials.json`, without the albedo."""

    parameters: dict[str, Any]
    lamps: dict[str, float]
    rocks: dict[int, float]
    check: dict[str, Any]


class _Table(BaseModel, extra="forbid"):
    azimuths: tuple[str, ...]
    positions: tuple[str, ...]
    models: dict[str, _Fit]


@dataclass(frozen=True)
class FittedMaterial:
    """Parameters of a reflectance model, fitted to the photos of a terrain."""

    parameters: dict[str, Any]  # of the model
    lamps: dict[str, float]  # grey values per ms and unit radiance under each lamp
    rocks: dict[int, float]  # mean albedo factor by rock; the median of the ground is 1
    albedo: np.ndarray  # (v,) float32 factors, in the order of the terrain's meshes
    check: dict[str, Any] = field(default_factory=dict)  # errors on the held-out azimuth


@dataclass(frozen=True)
class FittedMaterials:
    """Fit of a terrain by domain of twins (`fitted`, or a reflectance model); no model if the fit failed.

    Photos of other azimuths and positions are held out: they affect only the brightness of their lamp.
    """

    models: dict[str, FittedMaterial]
    looks: np.ndarray  # (v,) number of fitted lamps and views in which a vertex is visible and lit
    azimuths: tuple[str, ...] = ()  # lamps whose photos are fitted, with `rover`
    positions: tuple[str, ...] = ()  # positions whose photos are fitted

    def of_domain(self, domain: str, model: str) -> FittedMaterials:
        """Return the fit of a domain only, under the name of its reflectance model."""
        return replace(self, models={model: self.models[domain]} if domain in self.models else {})


def write_materials(folder: Path, mesh: TerrainMesh, materials: FittedMaterials) -> None:
    """Write the fit of a terrain; `mesh` has the rock of each vertex."""
    table = pd.DataFrame({"rock": rock_of_vertex(mesh).astype(np.int32), "looks": materials.looks.astype(np.int32)})
    for model in sorted(materials.models):
        table[model] = materials.models[model].albedo.astype(np.float32)
    models = {
        model: {
            "parameters": fit.parameters,
            "lamps": {name: _rounded(gain) for name, gain in fit.lamps.items()},
            "rocks": {str(rock): _rounded(factor) for rock, factor in fit.rocks.items()},
            "check": fit.check,
        }
        for model, fit in materials.models.items()
    }
    content = {"azimuths": materials.azimuths, "positions": materials.positions, "models": models}
    with writing_folder(folder) as into:
        tables.write_parquet(into / ALBEDO_FILE, table)
        write_json(into / TABLE_FILE, content)


@reader("materials")
def read_materials(folder: Path, mesh: TerrainMesh) -> FittedMaterials:
    """Read the fit of a terrain with the meshes `mesh`."""
    try:
        content = _Table.model_validate(read_json(folder / TABLE_FILE))
    except ValidationError as error:
        raise FormatError(describe_error(error, "the file"), path=folder / TABLE_FILE) from error
    table = tables.read_parquet(folder / ALBEDO_FILE, ["rock", "looks", *content.models])
    if not np.array_equal(table["rock"].to_numpy(), rock_of_vertex(mesh)):
        raise FormatError(
            f"the {len(table)} vertices differ from the meshes of the terrain: run fit_materials again",
            path=folder / ALBEDO_FILE,
        )
    models = {
        model: FittedMaterial(fit.parameters, fit.lamps, fit.rocks, table[model].to_numpy(np.float32), fit.check)
        for model, fit in content.models.items()
    }
    return FittedMaterials(models, table["looks"].to_numpy(), content.azimuths, content.positions)


def files_of(folder: Path) -> list[Path]:
    """Return all files of a fit."""
    return [folder / ALBEDO_FILE, folder / TABLE_FILE]


def rock_of_vertex(mesh: TerrainMesh) -> np.ndarray:
    """Return the rock (v,) of every vertex; `NO_ROCK` for the ground and for vertices without face."""
    rock = np.full(len(mesh.vertices), NO_ROCK)
    rock[mesh.faces.ravel()] = np.repeat(mesh.rock_of_face, 3)
    return rock


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
