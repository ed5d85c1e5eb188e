"""Whether left and right camera agree under the written rig: by photos of both, or by the boxes that people drew.

A point that the left photo shows lies in a row of the right photo that the rig alone decides, however far away it is.
So photos are laid on each other by the meshes, and what is left across the rows is the rig's error. Without photos the
meshes stand between the two: what their projections are off the boxes should be alike in both cameras.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from polarsim.geometry.boxes import assign, iou
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.patches import Ties, Window, find_ties, look_with_both
from polarsim.geometry.rays import Caster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import CAMERAS, PhotoKey
from polarsim.run_files.best_photos import Pictures, read_shrunk
from polarsim.run_files.rigs import LocalisedRig
from polarsim.scoring.cameras import agreed_boxes
from polarsim.scoring.metrics import Metric
from polarsim.scoring.score import Labels

SCALE = 0.5  # of the photos that are compared: noise is less there, and a search goes farther
WINDOW = Window(half=10, search=8, step=16, likeness=0.7, noise=0.4)  # pixels of the shrunk photos
LEAST_TIES = 50  # windows found, for offsets to be told
LEAST_TRIED = 100  # windows looked for, for a share to be told
LEAST_BOXES = 5  # rocks that boxes of both cameras show
SPREAD = 1.4826  # standard deviations of a normal distribution in its median distance from the median


def photos_of_both(localised: Mapping[str, LocalisedRig], surface: Caster, pictures: Pictures) -> list[Metric]:
    """How far windows of the left photos lie across and along the rows of the right ones, by position."""
    metrics = []
    for position, rig in sorted(localised.items()):
        left, right = (pictures.get((position, camera), {}) for camera in CAMERAS)
        azimuths = sorted(set(left) & set(right))
        if azimuths and not rig.unproven:
            small = replace(rig.rig, left=rig.rig.left.scaled(SCALE), right=rig.rig.right.scaled(SCALE))
            seen = look_with_both(surface, rig.sandbox_from_left, small)
            ties = [
                find_ties(
                    seen, read_shrunk(left[azimuth], small.left), read_shrunk(right[azimuth], small.right), WINDOW
                )
                for azimuth in azimuths
            ]
            metrics += tie_metrics(f"left and right photos, position {position}", rig.rig, ties)
    return metrics


def tie_metrics(subject: str, rig: StereoRig, ties: list[Ties]) -> list[Metric]:
    """What windows of a position's pairs of photos, shrunk by `SCALE`, say of its rig."""
    tried, found = sum(one.tried for one in ties), sum(len(one.right) for one in ties)
    if tried < LEAST_TRIED:
        return []
    metrics = [Metric(subject, "windows_found", found / tried, "1", tried, "photos")]
    if found < LEAST_TIES:
        return metrics
    off = np.concatenate([one.right - one.expected for one in ties]) / SCALE
    points = np.concatenate([one.points_left for one in ties])
    rows = _along_rows(rig, points)
    across, along = rows[:, 0] * off[:, 1] - rows[:, 1] * off[:, 0], (rows * off).sum(axis=1)
    median = float(np.median(across))
    spread = float(SPREAD * np.median(np.abs(across - median)))
    return [
        *metrics,
        Metric(subject, "across_rows", abs(median), "px", found, "photos"),
        Metric(subject, "across_rows_spread", spread, "px", found, "photos"),
        Metric(subject, "along_rows", abs(float(np.median(along))), "px", found, "photos"),
    ]


def _along_rows(rig: StereoRig, points_left: np.ndarray) -> np.ndarray:
    """(n, 2) unit vectors in the right photo along which points (n, 3) move with their distance."""
    right_from_left = rig.left_from_right.inverse()
    near, far = (rig.right.project(right_from_left.apply(points_left * share)) for share in (0.99, 1.01))
    return np.asarray((near - far) / np.linalg.norm(near - far, axis=1, keepdims=True) * np.sign(near - far)[:, :1])


def boxes_of_both(
    localised: Mapping[str, LocalisedRig], outlines: Outlines, annotated: Mapping[PhotoKey, Labels]
) -> list[Metric]:
    """How otherwise projected meshes meet the boxes of the right camera than those of the left one, by position."""
    metrics = []
    for position, rig in sorted(localised.items()):
        boxes = {camera: agreed_boxes(annotated, position, camera) for camera in CAMERAS}
        if min(map(len, boxes.values())) < LEAST_BOXES or rig.unproven:
            continue
        down, share = {}, {}
        for camera, own in boxes.items():
            projected = outlines.seen(rig.camera(camera))
            rocks, rows = assign(projected, own)
            off = (projected[rocks][:, [1, 3]] - own[rows][:, [1, 3]]).mean(axis=1)
            down[camera] = dict(zip(rocks.tolist(), off.tolist(), strict=True))
            share[camera] = float(np.diag(iou(projected[rocks], own[rows])).sum()) / len(own)
        subject = f"left and right boxes, position {position}"
        n = min(map(len, boxes.values()))
        metrics.append(Metric(subject, "iou_lost", share["L"] - share["R"], "1", n, "labels"))
        both = sorted(set(down["L"]) & set(down["R"]))
        if len(both) >= LEAST_BOXES:
            apart = abs(float(np.median([down["R"][rock] - down["L"][rock] for rock in both])))
            metrics.append(Metric(subject, "boxes_across_rows", apart, "px", len(both), "labels"))
    return metrics
