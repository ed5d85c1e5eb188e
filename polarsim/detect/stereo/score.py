"""How good depths are: of a pair of photos, and of every rock in it."""

from __future__ import annotations

import numpy as np

from polarsim.detect.options import StereoOptions
from polarsim.detect.stereo.truth import DepthTruth
from polarsim.photo import NO_ROCK


def score(depth: np.ndarray, truth: DepthTruth, options: StereoOptions) -> dict[str, float]:
    """Figures of a pair over the pixels that both cameras see, between the nearest and the farthest depth.

    A pixel without a depth is a bad one, so that leaving out what is hard does not pay.

    Parameters
    ----------
    depth : (h, w)
        Metres, NaN for none.
    """
    evaluated = _evaluated(truth, options)
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
        "bad_share": float(1 - (error <= options.bad_mm / 1000).mean()),  # NaN is not within any limit
        "bad_relative_share": float(1 - (error <= options.bad_percent / 100 * true).mean()),
    }


def rock_performance(depth: np.ndarray, truth: DepthTruth, options: StereoOptions) -> list[dict[str, float]]:
    """Rock, pixels, and performance of every rock of which enough is seen: the share of its pixels within `bad_mm`."""
    evaluated = _evaluated(truth, options) & (truth.rock != NO_ROCK)
    rocks, number = np.unique(truth.rock[evaluated], return_inverse=True)
    right = np.abs(depth - truth.depth)[evaluated] <= options.bad_mm / 1000
    pixels = np.bincount(number, minlength=len(rocks))
    share = np.bincount(number, right, minlength=len(rocks)) / np.maximum(pixels, 1)
    return [
        {"rock": int(rock), "pixels": int(count), "performance": float(value)}
        for rock, count, value in zip(rocks, pixels, share, strict=True)
        if count >= options.min_rock_px
    ]


def _evaluated(truth: DepthTruth, options: StereoOptions) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return truth.shared & (truth.depth >= options.nearest_m) & (truth.depth <= options.farthest_m)
