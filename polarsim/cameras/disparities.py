"""Disparities between left and right photos, from all Sun lamps at once.

Each lamp shows other shadows and relief, and a pixel must match under every lamp that lights it. Disparities are
searched coarsely over all depths, by semi-global aggregation, and refined at finer scales.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.geometry.aggregation import aggregate, minima
from polarsim.geometry.contrast import blurred, local_contrast
from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.stereo import StereoRig, rectified_left

FLOOR = 0.03  # log units: contrast of grain and noise, below which a pattern has little weight
DARK = 0.002  # share of the 99th percentile that is added to all pixels: limits the noise of shadows in logarithms
CONTRAST_PX, WINDOW_PX = 6.0, 2.0  # standard deviations of the windows of local contrast and of the correlation
SMALL_STEP, LARGE_STEP = 0.1, 0.6  # costs of neighbouring pixels that differ by one candidate, and by more
MIN_CORRELATION = 0.4
MIN_EVIDENCE = 0.2  # minimum contrast: squared patterns, summed over the lamps
COARSE_SCALE = 0.25  # of the photos in which all depths are tried


@dataclass(frozen=True)
class Refinement:
    """Scale and candidates of a refinement of disparities."""

    scale: float  # of the photos
    reach_px: float  # maximum change of the disparity, pixels of this scale
    step_px: float  # between candidates


HALF, FULL = Refinement(0.5, 4.0, 0.5), Refinement(1.0, 2.0, 0.5)


@dataclass(frozen=True)
class StereoPhotos:
    """Left and right photos of a position under the same lamps: (h, w) float32, light above black, NaN if unusable."""

    left: Sequence[np.ndarray]
    right: Sequence[np.ndarray]


@dataclass(frozen=True)
class RangePoints:
    """Points at the pixels of the rectified left photo, shrunk by a scale."""

    lens: Lens  # of the rectified left photo
    points_left: np.ndarray  # (h, w, 3) left frame, metres; NaN where the photos do not match
    logs: Sequence[np.ndarray]  # (h, w) float32, logarithm of the rectified left photo under each lamp


def measure_points(
    photos: StereoPhotos, rig: StereoRig, levels: Sequence[Refinement], depths: tuple[float, float]
) -> RangePoints:
    """Match the photos of a position; `depths`: range of the search along the optical axis, metres."""
    scale = COARSE_SCALE
    _, left, right = _patterns(photos, rig, scale)
    grid = rectified_left(rig)
    baseline = float(np.linalg.norm(rig.left_from_right.translation))
    disparity = _searched(left, right, grid.lens.scaled(scale).fx * baseline, depths)
    for level in levels:
        logs, left, right = _patterns(photos, rig, level.scale)
        base = _enlarged(ndimage.median_filter(disparity, 5), left[0].shape, round(level.scale / scale))
        disparity, known = _refined(left, right, base, level)
        scale = level.scale
    lens = grid.lens.scaled(scale)
    known &= disparity > lens.fx * baseline / depths[1]
    depth = np.where(known, lens.fx * baseline / np.where(known, disparity, 1.0), np.nan)
    points = grid.left_from_rectified.apply(lens.pixel_directions() * depth[..., None])
    return RangePoints(lens, points, logs)


def _enlarged(disparity: np.ndarray, shape: tuple[int, ...], factor: int) -> np.ndarray:
    """Return the disparity of each pixel of a photo that is `factor` times as large; steps at edges stay steps."""
    return np.asarray(np.kron(disparity, np.ones((factor, factor)))[: shape[0], : shape[1]] * factor)


def _patterns(
    photos: StereoPhotos, rig: StereoRig, scale: float
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Return the logarithms of rectified left photos, and the patterns of left and right photos."""
    logs = [_rectified_log(picture, rig, "L", scale) for picture in photos.left]
    left = [local_contrast(values, CONTRAST_PX, FLOOR) for values in logs]
    right = [local_contrast(_rectified_log(picture, rig, "R", scale), CONTRAST_PX, FLOOR) for picture in photos.right]
    return logs, left, right


