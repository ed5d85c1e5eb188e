"""How near fitted albedo comes to the true one, and twins with it to photos that were held out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK
from polarsim.run_files.materials import FittedMaterials, read_materials, rock_of_vertex
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.alignment import read_alignment
from polarsim.scoring.metrics import Metric, summary, write_metrics

ALBEDO_COLUMNS = ("rock", "x", "y", "z", "albedo", "pixels")
_REACH = 0.02  # metres from a true point to the vertices that tell of it
_CORNERS = 3  # vertices that are averaged there
_PIXELS = 4  # that a true mean must rest on
_STEPS = ("unfitted", "constant_albedo", "fitted")


def score_materials(
    *, terrain: int, materials: Path, meshes: Path, cameras: Path, truth: Path, evaluation: Path
) -> None:
    """Write the evaluation of a terrain's fitted materials.

    Parameters
    ----------
    cameras : Path
        Folder of rig poses: they tell where our sandbox lies in the true one.
    truth : Path
        The terrain's truth folder; without `albedo.parquet` only errors on photos are told.
    """
    mesh = read_terrain(meshes, terrain)
    found = read_materials(materials, mesh)
    metrics = [metric for model, fit in sorted(found.models.items()) for metric in held_out_metrics(model, fit.check)]
    if (truth / "albedo.parquet").exists() and found.models:
        true = read_parquet(truth / "albedo.parquet", ALBEDO_COLUMNS)
        points = read_alignment(cameras, truth).inverse().apply(true[["x", "y", "z"]].to_numpy(float))
        metrics += albedo_metrics(found, mesh, true, points)
    write_metrics(evaluation, "materials", terrain, metrics)


def held_out_metrics(model: str, check: Mapping[str, Any]) -> list[Metric]:
    """Errors on the azimuth that was held out, in stops, one brightness of its lamp taken out."""
    return [
        Metric(f"{model}, held-out {scale}", f"{step}_{kind}", check[scale][step][f"{kind}_stops"], "stops",
               int(check[scale]["count"]), "photos")
        for scale in ("pixels", "texels") if scale in check
        for step in _STEPS
        for kind in ("median", "rms")
    ]  # fmt: skip


def albedo_metrics(found: FittedMaterials, mesh: TerrainMesh, true: pd.DataFrame, points: np.ndarray) -> list[Metric]:
    """Relative errors of albedo at true points (n, 3), on one scale a model, at vertices that photos show lit.

    Beside them the errors of one constant albedo. The scale is the median over the ground, for brightness of lamps and
    of albedo cannot be told apart.
    """
    enough = true["pixels"].to_numpy() >= _PIXELS
    on_ground = true["rock"].to_numpy() == NO_ROCK
    albedo = true["albedo"].to_numpy(float)
    is_ground = rock_of_vertex(mesh) == NO_ROCK
    metrics: list[Metric] = []
    parts = {}
    for name, ours, theirs in (("ground", is_ground, on_ground & enough), ("rocks", ~is_ground, ~on_ground & enough)):
        vertices = np.flatnonzero(ours)
        if len(vertices) < _CORNERS or not theirs.any():
            continue
        far, near = cKDTree(mesh.vertices[vertices]).query(points[theirs], k=_CORNERS)
        far, near = np.asarray(far), vertices[near]
        known = (far[:, 0] < _REACH) & (found.looks[near] > 0).any(axis=1)
        if known.any():
            parts[name] = near[known], albedo[theirs][known]
    if "ground" not in parts:
        return metrics
    for model, fit in sorted(found.models.items()):
        ratios = {name: fit.albedo[near].mean(axis=1) / own for name, (near, own) in parts.items()}
        scale = float(np.median(ratios["ground"]))
        for name, ratio in ratios.items():
            own = parts[name][1]
            constant = own / np.median(parts["ground"][1]) - 1
            metrics += summary(f"{model}, {name}", "albedo_error", np.abs(ratio / scale - 1), "1", "truth")
            metrics += summary(f"{model}, {name}", "constant_error", np.abs(constant), "1", "truth", p90=False)
    return metrics
