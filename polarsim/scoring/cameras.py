"""Evaluation of the localisation of cameras and lamps against ground truth, matched boxes or annotated boxes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from polarsim.formats import obj
from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet
from polarsim.geometry.boxes import iou, match_by_position_and_size, match_gate_px
from polarsim.geometry.consensus import consensus_of_sets
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, angle_between
from polarsim.photo import BOX_CLASSES, ROCK, CameraSide, PhotoKey, Terrain
from polarsim.run_files import lamps
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.scoring.alignment import align_rigs, fit_alignment
from polarsim.scoring.labels import read_sound_boxes
from polarsim.scoring.metrics import Metric, metrics_of, summary_metric, write_metrics
from polarsim.scoring.score import PhotoLabels
from polarsim.site import Site

MATCH_COLUMNS = ("position", "rock", "iou", "dx_px", "dy_px")
_PROJECTED_POINTS = 4000  # approximate number of projected points of the true surface
_UNITS = {"_mm": "mm", "_deg": "deg", "_px": "px", "_m": "m"}


def score_cameras(
    *,
    site: Site,
    terrain: Terrain,
    cameras: Path,
    truth: Path | None,
    matches: Path | None,
    annotated: Path | None,
    meshes: Path,
    evaluation: Path,
) -> None:
    """Write the evaluation of the cameras of a terrain.

    `truth` is the folder truth/TerrainTT of the analog, `matches` the (possibly missing) matches.parquet of the cameras
    stage, `annotated` the folder of all annotated label files; each may be None.
    """
    localised, sides = read_all_localised(cameras), site.cameras.sides
    metrics = stated(localised)
    if truth is not None:
        true = read_all_localised(truth / "cameras")
        metrics += against_truth(localised, true, true_points(truth, terrain), sides)
        if set(localised) & set(true) and (truth / lamps.FILE).exists():  # sandboxes without photos have no lamps
            metrics += lamps_against_truth(site, terrain, cameras, truth, align_rigs(localised, true))
    if matches is not None and matches.exists():
        metrics += against_boxes(matches)
    if annotated is not None:
        boxes = read_sound_boxes(annotated, terrain, site.images.size)
        metrics += against_annotated(localised, obj.rock_files(meshes), boxes, sides)
    write_metrics(evaluation, "cameras", terrain, metrics)


def against_truth(
    localised: Mapping[str, LocalisedRig],
    true: Mapping[str, LocalisedRig],
    points_truth: np.ndarray,
    sides: Sequence[CameraSide],
) -> list[Metric]:
    """Return errors of poses before and after a rigid alignment of the terrain, of the rig, and of projected points.

    Relative poses between positions are also compared; they need no alignment. With a single position, the alignment
    removes the entire error: then only the metrics before the alignment are returned. `points_truth` (n, 3), metres,
    are on true surfaces in the frame of the ground truth; may be empty. `sides`: cameras of the rig.
    """
    common = sorted(set(localised) & set(true))
    if not common:
        return []
    estimated = {position: localised[position].sandbox_from_left for position in common}
    expected = {position: true[position].sandbox_from_left for position in common}
    frames = {"before": Pose.identity()}
    if len(common) > 1:
        frames["aligned"] = fit_alignment(estimated, expected)
    metrics = []
    for position in common:
        for name, truth_from_sandbox in frames.items():
            errors = f"position_error_{name}", f"angle_error_{name}"
            metrics += _pose_errors(position, errors, truth_from_sandbox @ estimated[position], expected[position])
            if name == "aligned" or len(frames) == 1:
                metrics += projection_errors(
                    "reprojection",
                    position,
                    localised[position],
                    true[position],
                    points_truth,
                    truth_from_sandbox,
                    sides,
                )
        if len(sides) > 1:
            rig, true_rig = localised[position].rig, true[position].rig  # differ by the errors of the calibration file
            errors = "rig_baseline_error", "rig_angle_error"
            metrics += _pose_errors(position, errors, rig.left_from_right, true_rig.left_from_right)
    for first, second in combinations(common, 2):
        relative = estimated[first].inverse() @ estimated[second]
        true_relative = expected[first].inverse() @ expected[second]
        errors = "position_error_between", "angle_error_between"
        metrics += _pose_errors(f"{first} to {second}", errors, relative, true_relative)
    for name in frames:
        for kind, unit in (("position", "mm"), ("angle", "deg")):
            worst = max(metric.value for metric in metrics if metric.metric == f"{kind}_error_{name}")
            metrics.append(Metric("worst position", f"{kind}_error_{name}", worst, unit, len(common), "truth"))
    return metrics


def against_boxes(path: Path) -> list[Metric]:
    """Return IoU and offsets between projected meshes and consensus boxes of the seeds, by position and pooled."""
    table = read_parquet(path, MATCH_COLUMNS)
    metrics = []
    parts = [(str(position), part) for position, part in table.groupby("position")]
    for subject, part in [*parts, ("all positions", table)]:
        offset_px = part[["dx_px", "dy_px"]].abs().to_numpy(float)
        metrics += _overlap_metrics(subject, part["iou"].to_numpy(float), offset_px)
    return metrics


def against_annotated(
    localised: Mapping[str, LocalisedRig],
    meshes: Mapping[int, Path],
    annotated: Mapping[PhotoKey, PhotoLabels],
    sides: Sequence[CameraSide],
) -> list[Metric]:
    """Return the overlap of projected meshes with consensus boxes of all annotations of a view.

    Right photos are not used in the localisation.
    """
    outlines = outlines_of({rock: obj.read_obj(path) for rock, path in meshes.items()})
    metrics = []
    for camera in sides:
        pairs = [np.zeros((0, 2, 4))]  # projected and annotated
        for position, rig in localised.items():
            boxes = agreed_boxes(annotated, position, camera)
            view = rig.camera(camera)
            projected = outlines.seen(view)
            rows, columns = match_by_position_and_size(projected, boxes, match_gate_px(view.lens.width))
            pairs.append(np.stack([projected[rows], boxes[columns]], axis=1))
        first, second = np.concatenate(pairs).swapaxes(0, 1)
        offset_px = np.abs(first[:, :2] + first[:, 2:] - second[:, :2] - second[:, 2:]) / 2
        metrics += _overlap_metrics(f"all boxes of {camera}", np.diag(iou(first, second)), offset_px)
    return metrics


def agreed_boxes(annotated: Mapping[PhotoKey, PhotoLabels], position: str, camera: str) -> np.ndarray:
    """Return the rock boxes (m, 4) of a view on which the exposure brackets agree."""
    sets: dict[tuple[str, str], list[np.ndarray]] = {}
    for key, labels in annotated.items():
        if (key.position, key.camera) == (position, camera):
            rocks = labels.boxes[labels.classes == BOX_CLASSES.index(ROCK)]
            sets.setdefault((key.light, key.azimuth), []).append(rocks)
    return consensus_of_sets(list(sets.values()))


def _overlap_metrics(subject: str, overlap: np.ndarray, offset_px: np.ndarray) -> list[Metric]:
    """Return the mean IoU and the medians of the offsets (n, 2) along x and y; empty without pairs."""
    if not len(overlap):
        return []
    across, down = np.median(offset_px, axis=0)
    values = {"box_iou_mean": (overlap.mean(), "1"), "box_dx_median": (across, "px"), "box_dy_median": (down, "px")}
    return metrics_of(subject, len(overlap), "labels", **values)


def stated(localised: Mapping[str, LocalisedRig]) -> list[Metric]:
    """Return the metrics of the cameras stage for each fit (`metrics` of PosX.json)."""
    metrics = []
    for position, rig in localised.items():
        for name, value in sorted(rig.metrics.items()):
            unit = next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "1")
            subject = f"{position} ({rig.method})" if rig.method else position
            metrics.append(Metric(subject, name, float(value), unit, 1, "own"))
    return metrics


def _pose_errors(subject: str, names: tuple[str, str], estimated: Pose, true: Pose) -> list[Metric]:
    """Return the errors of translation and rotation of a pose as two metrics with the given names."""
    offset_mm = 1000 * float(np.linalg.norm(estimated.translation - true.translation))
    rotation_deg = float(np.degrees(angle_between(estimated, true)))
    return metrics_of(subject, 1, "truth", **{names[0]: (offset_mm, "mm"), names[1]: (rotation_deg, "deg")})


def projection_errors(
    name: str,
    position: str,
    localised: LocalisedRig,
    true: LocalisedRig,
    points_truth: np.ndarray,
    truth_from_sandbox: Pose,
    sides: Sequence[CameraSide],
) -> list[Metric]:
    """Return pixel distances between the projections of points (n, 3) by true and estimated cameras, as `name_*`."""
    metrics: list[Metric] = []
    for camera in sides:
        lens = true.rig.lens(camera)
        expected = true.project(camera, points_truth)
        inside = ((expected > 0) & (expected < [lens.width, lens.height])).all(axis=-1)  # False for NaN
        projected = localised.project(camera, truth_from_sandbox.inverse().apply(points_truth[inside]))
        error_px = np.linalg.norm(projected - expected[inside], axis=-1)
        metrics += summary_metric(f"{position} {camera}", name, error_px, "px", "truth")
    return metrics


def true_points(truth: Path, terrain: Terrain) -> np.ndarray:
    """Return a sample of the vertices of the true rocks, or of the ground in a terrain without rocks."""
    files = list(obj.rock_files(truth / "meshes").values())
    ground = truth / "meshes" / obj.ground_name(terrain)
    files = files or ([ground] if ground.exists() else [])
    if not files:
        return np.zeros((0, 3))
    points = np.concatenate([obj.read_obj(path).vertices for path in files])
    return points[:: max(1, len(points) // _PROJECTED_POINTS)]


def lamps_against_truth(
    site: Site, terrain: Terrain, cameras: Path, truth: Path, truth_from_sandbox: Pose
) -> list[Metric]:
    """Return the angle at the centre of the sandbox between the estimated and the true direction of each lamp.

    The error is an angle because shadows determine the direction of a lamp, but hardly the distance. `cameras` may be
    without localised lamps. `truth` is the folder truth/TerrainTT of the analog. Empty for a site without lamps.
    """
    if not site.lamps:
        return []
    localised, true = read_all_localised(cameras), read_json(truth / lamps.FILE)
    metrics, worst = [], {}
    for name, suns in (
        ("surveyed_direction", lamps.surveyed_suns(localised, site, terrain)),
        ("direction", lamps.read_suns(cameras, localised, site, terrain)),
    ):
        of_lamps = [
            Metric(f"lamp {azimuth}", f"{name}_error", off_deg, "deg", 1, "truth")
            for azimuth in site.suns
            for off_deg in [_angle_deg(truth_from_sandbox.apply(suns[azimuth]), np.array(true[azimuth], float))]
        ]
        worst[name] = max(metric.value for metric in of_lamps)
        metrics += of_lamps
    return metrics + [
        Metric("worst lamp", f"{name}_error", value, "deg", len(site.suns), "truth") for name, value in worst.items()
    ]


def _angle_deg(first: np.ndarray, second: np.ndarray) -> float:
    """Return the angle between the directions of two positions (3,) from the origin, degrees."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))
