"""Consistency of left and right camera with the calibration of the rig, from photos or annotated boxes.

The epipolar line of a point in the left photo depends only on the rig, not on the distance of the point. Left photos
are warped to the right camera by the meshes, and the remaining offset across the epipolar lines is the error of the
rig. Without photos, the offsets between projected meshes and annotated boxes are compared between both cameras.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from polarsim.geometry.boxes import iou, match_by_position_and_size, match_gate_px
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.patches import MatchingOptions, StereoMatches, cast_stereo, match_stereo_windows
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import PhotoKey, reduced_scale
from polarsim.run_files.best_photos import BestPhotos, read_resized
from polarsim.run_files.rigs import LocalisedRig
from polarsim.scoring.cameras import agreed_boxes
from polarsim.scoring.metrics import Metric, metrics_of
from polarsim.scoring.score import PhotoLabels

# Scale of compared photos of the reference width: less noise and a larger search range. Others get the same width.
SCALE = 0.5
WINDOW = MatchingOptions(half=10, search=8, step=16, likeness=0.7, noise=0.4)  # pixels of the reduced photos
MIN_MATCHED_WINDOWS = 50  # for offsets
MIN_SEARCHED_WINDOWS = 100  # for the share of matched windows
MIN_ROCK_BOXES = 5  # in each camera
SD_OF_MAD = 1.4826  # standard deviation over median absolute deviation of a normal distribution


def photos_of_both(localised: Mapping[str, LocalisedRig], surface: Caster, pictures: BestPhotos) -> list[Metric]:
    """Return the offsets of matched windows across and along the epipolar lines, by position."""
    metrics = []
    for position, rig in sorted(localised.items()):
        left, right = (pictures.get((position, camera), {}) for camera in "LR")
        azimuths = sorted(set(left) & set(right))
        if azimuths and not rig.unproven:
            scale = _scale(rig.rig)
            small = replace(rig.rig, left=rig.rig.left.scaled(scale), right=rig.rig.right.scaled(scale))
            visible = cast_stereo(surface, rig.sandbox_from_left, small)
            ties = [
                match_stereo_windows(
                    visible,
                    read_resized(left[azimuth], rig.rig.left, scale),
                    read_resized(right[azimuth], rig.rig.right, scale),
                    WINDOW,
                )
                for azimuth in azimuths
            ]
            metrics += tie_metrics(f"left and right photos, position {position}", rig.rig, ties)
    return metrics


def _scale(rig: StereoRig) -> float:
    """Return the scale of the compared photos of a rig."""
    return reduced_scale(SCALE, rig.left.width)


def tie_metrics(subject: str, rig: StereoRig, ties: list[StereoMatches]) -> list[Metric]:
    """Return the metrics of the matched windows of stereo pairs of a position, in reduced photos."""
    searched, matched = sum(pair.tried for pair in ties), sum(len(pair.right) for pair in ties)
    if searched < MIN_SEARCHED_WINDOWS:
        return []
    metrics = [Metric(subject, "windows_found", matched / searched, "1", searched, "photos")]
    if matched < MIN_MATCHED_WINDOWS:
        return metrics
    offset = np.concatenate([pair.right - pair.expected for pair in ties]) / _scale(rig)
    points = np.concatenate([pair.points_left for pair in ties])
    lines = _epipolar_directions(rig, points)
    across = lines[:, 0] * offset[:, 1] - lines[:, 1] * offset[:, 0]
    along = (lines * offset).sum(axis=1)
    median = float(np.median(across))
    spread = float(SD_OF_MAD * np.median(np.abs(across - median)))
    values = {"across_rows": abs(median), "across_rows_spread": spread, "along_rows": abs(float(np.median(along)))}
    return metrics + metrics_of(subject, matched, "photos", **{name: (px, "px") for name, px in values.items()})


def _epipolar_directions(rig: StereoRig, points_left: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 2) along the epipolar lines of points (n, 3) in the right photo."""
    right_from_left = rig.left_from_right.inverse()
    near, far = (rig.right.project(right_from_left.apply(points_left * share)) for share in (0.99, 1.01))
    return np.asarray((near - far) / np.linalg.norm(near - far, axis=1, keepdims=True) * np.sign(near - far)[:, :1])


def boxes_of_both(
    localised: Mapping[str, LocalisedRig], outlines: Outlines, annotated: Mapping[PhotoKey, PhotoLabels]
) -> list[Metric]:
    """Return the differences between the cameras in the fit of projected meshes to annotated boxes, by position."""
    metrics = []
    for position, rig in sorted(localised.items()):
        boxes_of = {camera: agreed_boxes(annotated, position, camera) for camera in "LR"}
        if min(map(len, boxes_of.values())) < MIN_ROCK_BOXES or rig.unproven:
            continue
        offset_of, iou_of = {}, {}
        for camera, boxes in boxes_of.items():
            view = rig.camera(camera)
            projected = outlines.seen(view)
            rocks, rows = match_by_position_and_size(projected, boxes, match_gate_px(view.lens.width))
            vertical = (projected[rocks][:, [1, 3]] - boxes[rows][:, [1, 3]]).mean(axis=1)
            offset_of[camera] = dict(zip(rocks.tolist(), vertical.tolist(), strict=True))
            iou_of[camera] = float(np.diag(iou(projected[rocks], boxes[rows])).sum()) / len(boxes)
        subject = f"left and right boxes, position {position}"
        n = min(map(len, boxes_of.values()))
        metrics.append(Metric(subject, "iou_lost", iou_of["L"] - iou_of["R"], "1", n, "labels"))
        both = sorted(set(offset_of["L"]) & set(offset_of["R"]))
        if len(both) >= MIN_ROCK_BOXES:
            difference = abs(float(np.median([offset_of["R"][rock] - offset_of["L"][rock] for rock in both])))
            metrics.append(Metric(subject, "boxes_across_rows", difference, "px", len(both), "labels"))
    return metrics
