"""Evaluation of fitted materials: albedo against ground truth, and twins against held-out photos."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK, Terrain
from polarsim.run_files.materials import FittedMaterials, read_materials, rock_of_vertex
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.scoring.alignment import read_alignment
from polarsim.scoring.metrics import Metric, summary_metric, write_metrics
from polarsim.site import Site

ALBEDO_COLUMNS = ("rock", "x", "y", "z", "albedo", "pixels")
_MAX_DISTANCE = 0.02  # metres; maximum distance from a true point to the nearest vertex
_NEIGHBOURS = 3  # number of averaged vertices
_MIN_PIXELS = 4  # minimum number of pixels of a true mean
_STEPS = ("unfitted", "constant_albedo", "fitted")


def score_materials(
    *, site: Site, terrain: Terrain, materials: Path, meshes: Path, cameras: Path, truth: Path, evaluation: Path
) -> None:
    """Write the evaluation of the fitted materials of a terrain.

    `cameras` determine the alignment with the frame of the ground truth. Without `albedo.parquet` in `truth`, only
    errors on photos are computed.
    """
    mesh = read_terrain(meshes, terrain, site.sandbox_of(terrain))
    fitted = read_materials(materials, mesh)
    metrics = [metric for model, fit in sorted(fitted.models.items()) for metric in held_out_metrics(model, fit.check)]
    if (truth / "albedo.parquet").exists() and fitted.models:
        true = read_parquet(truth / "albedo.parquet", ALBEDO_COLUMNS)
        points = read_alignment(cameras, truth).inverse().apply(true[["x", "y", "z"]].to_numpy(float))
        metrics += albedo_metrics(fitted, mesh, true, points)
    write_metrics(evaluation, "materials", terrain, metrics)


def held_out_metrics(model: str, check: Mapping[str, Any]) -> list[Metric]:
    """Return the errors on the held-out azimuth, in stops, after a fit of the brightness of the lamp."""
    return [
        Metric(f"{model}, held-out {scale}", f"{step}_{kind}", check[scale][step][f"{kind}_stops"], "stops",
               int(check[scale]["count"]), "photos")
        for scale in ("pixels", "texels") if scale in check
        for step in _STEPS
        for kind in ("median", "rms")
    ]  # fmt: skip


def albedo_metrics(fitted: FittedMaterials, mesh: TerrainMesh, true: pd.DataFrame, points: np.ndarray) -> list[Metric]:
    """Return relative errors of albedo at true points (n, 3), near vertices that are lit in photos.

    The errors of a constant albedo are returned for comparison. Albedo is scaled to the median over the ground for each
    model, because the fit cannot separate the brightness of lamps from the brightness of albedo.
    """
    enough = true["pixels"].to_numpy() >= _MIN_PIXELS
    on_ground = true["rock"].to_numpy() == NO_ROCK
    albedo = true["albedo"].to_numpy(float)
    is_ground = rock_of_vertex(mesh) == NO_ROCK
    metrics: list[Metric] = []
    parts = {}
    for name, of_mesh, of_truth in (
        ("ground", is_ground, on_ground & enough),
        ("rocks", ~is_ground, ~on_ground & enough),
    ):
        vertices = np.flatnonzero(of_mesh)
        if len(vertices) < _NEIGHBOURS or not of_truth.any():
            continue
        distance, near = cKDTree(mesh.vertices[vertices]).query(points[of_truth], k=_NEIGHBOURS)
        distance, near = np.asarray(distance), vertices[near]
        usable = (distance[:, 0] < _MAX_DISTANCE) & (fitted.looks[near] > 0).any(axis=1)
        if usable.any():
            parts[name] = near[usable], albedo[of_truth][usable]
    if "ground" not in parts:
        return metrics
    for model, fit in sorted(fitted.models.items()):
        ratios = {name: fit.albedo[near].mean(axis=1) / true_albedo for name, (near, true_albedo) in parts.items()}
        scale = float(np.median(ratios["ground"]))
        for name, ratio in ratios.items():
            constant = parts[name][1] / np.median(parts["ground"][1]) - 1
            metrics += summary_metric(f"{model}, {name}", "albedo_error", np.abs(ratio / scale - 1), "1", "truth")
            metrics += summary_metric(f"{model}, {name}", "constant_error", np.abs(constant), "1", "truth", p90=False)
    return metrics
