"""Whether a run agrees with itself, without truth: scans, cameras, meshes and boxes, by the files that were written.

A ground that was fitted under published rocks is held against their feet.
Every scan is put through its written pose and asked how it would still have to move to lie on the written meshes; all
scans together too. Cameras that photos or labels moved are held against those that the meshes were made with, and
meshes against the boxes that localised the cameras. What does not agree becomes a plain sentence.
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
from polarsim.geometry.casters import caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, angle_between
from polarsim.geometry.rims import rim
from polarsim.photo import NO_ROCK
from polarsim.run_files.best_photos import best_pictures
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.run_files.scans import read_scan
from polarsim.run_files.scene import FITTED, TerrainMesh, made_from, read_terrain
from polarsim.scoring.alignment import align_rigs, refine_alignment
from polarsim.scoring.complaints import STAGE, complaint
from polarsim.scoring.labels import read_sound_boxes
from polarsim.scoring.left_right import boxes_of_both, photos_of_both
from polarsim.scoring.metrics import Metric, write_metrics
from polarsim.scoring.surface import Surface
from polarsim.survey import half_width

log = logging.getLogger("polarsim")

MARGIN = 0.15  # metres along the walls that do not count: cloth hangs otherwise in every scan
POINTS = 20_000  # of a scan
FOOT_OFF = 0.02  # metres between a rock's foot, median over its points, and a fitted ground that does not support it
FAR_FROM_FEET = 0.5  # metres: the height of a fitted ground is a guess there
SUPPORT_STEP = 0.05  # metres between points of the sand at which its distance from feet is measured
MATCH_COLUMNS = ("position", "iou")


def check_consistency(
    *,
    terrain: int,
    inventory: Path,
    located: Path,
    cameras: Path,
    meshes: Path,
    photos: Path | None,
    annotated: Path | None,
    evaluation: Path,
) -> None:
    """Write how far a terrain's scans, cameras, meshes and boxes agree, and warn where they do not.

    Parameters
    ----------
    located, cameras
        Folders with the poses that the meshes were made with, and with the last ones.
    meshes
        Folder of the terrain's meshes.
    photos
        `photos.parquet`; None where a source has no photos.
    annotated
        Folder of all label files that people drew, which stand in where no photos show both cameras; may be None.
    """
    known, localised = read_inventory(inventory), read_all_localised(located)
    scans = {
        position: on_sand(localised[position], read_scan(known, position, localised[position].rig), half_width(terrain))
        for position in known.scanned
        if position in localised and not localised[position].unproven
    }
    metrics = []
    scene, last = read_terrain(meshes, terrain), read_all_localised(cameras)
    if scans:
        metrics += scans_on_meshes(scans, scene)
    if made_from(meshes).get(obj.ground_name(terrain)) == FITTED:
        rims = [rim(obj.read(path)) for path in obj.rock_files(meshes).values()]
        metrics += ground_support(scene.part(NO_ROCK), rims, half_width(terrain) - MARGIN)
    metrics += cameras_together(localised, last)
    if (located / "matches.parquet").exists():
        metrics += box_overlaps(read_parquet(located / "matches.parquet", MATCH_COLUMNS))
    both = photos_of_both(last, caster(scene.vertices, scene.faces), best_pictures(terrain, photos)) if photos else []
    if not both and annotated is not None:
        outlines = outlines_of({rock: obj.read(path) for rock, path in obj.rock_files(meshes).items()})
        both = boxes_of_both(last, outlines, read_sound_boxes(annotated, terrain))
    metrics += both
    for metric in metrics:
        for sentence in complaint(metric.subject, metric.metric, metric.value):
            log.warning("terrain %02d: %s", terrain, sentence)
    write_metrics(evaluation, STAGE, terrain, metrics)


def on_sand(localised: LocalisedRig, points_left: np.ndarray, half: float) -> np.ndarray:
    """(m, 3) points of a scan (n, 3) on the sand and its rocks, through the written pose, in the sandbox.

    `half`: half width of the sand, metres.
    """
    points = localised.sandbox_from_left.apply(points_left)
    inside = (np.abs(points[:, :2]) < half - MARGIN).all(axis=1)
    return points[inside][:: max(1, inside.sum() // POINTS)]


def scans_on_meshes(scans: Mapping[str, np.ndarray], scene: TerrainMesh) -> list[Metric]:
    """How scans (n, 3) in the sandbox would still have to move to lie on the meshes: all together, and by pairs."""
    surface = Surface(scene.vertices, scene.faces)
    everything = np.concatenate(list(scans.values()))
    rotation, translation = _size(_further(everything, surface), everything.mean(axis=0))
    metrics = [
        Metric("all scans on the meshes", "common_rotation", rotation, "deg", len(scans), "own"),
        Metric("all scans on the meshes", "common_translation", translation, "mm", len(scans), "own"),
    ]
    moves = {}
    for position, points in sorted(scans.items()):
        moves[position] = _further(points, surface)
        settled = moves[position].apply(points)
        nearest, face = surface.nearest(settled)
        above = ((settled - nearest) * surface.normals[face]).sum(axis=1)
        left_mm = 1000 * float(np.median(np.abs(above)))
        metrics.append(Metric(f"scan {position} on the meshes", "distance_median", left_mm, "mm", len(points), "own"))
    for one, other in combinations(sorted(moves), 2):
        rotation, translation = _size(moves[one].inverse() @ moves[other], everything.mean(axis=0))
        subject = f"scans {one} and {other}"
        metrics.append(Metric(subject, "rotation_between", rotation, "deg", 2, "own"))
        metrics.append(Metric(subject, "translation_between", translation, "mm", 2, "own"))
    return metrics


def ground_support(ground: Mesh, rims: Sequence[np.ndarray], half: float) -> list[Metric]:
    """How a fitted ground agrees with the feet of rocks, and how much of it is far from all of them.

    Parameters
    ----------
    rims : sequence of (n, 3) float
        Points of each rock's foot, metres.
    half : float
        Half width of the square of sand that counts, metres.
    """
    side = np.arange(-half, half, SUPPORT_STEP)
    sand = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    far = 1.0
    metrics = []
    if rims:
        surface, top = caster(ground.vertices, ground.faces), float(ground.vertices[:, 2].max()) + 1
        feet = np.concatenate(rims)
        origins = np.column_stack([feet[:, :2], np.full(len(feet), top)])
        distance, _ = surface.nearest(origins, np.tile([0.0, 0.0, -1.0], (len(feet), 1)))
        gaps = np.split(np.abs(feet[:, 2] - (top - distance)), np.cumsum([len(own) for own in rims])[:-1])
        off = float(np.mean([not np.median(gap) <= FOOT_OFF for gap in gaps]))  # without ground the gap is infinite
        metrics.append(Metric("fitted ground", "feet_off", off, "1", len(rims), "own"))
        far = float(np.mean(np.asarray(KDTree(feet[:, :2]).query(sand)[0]) > FAR_FROM_FEET))
    return [*metrics, Metric("fitted ground", "far_from_feet", far, "1", len(sand), "own")]


def cameras_together(before: Mapping[str, LocalisedRig], after: Mapping[str, LocalisedRig]) -> list[Metric]:
    """What all cameras of a terrain did in common after the meshes, and which have no proven pose."""
    metrics = [
        Metric(f"camera {position}", "surveyed", float(rig.unproven), "1", 1, "own")
        for position, rig in sorted(after.items())
    ]
    if len(set(before) & set(after)) > 1:
        rotation = float(np.degrees(angle_between(align_rigs(after, before), Pose.identity())))
        metrics.append(Metric("cameras since the meshes", "cameras_rotation", rotation, "deg", len(after), "own"))
    return metrics


def box_overlaps(matches: pd.DataFrame) -> list[Metric]:
    """Mean IoU of projected meshes and the boxes that localised the cameras, by position."""
    return [
        Metric(f"meshes on boxes, position {position}", "boxes_iou", float(part["iou"].mean()), "1", len(part), "own")
        for position, part in matches.groupby("position")
    ]


def _further(points: np.ndarray, surface: Surface) -> Pose:
    """The motion that brings points (n, 3) onto a surface."""
    return refine_alignment(Pose.identity(), points, surface).inverse()


def _size(motion: Pose, point: np.ndarray) -> tuple[float, float]:
    """Degrees of a motion's rotation, and millimetres that it moves a point (3,)."""
    rotation_deg = float(np.degrees(angle_between(motion, Pose.identity())))
    return rotation_deg, 1000 * float(np.linalg.norm(motion.apply(point) - point))
