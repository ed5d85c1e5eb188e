"""Reference depth and rock of each pixel of the rectified left camera, and the accuracy of stereo depth against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.rays import Caster
from polarsim.photo import NO_ROCK
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.schemas.detect import BAD_DEPTH_MM, BAD_DEPTH_PERCENT

NEAREST_M, FARTHEST_M = 1.5, 9.0  # minimum range of matched depths, which contains POLAR's sandbox
MIN_ROCK_PX = 25  # minimum number of pixels of an evaluated rock


@dataclass(frozen=True)
class DepthTruth:
    """Reference values of each pixel of the rectified left image."""

    depth: np.ndarray  # (h, w) metres along z, NaN outside the meshes
    rock: np.ndarray  # (h, w) rock id or NO_ROCK
    shared: np.ndarray  # (h, w) bool: the point is visible in the right camera


def depth_truth(mesh: TerrainMesh, caster: Caster, localised: LocalisedRig, rig: Rectification) -> DepthTruth:
    """Cast a ray through each pixel, and a ray from each hit to the right camera."""
    sandbox_from_rectified = localised.sandbox_from_left @ rig.left_from_rectified
    shape = rig.lens.shape
    directions = sandbox_from_rectified.rotate(rig.lens.pixel_directions().reshape(-1, 3))
    origins = np.broadcast_to(sandbox_from_rectified.translation, directions.shape)
    depth, face = caster.nearest(origins, directions)  # in units of directions, whose z is 1
    hit = np.flatnonzero(np.isfinite(depth))
    points = origins[hit] + depth[hit, None] * directions[hit]
    shared = np.zeros(len(depth), bool)
    pixels = localised.project("R", points)
    size = np.array([localised.rig.right.width, localised.rig.right.height])
    inside = (pixels >= 0).all(axis=1) & (pixels < size).all(axis=1)  # False for NaN, behind the camera
    back = localised.sandbox_from("R").translation - points
    shared[hit] = inside & ~caster.occluded(points, back, 1.0)
    rock = np.full(len(depth), NO_ROCK)
    rock[hit] = mesh.rock_of_face[face[hit]]
    depth = np.where(np.isfinite(depth), depth, np.nan)
    return DepthTruth(depth.reshape(shape), rock.reshape(shape), shared.reshape(shape))


def depth_range(truth: DepthTruth) -> tuple[float, float]:
    """Return the range in which depths are matched, metres: it contains the meshes."""
    depth = truth.depth[np.isfinite(truth.depth)]
    return float(depth.min(initial=NEAREST_M)), float(depth.max(initial=FARTHEST_M))


def score_depth(depth: np.ndarray, truth: DepthTruth) -> dict[str, float]:
    """Return the metrics of a pair over pixels visible in both cameras.

    Pixels without depth (h, w) (NaN) count as bad, so that omitting difficult pixels does not improve the metrics.
    """
    error, true = np.abs(depth - truth.depth)[truth.shared], truth.depth[truth.shared]
    valid = np.isfinite(error)
    if not len(error):
        return {"pixels": 0} | dict.fromkeys(
            ("valid_share", "median_abs_error_mm", "bad_share", "bad_relative_share"), float("nan")
        )
    return {
        "pixels": len(error),
        "valid_share": float(valid.mean()),
        "median_abs_error_mm": 1000 * float(np.median(error[valid])) if valid.any() else float("nan"),
        "bad_share": float(1 - (error <= BAD_DEPTH_MM / 1000).mean()),  # comparisons with NaN are false
        "bad_relative_share": float(1 - (error <= BAD_DEPTH_PERCENT / 100 * true).mean()),
    }


def rock_performance(depth: np.ndarray, truth: DepthTruth) -> list[dict[str, float]]:
    """Return rock, pixels and performance (share of pixels within `BAD_DEPTH_MM`) of each rock with enough pixels."""
    evaluated = truth.shared & (truth.rock != NO_ROCK)
    rocks, number = np.unique(truth.rock[evaluated], return_inverse=True)
    right = np.abs(depth - truth.depth)[evaluated] <= BAD_DEPTH_MM / 1000
    pixels = np.bincount(number, minlength=len(rocks))
    share = np.bincount(number, right, minlength=len(rocks)) / np.maximum(pixels, 1)
    return [
        {"rock": int(rock), "pixels": int(count), "performance": float(value)}
        for rock, count, value in zip(rocks, pixels, share, strict=True)
        if count >= MIN_ROCK_PX
    ]
