"""How well rocks and ground were found and meshed: against the analog's true meshes, or the meshes' own soundness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import read_parquet, write_csv, write_parquet
from polarsim.geometry.poses import Pose, angle_between
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import read_terrain
from polarsim.schemas.evaluation import OFFSETS
from polarsim.scoring.cameras import projection_errors, true_points
from polarsim.scoring.mesh_scores import accuracy, f_score, mesh_table, soundness_rows
from polarsim.scoring.metrics import Metric, summary, write_metrics
from polarsim.scoring.rock_pairs import pair_rocks, recall_and_precision, size_classes, size_names
from polarsim.scoring.surface import Surface
from polarsim.scoring.true_surface import SEED, Comparison, compare

ROCK_COLUMNS = ("rock", "x", "y", "z", "size_m", "height_m", "volume_m3")
HAUSDORFF_SAMPLES = 4000  # points on a rock and on its thinned copy, besides all their vertices
SEEN_WIDTH = 0.5  # of a rock's size that scans must have seen for the rock to count as seen
BY_ROCK = (("surface_median_mm", "mm"), ("surface_p90_mm", "mm"), ("f_score_5mm", "1"), ("surface_iou", "1"))


def score_rocks(
    *,
    terrain: int,
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
    """Write the evaluation of a terrain's rocks and meshes, a row of scores for every mesh, and where meshes are off.

    Frames are brought together by the poses that the meshes were made with: there, meshes and cameras must agree. What
    the surfaces are worth by themselves is measured after one more small rigid ICP of the terrain's ground; how far
    that went is a metric of its own. In this frame of the meshes the refined cameras are asked where they put true
    rocks.

    Parameters
    ----------
    rocks
        rocks.parquet.
    meshes
        Folder of the terrain's meshes.
    located, cameras
        Folders with the poses that the meshes were made with, and with the refined ones.
    scores
        Table of the meshes that is written, see `mesh_scores.COLUMNS`.
    offsets
        Table that is written, a row a point on our seen surface: rock, x, y, z (true frame), offset_mm, the distance
        to the true surface, below 0 inside it. Without truth it has no row.
    truth
        The analog's truth/TerrainTT; None where there is none.
    """
    found = read_parquet(rocks, ROCK_COLUMNS)
    scene = read_terrain(meshes, terrain)
    against_truth: list[Metric] = []
    off = pd.DataFrame(columns=list(OFFSETS.columns)).astype(OFFSETS.dtypes)
    rows = soundness_rows(scene, meshes, terrain, generator(SEED, "mesh samples", terrain), HAUSDORFF_SAMPLES)
    if truth is not None:
        true = read_parquet(truth / "rocks.parquet", ROCK_COLUMNS)
        compared = compare(terrain, scene, located, truth, inventory)
        against_truth, own = _against_truth(true, found, compared)
        against_truth += _in_cameras_frame(true, found, compared, Surface(scene.vertices, scene.faces))
        against_truth += _reprojection(terrain, cameras, truth, compared)
        off = compared.ours.table().astype(OFFSETS.dtypes)
        rows = [{**row, **own.get(int(str(row["rock"])), {})} for row in rows]
    table = mesh_table(rows)
    metrics = counts(found) + soundness(table) + against_truth + _copies(table) + _by_rock(table)
    write_metrics(evaluation, "rocks", terrain, metrics)
    write_csv(scores, table)
    write_parquet(offsets, off)


def _in_cameras_frame(true: pd.DataFrame, found: pd.DataFrame, compared: Comparison, surface: Surface) -> list[Metric]:
    """Distances of the true surface from ours where the cameras put it: nothing is laid on anything by surfaces."""
    sandbox_from_truth = compared.by_cameras.inverse()
    distance_mm = 1000 * surface.distance(sandbox_from_truth.apply(compared.true.points))
    paired = true["rock"].to_numpy()[pair_rocks(true, _moved(found, compared.by_cameras)).true]
    points_of = {rock: distance_mm[compared.true.rock == rock] for rock in paired}
    rocks_mm = np.array([np.median(mine) for mine in points_of.values() if len(mine)])
    ground_mm = distance_mm[compared.true.rock == NO_ROCK]
    return [
        *summary("paired rocks, cameras' frame", "surface_median_by_rock", rocks_mm, "mm", "truth"),
        *summary("ground, cameras' frame", "surface_distance", ground_mm, "mm", "truth"),
    ]


def _moved(found: pd.DataFrame, truth_from_sandbox: Pose) -> pd.DataFrame:
    """The table of found rocks with their positions in the true frame."""
    points = truth_from_sandbox.apply(found[["x", "y", "z"]].to_numpy(float).reshape(-1, 3))
    return found.assign(x=points[:, 0], y=points[:, 1], z=points[:, 2])


def _reprojection(terrain: int, cameras: Path, truth: Path, compared: Comparison) -> list[Metric]:
    """How far from its true pixel a true rock's point is seen, with the meshes laid on the true surface."""
    localised, true = read_all_localised(cameras), read_all_localised(truth / "cameras")
    points = true_points(truth, terrain)
    return [
        metric
        for position in sorted(set(localised) & set(true))
        for metric in projection_errors(
            "rock_reprojection", position, localised[position], true[position], points, compared.truth_from_sandbox
        )
    ]


def counts(found: pd.DataFrame) -> list[Metric]:
    """How many rocks of which size there are."""
    size_cm = 100 * found["size_m"].to_numpy(float)
    (large, small), names = size_classes(size_cm), size_names()
    n = len(found)
    return [
        Metric("rocks", "count", n, "rocks", n, "own"),
        Metric(names[0], "count", int(large.sum()), "rocks", n, "own"),
        Metric(names[1], "count", int(small.sum()), "rocks", n, "own"),
    ]


