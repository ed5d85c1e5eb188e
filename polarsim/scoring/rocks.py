"""Evaluation of rocks and meshes: topology of all meshes, and errors against the ground truth of the analog."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet, typed, write_csv, write_parquet
from polarsim.geometry.poses import angle_between
from polarsim.photo import NO_ROCK, CameraSide, Terrain
from polarsim.randomness import generator
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import read_terrain
from polarsim.schemas.evaluation import OFFSETS
from polarsim.scoring.cameras import projection_errors, true_points
from polarsim.scoring.mesh_scores import accuracy, f_score, mesh_table, soundness_rows
from polarsim.scoring.metrics import Metric, metrics_of, summary_metric, write_metrics
from polarsim.scoring.rock_pairs import pair_rocks, recall_and_precision, size_classes, size_names
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import SEED, Comparison, compare_surfaces
from polarsim.site import Site

ROCK_COLUMNS = ("rock", "x", "y", "z", "size_m", "height_m", "volume_m3")
HAUSDORFF_SAMPLES = 4000  # points on a rock and on the decimated copy, in addition to all vertices
SEEN_WIDTH = 0.5  # minimum visible width of a visible rock, as a share of the size
BY_ROCK = (("surface_median_mm", "mm"), ("surface_p90_mm", "mm"), ("f_score_5mm", "1"), ("surface_iou", "1"))


def score_rocks(
    *,
    site: Site,
    terrain: Terrain,
    rocks: Path,
    meshes: Path,
    located: Path,
    cameras: Path,
    truth: Path | None,
    inventory: Path | None,
    evaluation: Path,
    scores: Path,
    offsets: Path,
) -> None:
    """Write the evaluation of the rocks and meshes of a terrain, the scores of meshes, and the offsets of surfaces.

    The frames of run and ground truth are aligned by the poses for which the meshes were reconstructed. Surfaces are
    compared after a small rigid ICP of the ground; the motion of the ICP is also a metric. In this frame, true rocks
    are projected by the refined cameras. `located` has the poses for which the meshes were reconstructed, `cameras` the
    refined poses; `truth` is the folder truth/TerrainTT of the analog or None. `offsets` has a row per sample of the
    visible reconstructed surface, empty without ground truth, see `OFFSETS`.
    """
    found = read_parquet(rocks, ROCK_COLUMNS)
    sandbox = site.sandbox_of(terrain)
    scene = read_terrain(meshes, terrain, sandbox)
    against_truth: list[Metric] = []
    offset_table = typed([], OFFSETS)
    rows = soundness_rows(scene, meshes, terrain, generator(SEED, "mesh samples", terrain), HAUSDORFF_SAMPLES)
    if truth is not None:
        true = read_parquet(truth / "rocks.parquet", ROCK_COLUMNS)
        compared = compare_surfaces(sandbox, terrain, scene, located, truth, inventory)
        against_truth, of_rocks = _against_truth(true, found, compared)
        against_truth += _in_cameras_frame(true, found, compared, Surface(scene.vertices, scene.faces))
        against_truth += _reprojection(terrain, cameras, truth, compared, site.cameras.sides)
        offset_table = typed(compared.reconstructed.table(), OFFSETS)
        rows = [{**row, **of_rocks.get(int(str(row["rock"])), {})} for row in rows]
    table = mesh_table(rows)
    metrics = counts(found) + soundness(table) + against_truth + _copies(table) + _by_rock(table)
    write_metrics(evaluation, "rocks", terrain, metrics)
    write_csv(scores, table)
    write_parquet(offsets, offset_table)


def _in_cameras_frame(true: pd.DataFrame, found: pd.DataFrame, compared: Comparison, surface: Surface) -> list[Metric]:
    """Return the distances of the true from the reconstructed surface after the alignment by cameras, without ICP."""
    sandbox_from_truth = compared.by_cameras.inverse()
    distance_mm = 1000 * surface.distance(sandbox_from_truth.apply(compared.true.points))
    paired = true["rock"].to_numpy()[pair_rocks(true, found, compared.by_cameras).true]
    points_of = {rock: distance_mm[compared.true.rock == rock] for rock in paired}
    rocks_mm = np.array([np.median(distances) for distances in points_of.values() if len(distances)])
    ground_mm = distance_mm[compared.true.rock == NO_ROCK]
    return [
        *summary_metric("paired rocks, cameras' frame", "surface_median_by_rock", rocks_mm, "mm", "truth"),
        *summary_metric("ground, cameras' frame", "surface_distance", ground_mm, "mm", "truth"),
    ]


def _reprojection(
    terrain: Terrain, cameras: Path, truth: Path, compared: Comparison, sides: Sequence[CameraSide]
) -> list[Metric]:
    """Return the reprojection errors of points of true rocks, with the meshes aligned with the true surface."""
    localised, true = read_all_localised(cameras), read_all_localised(truth / "cameras")
    points = true_points(truth, terrain)
    return [
        metric
        for position in sorted(set(localised) & set(true))
        for metric in projection_errors(
            "rock_reprojection",
            position,
            localised[position],
            true[position],
            points,
            compared.truth_from_sandbox,
            sides,
        )
    ]


def counts(found: pd.DataFrame) -> list[Metric]:
    """Return the numbers of rocks by size class."""
    classes = [np.ones(len(found), bool), *size_classes(100 * found["size_m"].to_numpy(float))]
    return [
        Metric(name, "count", int(members.sum()), "rocks", len(found), "own")
        for name, members in zip(("rocks", *size_names()), classes, strict=True)
    ]


def soundness(table: pd.DataFrame) -> list[Metric]:
    """Return watertightness, number of connected components and sizes of the full meshes."""
    metrics: list[Metric] = []
    rocks, ground = table[table["rock"] != NO_ROCK], table[table["rock"] == NO_ROCK].iloc[0]
    if len(rocks):
        metrics += metrics_of(
            "rock meshes", len(rocks), "own",
            watertight_share=(rocks["watertight"].mean(), "1"),
            one_island_share=((rocks["islands"] == 1).mean(), "1"),
            vertices_median=(rocks["vertices"].median(), "vertices"),
        )  # fmt: skip
    sizes = {name: (ground[name], name) for name in ("islands", "vertices")}
    return metrics + metrics_of("ground mesh", 1, "own", **sizes)


def _copies(table: pd.DataFrame) -> list[Metric]:
    """Return the contact of rocks with the ground and the accuracy of decimated copies."""
    rocks = table[table["rock"] != NO_ROCK]
    copies = rocks.dropna(subset=["copy_hausdorff_mm"])
    metrics: list[Metric] = []
    if len(rocks):
        metrics += metrics_of("rock meshes", len(rocks), "own", contact_share=(rocks["contact_share"].mean(), "1"))
    if len(copies):
        metrics += metrics_of(
            "thinned copies", len(copies), "own",
            hausdorff_max=(copies["copy_hausdorff_mm"].max(), "mm"),
            watertight_share=(copies["copy_watertight"].mean(), "1"),
            vertex_share_median=(copies["copy_vertex_share"].median(), "1"),
        )  # fmt: skip
    return metrics


def _by_rock(table: pd.DataFrame) -> list[Metric]:
    """Return medians over rocks of the metrics of each rock, by true size class, and the F-score of the ground."""
    metrics = []
    scored = table.dropna(subset=["surface_median_mm"])
    members = size_classes(100 * scored["true_size_m"].to_numpy(float))
    for name, in_class in zip(size_names(), members, strict=True):
        for column, unit in BY_ROCK if in_class.any() else ():
            value, n = float(scored.loc[in_class, column].median()), int(in_class.sum())
            metrics.append(Metric(name, f"{column.removesuffix('_mm')}_by_rock", value, unit, n, "truth"))
    ground = scored[scored["rock"] == NO_ROCK]
    if len(ground):
        metrics.append(Metric("ground", "f_score_5mm", float(ground["f_score_5mm"].iloc[0]), "1", 1, "truth"))
    return metrics


def _against_truth(
    true: pd.DataFrame, found: pd.DataFrame, compared: Comparison
) -> tuple[list[Metric], dict[int, dict[str, float]]]:
    """Return the metrics of the terrain, and the metrics of each detected rock and of the ground."""
    pairs = pair_rocks(true, found, compared.truth_from_sandbox)
    samples, reconstructed = compared.true, compared.reconstructed
    metrics = recall_and_precision(true, found, pairs, _is_visible(true, samples.points, samples.rock))
    true_rocks, found_rocks = true["rock"].to_numpy()[pairs.true], found["rock"].to_numpy()[pairs.found]
    paired, level = np.isin(samples.rock, true_rocks), samples.rock == NO_ROCK
    metrics += summary_metric("paired rocks", "surface_distance", 1000 * samples.distance[paired], "mm", "truth")
    metrics += summary_metric("ground", "surface_distance", 1000 * samples.distance[level], "mm", "truth")
    if paired.any():
        score = f_score(samples.distance[paired], reconstructed.distance[np.isin(reconstructed.rock, found_rocks)])
        metrics.append(Metric("paired rocks", "f_score_5mm", score, "1", int(paired.sum()), "truth"))
    of_rocks = accuracy(samples, reconstructed, dict(zip(found_rocks.tolist(), true_rocks.tolist(), strict=True)))
    sizes = true["size_m"].to_numpy(float)[pairs.true]
    for rock, size in zip(found_rocks.tolist(), sizes.tolist(), strict=True):
        of_rocks.setdefault(rock, {})["true_size_m"] = size
    return metrics + _alignment_metrics(compared), of_rocks


def _is_visible(true: pd.DataFrame, points: np.ndarray, rock_of_point: np.ndarray) -> np.ndarray:
    """Return (n,) bool: true rocks with enough visible width, from points (m, 3) on visible surfaces."""
    parts = [points[rock_of_point == rock, :2] for rock in true["rock"]]
    width = [np.ptp(part, axis=0).max() if len(part) else 0.0 for part in parts]
    return np.array(width) >= SEEN_WIDTH * true["size_m"].to_numpy(float)


def _alignment_metrics(compared: Comparison) -> list[Metric]:
    points, alignment, by_cameras = compared.true.points, compared.truth_from_sandbox, compared.by_cameras
    moved_mm = 1000 * np.linalg.norm(alignment.inverse().apply(points) - by_cameras.inverse().apply(points), axis=1)
    rotation_deg = float(np.degrees(angle_between(by_cameras, alignment)))
    values = {"icp_translation_median": (float(np.median(moved_mm)), "mm"), "icp_rotation": (rotation_deg, "deg")}
    return metrics_of("frame", len(points), "truth", **values)
