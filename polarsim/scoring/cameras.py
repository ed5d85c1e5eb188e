"""How well cameras and lamps are localised: against the true ones of the analog, or the boxes they were fitted to."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from pathlib import Path

import numpy as np

from polarsim.formats import obj
from polarsim.formats.files import read_json
from polarsim.formats.tables import read_parquet
from polarsim.geometry.boxes import assign, iou
from polarsim.geometry.consensus import consensus_of_sets
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, angle_between
from polarsim.photo import BOX_CLASSES, CAMERAS, ROCK, SUNS, PhotoKey
from polarsim.run_files import lamps
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.scoring.alignment import align_rigs, fit_alignment
from polarsim.scoring.labels import read_sound_boxes
from polarsim.scoring.metrics import Metric, summary, write_metrics
from polarsim.scoring.score import Labels

MATCH_COLUMNS = ("position", "rock", "iou", "dx_px", "dy_px")
_POINTS = 4000  # true surface points that are projected, at most
_UNITS = {"_mm": "mm", "_deg": "deg", "_px": "px", "_m": "m"}


def score_cameras(
    *,
    terrain: int,
    cameras: Path,
    truth: Path | None,
    matches: Path | None,
    annotated: Path | None,
    meshes: Path,
    evaluation: Path,
) -> None:
    """Write the evaluation of a terrain's cameras.

    Parameters
    ----------
    cameras
        Folder with PosX.json.
    truth
        The analog's truth/TerrainTT; None where there is none.
    matches
        matches.parquet of the cameras stage; may be None or missing.
    annotated
        Folder of all label files that people drew; None where there is none.
    meshes
        Folder of the terrain's meshes.
    """
    localised = read_all_localised(cameras)
    metrics = stated(localised)
    if truth is not None:
        true = read_all_localised(truth / "cameras")
        metrics += against_truth(localised, true, true_points(truth, terrain))
        if set(localised) & set(true) and (truth / lamps.FILE).exists():  # sandboxes without photos have no lamps
            metrics += lamps_against_truth(cameras, truth, align_rigs(localised, true))
    if matches is not None and matches.exists():
        metrics += against_boxes(matches)
    if annotated is not None:
        metrics += against_annotated(localised, obj.rock_files(meshes), read_sound_boxes(annotated, terrain))
    write_metrics(evaluation, "cameras", terrain, metrics)


def against_truth(
    localised: Mapping[str, LocalisedRig], true: Mapping[str, LocalisedRig], points_truth: np.ndarray
) -> list[Metric]:
    """Errors of the poses before and after one alignment of the terrain, of the rig, and of points in the pictures.

    Of every two positions the pose of one in the other's frame is compared too, which needs no alignment.
    With a single position the alignment takes up the whole error: then only the metrics before it are given.

    Parameters
    ----------
    points_truth : (n, 3) float
        Points on true surfaces, true frame, metres; may be empty.
    """
    common = sorted(set(localised) & set(true))
    if not common:
        return []
    estimated = {position: localised[position].sandbox_from_left for position in common}
    wanted = {position: true[position].sandbox_from_left for position in common}
    frames = {"before": Pose.identity()}
    if len(common) > 1:
        frames["aligned"] = fit_alignment(estimated, wanted)
    metrics = []
    for position in common:
        for name, truth_from_sandbox in frames.items():
            errors = f"position_error_{name}", f"angle_error_{name}"
            metrics += _pose_errors(position, errors, truth_from_sandbox @ estimated[position], wanted[position])
            if name == "aligned" or len(frames) == 1:
                metrics += projection_errors(
                    "reprojection", position, localised[position], true[position], points_truth, truth_from_sandbox
                )
        rig, true_rig = localised[position].rig, true[position].rig  # they differ by the calibration file's errors
        errors = "rig_baseline_error", "rig_angle_error"
        metrics += _pose_errors(position, errors, rig.left_from_right, true_rig.left_from_right)
    for one, other in combinations(common, 2):
        found, meant = estimated[one].inverse() @ estimated[other], wanted[one].inverse() @ wanted[other]
        errors = "position_error_between", "angle_error_between"
        metrics += _pose_errors(f"{one} to {other}", errors, found, meant)
    for name in frames:
        for kind, unit in (("position", "mm"), ("angle", "deg")):
            worst = max(metric.value for metric in metrics if metric.metric == f"{kind}_error_{name}")
            metrics.append(Metric("worst position", f"{kind}_error_{name}", worst, unit, len(common), "truth"))
    return metrics


def against_boxes(path: Path) -> list[Metric]:
    """IoU and offsets of the projected meshes and the consensus boxes of the seeds, by position and over all.

    Raises
    ------
    FormatError
        A column is missing.
    """
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
    annotated: Mapping[PhotoKey, Labels],
) -> list[Metric]:
    """Overlap of the projected meshes with what all annotated boxes of a view agree on; fits know of no right photo."""
    outlines = outlines_of({rock: obj.read(path) for rock, path in meshes.items()})
    metrics = []
    for camera in CAMERAS:
        pairs = [np.zeros((0, 2, 4))]  # projected and annotated
        for position, rig in localised.items():
            boxes = agreed_boxes(annotated, position, camera)
            projected = outlines.seen(rig.camera(camera))
            rows, columns = assign(projected, boxes)
            pairs.append(np.stack([projected[rows], boxes[columns]], axis=1))
        first, second = np.concatenate(pairs).swapaxes(0, 1)
        offset_px = np.abs(first[:, :2] + first[:, 2:] - second[:, :2] - second[:, 2:]) / 2
        metrics += _overlap_metrics(f"all boxes of {camera}", np.diag(iou(first, second)), offset_px)
    return metrics


def agreed_boxes(annotated: Mapping[PhotoKey, Labels], position: str, camera: str) -> np.ndarray:
    """(m, 4) rock boxes of one view that its exposure brackets agree on."""
    sets: dict[tuple[str, str], list[np.ndarray]] = {}
    for key, labels in annotated.items():
        if (key.position, key.camera) == (position, camera):
            rocks = labels.boxes[labels.classes == BOX_CLASSES.index(ROCK)]
            sets.setdefault((key.light, key.azimuth), []).append(rocks)
    return consensus_of_sets(list(sets.values()))


def _overlap_metrics(subject: str, overlap: np.ndarray, offset_px: np.ndarray) -> list[Metric]:
    """Mean IoU, and medians of the offsets (n, 2) along x and y; none for no pair."""
    n = len(overlap)
    if not n:
        return []
    across, down = np.median(offset_px, axis=0)
    return [
        Metric(subject, "box_iou_mean", float(overlap.mean()), "1", n, "labels"),
        Metric(subject, "box_dx_median", float(across), "px", n, "labels"),
        Metric(subject, "box_dy_median", float(down), "px", n, "labels"),
    ]


def stated(localised: Mapping[str, LocalisedRig]) -> list[Metric]:
    """What the cameras stage itself says of each fit (`metrics` of PosX.json)."""
    metrics = []
    for position, rig in localised.items():
        for name, value in sorted(rig.metrics.items()):
            unit = next((unit for ending, unit in _UNITS.items() if name.endswith(ending)), "1")
            subject = f"{position} ({rig.method})" if rig.method else position
            metrics.append(Metric(subject, name, float(value), unit, 1, "own"))
    return metrics


def _pose_errors(subject: str, names: tuple[str, str], estimated: Pose, true: Pose) -> list[Metric]:
    """How far a pose is translated and rotated against the true one, as the two metrics of these names."""
    offset_mm = 1000 * float(np.linalg.norm(estimated.translation - true.translation))
    rotation_deg = float(np.degrees(angle_between(estimated, true)))
    return [
        Metric(subject, names[0], offset_mm, "mm", 1, "truth"),
        Metric(subject, names[1], rotation_deg, "deg", 1, "truth"),
    ]


def projection_errors(
    name: str,
    position: str,
    localised: LocalisedRig,
    true: LocalisedRig,
    points_truth: np.ndarray,
    truth_from_sandbox: Pose,
) -> list[Metric]:
    """Distances in the picture between true points (n, 3) seen by the true and by our camera, as metrics `name_*`."""
    metrics: list[Metric] = []
    for camera in CAMERAS:
        lens = true.rig.lens(camera)
        wanted = true.project(camera, points_truth)
        inside = ((wanted > 0) & (wanted < [lens.width, lens.height])).all(axis=-1)  # NaN behind the camera: outside
        found = localised.project(camera, truth_from_sandbox.inverse().apply(points_truth[inside]))
        error_px = np.linalg.norm(found - wanted[inside], axis=-1)
        metrics += summary(f"{position} {camera}", name, error_px, "px", "truth")
    return metrics


def true_points(truth: Path, terrain: int) -> np.ndarray:
    """Vertices of the true rocks, of the ground where there is no rock, thinned to `_POINTS`."""
    files = list(obj.rock_files(truth / "meshes").values())
    ground = truth / "meshes" / obj.ground_name(terrain)
    files = files or ([ground] if ground.exists() else [])
    if not files:
        return np.zeros((0, 3))
    points = np.concatenate([obj.read(path).vertices for path in files])
    return points[:: max(1, len(points) // _POINTS)]


def lamps_against_truth(cameras: Path, truth: Path, truth_from_sandbox: Pose) -> list[Metric]:
    """The angle at the sandbox's centre between where a lamp is taken to stand and where it stood.

    Shadows tell a lamp's direction and hardly its distance, so the angle is what counts.

    Parameters
    ----------
    cameras
        Folder of the terrain's rig poses, with or without lamps that were found.
    truth
        The analog's truth/TerrainTT.
    """
    localised, true = read_all_localised(cameras), read_json(truth / lamps.FILE)
    metrics, worst = [], {}
    for name, suns in (
        ("surveyed_direction", lamps.surveyed_suns(localised)),
        ("direction", lamps.read_suns(cameras, localised)),
    ):
        found = [
            Metric(f"lamp {azimuth}", f"{name}_error", off_deg, "deg", 1, "truth")
            for azimuth in SUNS
            for off_deg in [_angle_deg(truth_from_sandbox.apply(suns[azimuth]), np.array(true[azimuth], float))]
        ]
        worst[name] = max(metric.value for metric in found)
        metrics += found
    return metrics + [
        Metric("worst lamp", f"{name}_error", value, "deg", len(SUNS), "truth") for name, value in worst.items()
    ]


def _angle_deg(one: np.ndarray, other: np.ndarray) -> float:
    """Between the directions of two positions (3,) from the origin."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))