def soundness(table: pd.DataFrame) -> list[Metric]:
    """Closedness, islands and sizes of the full meshes, from their rows."""
    metrics: list[Metric] = []
    rocks, ground = table[table["rock"] != NO_ROCK], table[table["rock"] == NO_ROCK].iloc[0]
    if len(rocks):
        n = len(rocks)
        metrics += [
            Metric("rock meshes", "watertight_share", float(rocks["watertight"].mean()), "1", n, "own"),
            Metric("rock meshes", "one_island_share", float((rocks["islands"] == 1).mean()), "1", n, "own"),
            Metric("rock meshes", "vertices_median", float(rocks["vertices"].median()), "vertices", n, "own"),
        ]
    metrics.append(Metric("ground mesh", "islands", int(ground["islands"]), "islands", 1, "own"))
    metrics.append(Metric("ground mesh", "vertices", int(ground["vertices"]), "vertices", 1, "own"))
    return metrics


def _copies(table: pd.DataFrame) -> list[Metric]:
    """How rocks meet the ground, and how near their thinned copies are."""
    rocks = table[table["rock"] != NO_ROCK]
    if not len(rocks):
        return []
    n, copies = len(rocks), rocks.dropna(subset=["copy_hausdorff_mm"])
    metrics = [Metric("rock meshes", "contact_share", float(rocks["contact_share"].mean()), "1", n, "own")]
    if len(copies):
        worst, sound = copies["copy_hausdorff_mm"].max(), copies["copy_watertight"].mean()
        share = copies["copy_vertex_share"].median()
        metrics += [
            Metric("thinned copies", "hausdorff_max", float(worst), "mm", len(copies), "own"),
            Metric("thinned copies", "watertight_share", float(sound), "1", len(copies), "own"),
            Metric("thinned copies", "vertex_share_median", float(share), "1", len(copies), "own"),
        ]
    return metrics


def _by_rock(table: pd.DataFrame) -> list[Metric]:
    """Medians over rocks of each rock's own metrics, by true size; and the ground's F-score."""
    metrics = []
    scored = table.dropna(subset=["surface_median_mm"])
    members = size_classes(100 * scored["true_size_m"].to_numpy(float))
    for name, mine in zip(size_names(), members, strict=True):
        for column, unit in BY_ROCK if mine.any() else ():
            value = float(scored.loc[mine, column].median())
            metrics.append(Metric(name, f"{column.removesuffix('_mm')}_by_rock", value, unit, int(mine.sum()), "truth"))
    ground = scored[scored["rock"] == NO_ROCK]
    if len(ground):
        metrics.append(Metric("ground", "f_score_5mm", float(ground["f_score_5mm"].iloc[0]), "1", 1, "truth"))
    return metrics


def _against_truth(
    true: pd.DataFrame, found: pd.DataFrame, compared: Comparison
) -> tuple[list[Metric], dict[int, dict[str, float]]]:
    """Metrics of the terrain, and those of each found rock and of the ground."""
    in_truth = _moved(found, compared.truth_from_sandbox)
    pairs = pair_rocks(true, in_truth)
    there, back = compared.true, compared.ours
    metrics = recall_and_precision(true, in_truth, pairs, _wide_seen(true, there.points, there.rock))
    true_rocks, found_rocks = true["rock"].to_numpy()[pairs.true], found["rock"].to_numpy()[pairs.found]
    paired, level = np.isin(there.rock, true_rocks), there.rock == NO_ROCK
    metrics += summary("paired rocks", "surface_distance", 1000 * there.distance[paired], "mm", "truth")
    metrics += summary("ground", "surface_distance", 1000 * there.distance[level], "mm", "truth")
    if paired.any():
        score = f_score(there.distance[paired], back.distance[np.isin(back.rock, found_rocks)])
        metrics.append(Metric("paired rocks", "f_score_5mm", score, "1", int(paired.sum()), "truth"))
    own = accuracy(there, back, dict(zip(found_rocks.tolist(), true_rocks.tolist(), strict=True)))
    sizes = true["size_m"].to_numpy(float)[pairs.true]
    for rock, size in zip(found_rocks.tolist(), sizes.tolist(), strict=True):
        own.setdefault(rock, {})["true_size_m"] = size
    return metrics + _alignment_metrics(compared), own


def _wide_seen(true: pd.DataFrame, points: np.ndarray, rock: np.ndarray) -> np.ndarray:
    """(n,) bool: true rocks of which scans saw enough width, by points (m, 3) on seen surface and the rock of each."""
    width = [np.ptp(points[rock == one, :2], axis=0).max() if (rock == one).any() else 0.0 for one in true["rock"]]
    return np.array(width) >= SEEN_WIDTH * true["size_m"].to_numpy(float)


def _alignment_metrics(compared: Comparison) -> list[Metric]:
    points, alignment, by_cameras = compared.true.points, compared.truth_from_sandbox, compared.by_cameras
    moved_mm = 1000 * np.linalg.norm(alignment.inverse().apply(points) - by_cameras.inverse().apply(points), axis=1)
    rotation_deg = float(np.degrees(angle_between(by_cameras, alignment)))
    return [
        Metric("frame", "icp_translation_median", float(np.median(moved_mm)), "mm", len(points), "truth"),
        Metric("frame", "icp_rotation", rotation_deg, "deg", len(points), "truth"),
    ]
