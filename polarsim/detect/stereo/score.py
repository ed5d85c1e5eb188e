"""Accuracy of stereo depth for a pair of photos and for each rock."""

from __future__ import annotations

import numpy as np

from polarsim.detect.stereo.truth import DepthTruth
from polarsim.photo import NO_ROCK
from polarsim.schemas.detect import BAD_DEPTH_MM, BAD_DEPTH_PERCENT

NEAREST_M, FARTHEST_M = 1.5, 9.0  # range of evaluated depths: from the nearest sand to the far wall
MIN_ROCK_PX = 25  # minimum number of pixels of an evaluated rock


def score_depth(depth: np.ndarray, truth: DepthTruth) -> dict[str, float]:
    """Return the metrics of a pair over pixels visible in both cameras and within the range of depths.

    Pixels without depth count as bad, so that omitting difficult pixels does not improve the metrics.

    Parameters
    ----------
    depth : (h, w)
        Metres, NaN for missing values.
    """
    evaluated = _evaluated(truth)
    error, true = np.abs(depth - truth.depth)[evaluated], truth.depth[evaluated]
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
    evaluated = _evaluated(truth) & (truth.rock != NO_ROCK)
    rocks, number = np.unique(truth.rock[evaluated], return_inverse=True)
    right = np.abs(depth - truth.depth)[evaluated] <= BAD_DEPTH_MM / 1000
    pixels = np.bincount(number, minlength=len(rocks))
    share = np.bincount(number, right, minlength=len(rocks)) / np.maximum(pixels, 1)
    return [
        {"rock": int(rock), "pixels": int(count), "performance": float(value)}
        for rock, count, value in zip(rocks, pixels, share, strict=True)
        if count >= MIN_ROCK_PX
    ]


def _evaluated(truth: DepthTruth) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return truth.shared & (truth.depth >= NEAREST_M) & (truth.depth <= FARTHEST_M)
