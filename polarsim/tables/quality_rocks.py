"""How well rocks and ground were found and meshed: against the analog's true meshes, or the meshes' own soundness."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from polarsim.formats.inventory import read_inventory
from polarsim.formats.rigs import read_all_placed
from polarsim.formats.scene import TerrainMesh, read_terrain
from polarsim.formats.tables import read_parquet, write_csv
from polarsim.geometry.poses import Pose, angle_between
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator
from polarsim.survey import SANDBOX_HALF_WIDTH
from polarsim.tables.gauge import refine_gauge
from polarsim.tables.mesh_scores import accuracy, f_score, mesh_table, soundness_rows
from polarsim.tables.options import TablesOptions
from polarsim.tables.quality import Figure, summary, write_quality
from polarsim.tables.quality_cameras import read_gauge
from polarsim.tables.sight import Sight, sights
from polarsim.tables.surface import Surface

ROCK_COLUMNS = ("rock", "x", "y", "z", "size_m", "height_m", "volume_m3")
MATCH_RADIUS = 0.5  # of the true size: how far the centre of a found rock may be off
SMALLEST_RADIUS = 0.03  # metres
HAUSDORFF_SAMPLES = 4000  # points on a rock and on its thinned copy, besides all their vertices
EDGE = 0.1  # metres: a strip along the walls does not count as ground


@dataclass(frozen=True)
class RockPairs:
    """Found rocks and true ones: row numbers that belong together, one to one."""

    true: np.ndarray  # (p,)
    found: np.ndarray  # (p,)


def score_rocks(
    *,
    terrain: int,
    rocks: Path,
    meshes: Path,
    cameras: Path,
    truth: Path | None,
    inventory: Path | None,
    quality: Path,
    scores: Path,
    options: TablesOptions,
) -> None:
    """Write the quality of a terrain's rocks and meshes, and a row of scores for every mesh.

    Frames are brought together by the camera poses, then by one small rigid ICP of the terrain's ground; how far that
    went is a figure of its own.

    Parameters
    ----------
    rocks
        rocks.parquet.
    meshes, cameras
        Folders of the terrain.
    scores
        Table of the meshes that is written, see `mesh_scores.COLUMNS`.
    truth
        The analog's truth/TerrainTT; None where there is none.
    """
    found = read_parquet(rocks, ROCK_COLUMNS)
    scene = read_terrain(meshes, terrain)
    against_truth: list[Figure] = []
    rows = soundness_rows(scene, meshes, terrain, generator(options.seed, "mesh samples", terrain), HAUSDORFF_SAMPLES)
    if truth is not None:
        against_truth, own = _against_truth(terrain, found, scene, cameras, truth, inventory, options)
        rows = [{**row, **own.get(int(str(row["rock"])), {})} for row in rows]
    table = mesh_table(rows)
    figures = counts(found, options) + soundness(table) + against_truth + _copies(table) + _by_rock(table, options)
    write_quality(quality, "rocks", terrain, figures)
    write_csv(scores, table)


def counts(found: pd.DataFrame, options: TablesOptions) -> list[Figure]:
    """How many rocks of which size there are."""
    size_cm = 100 * found["size_m"].to_numpy(float)
    large, small = _size_classes(size_cm, options)
    n = len(found)
    return [
        Figure("rocks", "count", n, "rocks", n, "own"),
        Figure(_large(options), "count", int(large.sum()), "rocks", n, "own"),
        Figure(_small(options), "count", int(small.sum()), "rocks", n, "own"),
    ]


def soundness(table: pd.DataFrame) -> list[Figure]:
    """Closedness, islands and sizes of the full meshes, from their rows."""
    figures: list[Figure] = []
    rocks, ground = table[table["rock"] != NO_ROCK], table[table["rock"] == NO_ROCK].iloc[0]
    if len(rocks):
        n = len(rocks)
        figures += [
            Figure("rock meshes", "watertight_share", float(rocks["watertight"].mean()), "1", n, "own"),
            Figure("rock meshes", "one_island_share", float((rocks["islands"] == 1).mean()), "1", n, "own"),
            Figure("rock meshes", "vertices_median", float(rocks["vertices"].median()), "vertices", n, "own"),
        ]
    figures.append(Figure("ground mesh", "islands", int(ground["islands"]), "islands", 1, "own"))
    figures.append(Figure("ground mesh", "vertices", int(ground["vertices"]), "vertices", 1, "own"))
    return figures


def pair_rocks(true: pd.DataFrame, found: pd.DataFrame) -> RockPairs:
    """One-to-one pairs of the smallest summed distance of centres, none beyond half the true rock's size.

    Both tables in one frame.
    """
    if not len(true) or not len(found):
        return RockPairs(np.zeros(0, int), np.zeros(0, int))
    centres = [table[["x", "y", "z"]].to_numpy(float) for table in (true, found)]
    distance = np.linalg.norm(centres[0][:, None] - centres[1][None], axis=-1)
    radius = np.maximum(MATCH_RADIUS * true["size_m"].to_numpy(float), SMALLEST_RADIUS)[:, None]
    gain = np.where(distance < radius, 2 - distance / radius, 0.0)  # many pairs first, then near ones
    rows, columns = linear_sum_assignment(-gain)
    good = distance[rows, columns] < radius[rows, 0]
    return RockPairs(rows[good], columns[good])


def recall_and_precision(
    true: pd.DataFrame, found: pd.DataFrame, pairs: RockPairs, options: TablesOptions
) -> list[Figure]:
    """Share of true rocks found and of found rocks true, by size, and how sizes differ.

    A rock counts by its own size: a true one for recall, a found one for precision.
    """
    figures = []
    true_cm, found_cm = (100 * table["size_m"].to_numpy(float) for table in (true, found))
    for number, subject in enumerate((_large(options), _small(options))):
        wanted, given = _size_classes(true_cm, options)[number], _size_classes(found_cm, options)[number]
        for name, members, hits in (("recall", wanted, pairs.true), ("precision", given, pairs.found)):
            if members.any():
                share = float(np.isin(np.flatnonzero(members), hits).mean())
                figures.append(Figure(subject, name, share, "1", int(members.sum()), "truth"))
    for column, name in (("size_m", "size_error"), ("height_m", "height_error")):
        difference = found[column].to_numpy(float)[pairs.found] - true[column].to_numpy(float)[pairs.true]
        figures += summary("paired rocks", name, 1000 * np.abs(difference), "mm", "truth")
    ratio = found["volume_m3"].to_numpy(float)[pairs.found] / true["volume_m3"].to_numpy(float)[pairs.true]
    return figures + summary("paired rocks", "volume_ratio", ratio, "1", "truth", p90=False)


def _copies(table: pd.DataFrame) -> list[Figure]:
    """How rocks meet the ground, and how near their thinned copies are."""
    rocks = table[table["rock"] != NO_ROCK]
    if not len(rocks):
        return []
    n, copies = len(rocks), rocks.dropna(subset=["copy_hausdorff_mm"])
    figures = [Figure("rock meshes", "contact_share", float(rocks["contact_share"].mean()), "1", n, "own")]
    if len(copies):
        worst, sound = copies["copy_hausdorff_mm"].max(), copies["copy_watertight"].mean()
        share = copies["copy_vertex_share"].median()
        figures += [
            Figure("thinned copies", "hausdorff_max", float(worst), "mm", len(copies), "own"),
            Figure("thinned copies", "watertight_share", float(sound), "1", len(copies), "own"),
            Figure("thinned copies", "vertex_share_median", float(share), "1", len(copies), "own"),
        ]
    return figures


def _by_rock(table: pd.DataFrame, options: TablesOptions) -> list[Figure]:
    """Medians over rocks of each rock's own figures, by true size; and the ground's F-score."""
    figures = []
    scored = table.dropna(subset=["surface_median_mm"])
    for name, members in zip(
        (_large(options), _small(options)),
        _size_classes(100 * scored["true_size_m"].to_numpy(float), options),
        strict=True,
    ):
        rocks = scored[members]
        for column, figure, unit in (
            ("surface_median_mm", "surface_median_by_rock", "mm"),
            ("surface_p90_mm", "surface_p90_by_rock", "mm"),
            ("f_score_5mm", "f_score_5mm_by_rock", "1"),
        ):
            if len(rocks):
                figures.append(Figure(name, figure, float(rocks[column].median()), unit, len(rocks), "truth"))
    ground = scored[scored["rock"] == NO_ROCK]
    if len(ground):
        figures.append(Figure("ground", "f_score_5mm", float(ground["f_score_5mm"].iloc[0]), "1", 1, "truth"))
    return figures


def _against_truth(
    terrain: int,
    found: pd.DataFrame,
    our_scene: TerrainMesh,
    cameras: Path,
    truth: Path,
    inventory: Path | None,
    options: TablesOptions,
) -> tuple[list[Figure], dict[int, dict[str, float]]]:
    """Figures of the terrain, and those of each found rock and of the ground."""
    true = read_parquet(truth / "rocks.parquet", ROCK_COLUMNS)
    by_cameras, views = read_gauge(cameras, truth), _sights(cameras, truth, inventory)
    true_scene = read_terrain(truth / "meshes", terrain)
    true_surface = Surface(true_scene.vertices, true_scene.faces)
    our_surface = Surface(our_scene.vertices, our_scene.faces)
    rng = generator(options.seed, "surface samples", terrain)
    points, rock = _seen_points(true_surface, true_scene.rock_of_face, views, options.surface_samples, rng)
    gauge = refine_gauge(by_cameras, points[rock == NO_ROCK], our_surface)

    in_truth = found.copy()
    in_truth[["x", "y", "z"]] = gauge.apply(found[["x", "y", "z"]].to_numpy(float).reshape(-1, 3))
    pairs = pair_rocks(true, in_truth)
    figures = recall_and_precision(true, in_truth, pairs, options)

    distance_mm = 1000 * our_surface.distance(gauge.inverse().apply(points))
    paired = np.isin(rock, true["rock"].to_numpy()[pairs.true])
    figures += summary("paired rocks", "surface_distance", distance_mm[paired], "mm", "truth")
    figures += summary("ground", "surface_distance", distance_mm[rock == NO_ROCK], "mm", "truth")
    moved = Surface(gauge.apply(our_scene.vertices), our_scene.faces)
    ours, our_rock = _seen_points(moved, our_scene.rock_of_face, views, options.surface_samples, rng)
    back = true_surface.distance(ours)
    size_of_true = dict(zip(true["rock"].tolist(), true["size_m"].tolist(), strict=True))
    true_of_found = dict(
        zip(found["rock"].to_numpy()[pairs.found].tolist(), true["rock"].to_numpy()[pairs.true].tolist(), strict=True)
    )
    paired_back = back[np.isin(our_rock, list(true_of_found))]
    if paired.any():
        score = f_score(distance_mm[paired] / 1000, paired_back)
        figures.append(Figure("paired rocks", "f_score_5mm", score, "1", int(paired.sum()), "truth"))
    own = accuracy(rock, distance_mm / 1000, our_rock, back, true_of_found)
    for one, true_rock in true_of_found.items():
        own.setdefault(one, {})["true_size_m"] = size_of_true[true_rock]
    return figures + _gauge_figures(by_cameras, gauge, points), own


def _sights(cameras: Path, truth: Path, inventory: Path | None) -> list[Sight]:
    known = read_inventory(inventory) if inventory is not None else None
    return sights(read_all_placed(truth / "cameras"), set(read_all_placed(cameras)), known)


def _seen_points(
    surface: Surface, rock_of_face: np.ndarray, views: list[Sight], n: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Points on a surface in the true frame that were seen, and the rock of each: of n on rocks and n on ground.

    What nobody saw nobody can measure: undersides, and ground below rocks. A strip along the walls is left out.
    """
    parts = []
    for wanted in (rock_of_face != NO_ROCK, rock_of_face == NO_ROCK):
        if not wanted.any():
            continue
        faces = np.flatnonzero(wanted)
        part = Surface(surface.vertices, surface.faces[faces])
        points, face = part.sample(n, rng)
        seen = np.logical_or.reduce([view.sees(surface, points, part.normals[face]) for view in views])
        seen &= (np.abs(points[:, :2]) < SANDBOX_HALF_WIDTH - EDGE).all(axis=1)
        parts.append((points[seen], rock_of_face[faces[face[seen]]]))
    return np.concatenate([points for points, _ in parts]), np.concatenate([rock for _, rock in parts])


def _gauge_figures(by_cameras: Pose, gauge: Pose, points: np.ndarray) -> list[Figure]:
    moved_mm = 1000 * np.linalg.norm(gauge.inverse().apply(points) - by_cameras.inverse().apply(points), axis=1)
    turned_deg = float(np.degrees(angle_between(by_cameras, gauge)))
    return [
        Figure("frame", "icp_shift_median", float(np.median(moved_mm)), "mm", len(points), "truth"),
        Figure("frame", "icp_turn", turned_deg, "deg", len(points), "truth"),
    ]


def _size_classes(size_cm: np.ndarray, options: TablesOptions) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool of the large and of the small rocks."""
    large = size_cm >= options.large_rock_cm
    return large, (size_cm >= options.small_rock_cm) & ~large


def _large(options: TablesOptions) -> str:
    return f"rocks of {options.large_rock_cm:g} cm and more"


def _small(options: TablesOptions) -> str:
    return f"rocks of {options.small_rock_cm:g} to {options.large_rock_cm:g} cm"
