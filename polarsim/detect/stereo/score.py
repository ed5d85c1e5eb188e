"""How good depths are: of a pair of photos, and of every rock in it."""

from __future__ import annotations

import numpy as np

from polarsim.detect.stereo.truth import DepthTruth
from polarsim.photo import NO_ROCK
from polarsim.schemas.detect import BAD_DEPTH_MM, BAD_DEPTH_PERCENT

NEAREST_M, FARTHEST_M = 1.5, 9.0  # evaluated depths: from the nearest sand of NASA's rig to the far wall
MIN_ROCK_PX = 25  # of the matched image: on smaller rocks a share of pixels says little


def score(depth: np.ndarray, truth: DepthTruth) -> dict[str, float]:
    """Figures of a pair over the pixels that both cameras see, between the nearest and the farthest depth.

    A pixel without a depth is a bad one, so that leaving out what is hard does not pay.

    Parameters
    ----------
    depth : (h, w)
        Metres, NaN for none.
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
        "bad_share": float(1 - (error <= BAD_DEPTH_MM / 1000).mean()),  # NaN is not within any limit
        "bad_relative_share": float(1 - (error <= BAD_DEPTH_PERCENT / 100 * true).mean()),
    }


def rock_performance(depth: np.ndarray, truth: DepthTruth) -> list[dict[str, float]]:
    """Return rock, pixels and performance of every rock with enough pixels: their share within `BAD_DEPTH_MM`."""
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