def _rectified_log(picture: np.ndarray, rig: StereoRig, camera: str, scale: float) -> np.ndarray:
    """Return the logarithm (h, w) of a photo, resampled as a pinhole parallel to that of the second camera."""
    import cv2

    grid = rectified_left(rig)
    directions = grid.left_from_rectified.rotate(grid.lens.scaled(scale).pixel_directions())
    pixels = rig.lens(camera).project(rig.left_from(camera).inverse().rotate(directions))
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    small = picture if scale == 1 else cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    at = (np.nan_to_num(pixels, nan=-100.0) * scale - HALF_PIXEL).astype(np.float32)
    flat = cv2.remap(
        small, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=float("nan")
    )
    bright = float(np.nanpercentile(flat, 99)) if np.isfinite(flat).any() else 1.0
    return np.log(np.maximum(flat, 0) + max(DARK * bright, 1e-9)).astype(np.float32)


def _searched(
    left: Sequence[np.ndarray], right: Sequence[np.ndarray], focal_baseline: float, depths: tuple[float, float]
) -> np.ndarray:
    """Return disparities (h, w) of patterns, among all depths."""
    nearest, farthest = (focal_baseline / depth for depth in depths)
    disparities = np.arange(int(farthest), int(nearest) + 1)
    shape = left[0].shape
    cost = np.empty((*shape, len(disparities)), np.float32)
    for number, disparity in enumerate(disparities.tolist()):
        moved = [np.zeros(shape, np.float32) for _ in right]
        for target, pattern in zip(moved, right, strict=True):
            target[:, disparity:] = pattern[:, : shape[1] - disparity]
        correlation, evidence = _correlation(left, moved)
        cost[..., number] = (1 - correlation) * np.minimum(evidence, 1)
    return disparities[0] + minima(aggregate(cost, SMALL_STEP, LARGE_STEP))


def _refined(
    left: Sequence[np.ndarray], right: Sequence[np.ndarray], base: np.ndarray, level: Refinement
) -> tuple[np.ndarray, np.ndarray]:
    """Return disparities (h, w) of patterns near a base disparity, and whether the photos match."""
    import cv2

    count = round(level.reach_px / level.step_px)
    candidates = np.arange(-count, count + 1) * level.step_px
    v, u = np.mgrid[: base.shape[0], : base.shape[1]].astype(np.float32)
    correlation, evidence = (np.empty((*base.shape, len(candidates)), np.float32) for _ in range(2))
    for number, change in enumerate(candidates.tolist()):
        at = (u - base - change).astype(np.float32)
        moved = [
            cv2.remap(pattern, at, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
            for pattern in right
        ]
        correlation[..., number], evidence[..., number] = _correlation(left, moved)
    best = minima(aggregate((1 - correlation) * np.minimum(evidence, 1), SMALL_STEP, LARGE_STEP))
    nearest = np.clip(np.rint(best), 0, len(candidates) - 1).astype(int)[..., None]
    reached, contrast = (np.take_along_axis(part, nearest, axis=2)[..., 0] for part in (correlation, evidence))
    known = (best > 0.5) & (best < len(candidates) - 1.5) & (reached > MIN_CORRELATION) & (contrast > MIN_EVIDENCE)
    return base + np.interp(best, np.arange(len(candidates)), candidates), known


def _correlation(left: Sequence[np.ndarray], right: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the correlation (h, w) of patterns in a window around each pixel, and their contrast."""
    product, norm = (np.zeros(left[0].shape, np.float32) for _ in range(2))
    for one, other in zip(left, right, strict=True):
        product += one * other
        norm += (one**2 + other**2) / 2
    product, norm = blurred(product, WINDOW_PX), blurred(norm, WINDOW_PX)
    return product / np.maximum(norm, 1e-3), norm
