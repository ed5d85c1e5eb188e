"""Consistency of the scans, cameras, meshes and boxes of a run, without ground truth.

- A fitted ground is compared with the feet of the published rocks.
- Each scan, and all scans together, are transformed by the written poses and aligned with the written meshes. The
  remaining motion is the metric.
- Cameras after refinement are compared with the cameras for which the meshes were reconstructed.
- Projected meshes are compared with the boxes that localised the cameras.
- Shadow edges of walls, predicted from walls, lamps and ground, are compared with the photos (`wall_shadows`).

Values above the limits of `consistency_warnings` are reported as warnings.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from polarsim.formats import obj
from polarsim.formats.tables import read_parquet
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import outlines_of, rim
from polarsim.geometry.poses import Pose, angle_between
from polarsim.photo import NO_ROCK, Terrain, terrain_text
from polarsim.run_files.best_photos import best_pictures
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scans import read_scan
from polarsim.run_files.scene import FITTED, TerrainMesh, mesh_origins, read_terrain
from polarsim.run_files.wall_edges import OpenGround, measure_edges
from polarsim.scoring.alignment import align_rigs, refine_alignment
from polarsim.scoring.consistency_warnings import STAGE, metric_warning
from polarsim.scoring.labels import read_sound_boxes
from polarsim.scoring.left_right import boxes_of_both, photos_of_both
from polarsim.scoring.metrics import Metric, metrics_of, write_metrics
from polarsim.scoring.surface import Surface
from polarsim.scoring.wall_shadows import wall_shadow_metrics
from polarsim.site import Site

log = logging.getLogger("polarsim")

MARGIN = 0.15  # metres; width of the excluded strip along the walls, where the cloth moves between scans
SCAN_POINTS = 20_000  # approximate number after subsampling
MAX_FOOT_GAP = 0.02  # metres; maximum median gap between the foot of a rock and a fitted ground that supports the rock
FAR_FROM_FEET = 0.5  # metres; distance from feet beyond which the height of a fitted ground is uncertain
SUPPORT_STEP = 0.05  # metres; grid step for the distance of the sand from feet
MATCH_COLUMNS = ("position", "iou")


def check_consistency(
    *,
    site: Site,
    terrain: Terrain,
    inventory: Path,
    located: Path,
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    annotated: Path | None,
    evaluation: Path,
) -> None:
    """Write the consistency metrics of the scans, cameras, meshes and boxes of a terrain, and log warnings.

    `located` has the poses for which the meshes were reconstructed, `cameras` the final poses. `annotated`, the folder
    of all annotated label files, is used without photos of both cameras.
    """
    known, localised = read_inventory(inventory), read_all_localised(located)
    sandbox = site.sandbox_of(terrain)
    half = np.array(sandbox.half_width_m)
    scans = {
        position: sand_points(
            localised[position], read_scan(known, position, localised[position].rig, site.files), half
        )
        for position in known.scanned
        if position in localised and not localised[position].unproven
    }
    metrics = []
    scene, last = read_terrain(meshes, terrain, sandbox, cameras=cameras), read_all_localised(cameras)
    if scans:
        metrics += scans_on_meshes(scans, scene)
    if mesh_origins(meshes).get(obj.ground_name(terrain)) == FITTED:
        rims = [rim(obj.read_obj(path)) for path in obj.rock_files(meshes).values()]
        metrics += ground_support(scene.part(NO_ROCK), rims, half - MARGIN)
    metrics += cameras_together(localised, last)
    if (located / "matches.parquet").exists():
        metrics += box_overlaps(read_parquet(located / "matches.parquet", MATCH_COLUMNS))
    both = []
    if photos and site.cameras.stereo:
        both = photos_of_both(last, make_caster(scene.vertices, scene.faces), best_pictures(terrain, photos))
    if not both and annotated is not None and site.cameras.stereo:
        outlines = outlines_of({rock: obj.read_obj(path) for rock, path in obj.rock_files(meshes).items()})
        both = boxes_of_both(last, outlines, read_sound_boxes(annotated, terrain, site.images.size))
    metrics += both
    if photos is not None and scene.walls is not None:
        suns = read_suns(cameras, last, site, terrain)
        edges = measure_edges(terrain, OpenGround.of(scene), scene.walls, photos, last, suns, site)
        metrics += wall_shadow_metrics(edges)
    for metric in metrics:
        for sentence in metric_warning(metric, site.images.width):
            log.warning("terrain %s: %s", terrain_text(terrain), sentence)
    write_metrics(evaluation, STAGE, terrain, metrics)


def sand_points(localised: LocalisedRig, points_left: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Return the points (m, 3) of a scan (n, 3) on sand and rocks, transformed to the sandbox frame and subsampled.

    `half` (2,): half widths of the sand along X and Y, metres.
    """
    points = localised.sandbox_from_left.apply(points_left)
    inside = (np.abs(points[:, :2]) < half - MARGIN).all(axis=1)
    return points[inside][:: max(1, inside.sum() // SCAN_POINTS)]


def scans_on_meshes(scans: Mapping[str, np.ndarray], scene: TerrainMesh) -> list[Metric]:
    """Return the motions that align scans (n, 3) in the sandbox frame with the meshes: common, and between pairs."""
    surface = Surface(scene.vertices, scene.faces)
    all_points = np.concatenate(list(scans.values()))
    rotation, translation = _size(_alignment(all_points, surface), all_points.mean(axis=0))
    values = {"common_rotation": (rotation, "deg"), "common_translation": (translation, "mm")}
    metrics = metrics_of("all scans on the meshes", len(scans), "own", **values)
    moves = {}
    for position, points in sorted(scans.items()):
        moves[position] = _alignment(points, surface)
        aligned = moves[position].apply(points)
        nearest, face = surface.nearest(aligned)
        above = ((aligned - nearest) * surface.normals[face]).sum(axis=1)
        distance_mm = 1000 * float(np.median(np.abs(above)))
        subject = f"scan {position} on the meshes"
        metrics.append(Metric(subject, "distance_median", distance_mm, "mm", len(points), "own"))
    for first, second in combinations(sorted(moves), 2):
        rotation, translation = _size(moves[first].inverse() @ moves[second], all_points.mean(axis=0))
        values = {"rotation_between": (rotation, "deg"), "translation_between": (translation, "mm")}
        metrics += metrics_of(f"scans {first} and {second}", 2, "own", **values)
    return metrics


def ground_support(ground: Mesh, rims: Sequence[np.ndarray], half: np.ndarray) -> list[Metric]:
    """Return the share of rocks that a fitted ground does not support, and the share of ground far from all rocks.

    `rims` are points (n, 3) of the foot of each rock, `half` (2,) are half widths of the evaluated sand, metres.
    """
    sides = (np.arange(-along, along, SUPPORT_STEP) for along in half)
    sand = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    far = 1.0
    metrics = []
    if rims:
        feet = np.concatenate(rims)
        gap = np.abs(Surface(ground.vertices, ground.faces).height_below(feet))
        gap[np.isnan(gap)] = np.inf  # outside the ground; a median with NaN is NaN
        gaps = np.split(gap, np.cumsum([len(points) for points in rims])[:-1])
        off = float(np.mean([not np.median(gap) <= MAX_FOOT_GAP for gap in gaps]))
        metrics.append(Metric("fitted ground", "feet_off", off, "1", len(rims), "own"))
        far = float(np.mean(np.asarray(KDTree(feet[:, :2]).query(sand)[0]) > FAR_FROM_FEET))
    return [*metrics, Metric("fitted ground", "far_from_feet", far, "1", len(sand), "own")]


def cameras_together(before: Mapping[str, LocalisedRig], after: Mapping[str, LocalisedRig]) -> list[Metric]:
    """Return the common rotation of the cameras since the reconstruction, and the cameras with unconfirmed poses."""
    metrics = [
        Metric(f"camera {position}", "surveyed", float(rig.unproven), "1", 1, "own")
        for position, rig in sorted(after.items())
    ]
    if len(set(before) & set(after)) > 1:
        rotation = float(np.degrees(angle_between(align_rigs(after, before), Pose.identity())))
        metrics.append(Metric("cameras since the meshes", "cameras_rotation", rotation, "deg", len(after), "own"))
    return metrics


def box_overlaps(matches: pd.DataFrame) -> list[Metric]:
    """Return the mean IoU of projected meshes and the boxes that localised the cameras, by position."""
    return [
        Metric(f"meshes on boxes, position {position}", "boxes_iou", float(part["iou"].mean()), "1", len(part), "own")
        for position, part in matches.groupby("position")
    ]


def _alignment(points: np.ndarray, surface: Surface) -> Pose:
    """Return the rigid motion that aligns points (n, 3) with a surface."""
    return refine_alignment(Pose.identity(), points, surface).inverse()


def _size(motion: Pose, point: np.ndarray) -> tuple[float, float]:
    """Return the rotation angle of a motion, degrees, and the displacement of a point (3,), millimetres."""
    rotation_deg = float(np.degrees(angle_between(motion, Pose.identity())))
    return rotation_deg, 1000 * float(np.linalg.norm(motion.apply(point) - point))
