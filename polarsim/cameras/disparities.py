"""Disparities between left and right photos, from all Sun lamps at once.

Each lamp shows other shadows and relief, and a pixel must match under every lamp that lights it. Disparities are
searched coarsely over all depths, by semi-global aggregation, and refined at finer scales.

A window at the edge of a rock contains rock and sand, and the surface with more contrast extends over the other. Three
measures limit this: patterns are the texture between edges (`contrast.texture`); next to an edge, the disparities of
both sides are refined and the one with the larger correlation is kept; and windows follow the slope of the surface,
because disparities of the coarser scale are interpolated on surfaces, but not over edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.geometry.aggregation import aggregate, minima
from polarsim.geometry.contrast import blurred, texture
from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.photo import photo_scale

FLOOR = 0.03  # log units: contrast of grain and noise, below which a pattern has little weight
DARK = 0.002  # share of the 99th percentile that is added to all pixels: limits the noise of shadows in logarithms
EDGE = 0.2  # log units: higher steps are edges and no texture
WINDOW_PX = 2.0  # standard deviation of the window of the correlation
SMALL_STEP, LARGE_STEP = 0.1, 0.6  # costs of neighbouring pixels that differ by one candidate, and by more
MIN_CORRELATION = 0.4
MIN_EVIDENCE = 0.2  # minimum contrast: squared patterns, summed over the lamps
COARSE_SCALE = 0.25  # of the photos in which all depths are tried
EVEN_PX = 1.0  # maximum difference of the disparities of neighbours on a surface
SMOOTHING_PX = 1.5  # standard deviation of the window in which disparities of a surface are smoothed, before refinement
REACH_PX = 3  # distance from an edge in which disparities of both sides are tried
MIN_STEP_PX = 3.0  # minimum step of disparities at an edge, at the finer scale
CHOICE_PX = 0.8  # standard deviation of the window of correlations that are compared
LEAD = 0.02  # minimum lead of the correlation of the other side
SPECKLE_PX = 300  # maximum area of a speckle in a photo of the reference width
SPECKLE_STEP_PX = 1.0  # minimum step of disparities at the outline of a speckle
AT_LIMIT = 0.3  # correlation that a minimum at the limit of the candidates loses in this comparison


@dataclass(frozen=True)
class Refinement:
    """Scale and candidates of a refinement of disparities."""

    scale: float  # of the photos
    reach_px: float  # maximum change of the disparity, pixels of this scale
    step_px: float  # between candidates


HALF, FULL = Refinement(0.5, 4.0, 0.5), Refinement(1.0, 2.0, 0.25)


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
        starts = _starts(ndimage.median_filter(disparity, 5), left[0].shape, round(level.scale / scale))
        disparity, known = _best([_refined(left, right, start, level) for start in starts], starts[2] - starts[1])
        scale = level.scale
    lens = grid.lens.scaled(scale)
    known &= disparity > lens.fx * baseline / depths[1]
    known = _without_speckles(disparity, known, scale * photo_scale(rig.left.width))
    depth = np.where(known, lens.fx * baseline / np.where(known, disparity, 1.0), np.nan)
    points = grid.left_from_rectified.apply(lens.pixel_directions() * depth[..., None])
    return RangePoints(lens, points, logs)


def _starts(disparity: np.ndarray, shape: tuple[int, ...], factor: int) -> list[np.ndarray]:
    """Return disparities (h, w) in a photo that is `factor` times as large: own, farthest and nearest surface around.

    The window of the coarser scale moves edges by up to `REACH_PX`.
    """
    side = 2 * REACH_PX + 1
    around = (disparity, ndimage.minimum_filter(disparity, side), ndimage.maximum_filter(disparity, side))
    return [_enlarged(values, shape, factor) for values in around]


def _enlarged(disparity: np.ndarray, shape: tuple[int, ...], factor: int) -> np.ndarray:
    """Return the disparity of each pixel of a photo that is `factor` times as large.

    Disparities are smoothed and interpolated on surfaces, so that windows of the next scale have no steps on slopes.
    Steps at edges stay steps.
    """
    import cv2

    values = disparity.astype(np.float32)
    even = (ndimage.maximum_filter(values, 3) - ndimage.minimum_filter(values, 3) < EVEN_PX).astype(np.float32)
    inner = cv2.erode(even, np.ones((2 * round(2 * SMOOTHING_PX) + 1,) * 2, np.uint8)) > 0
    mean = blurred(values * even, SMOOTHING_PX) / np.maximum(blurred(even, SMOOTHING_PX), np.float32(1e-6))
    values = np.where(inner, mean, values)
    block = np.ones((factor, factor), np.float32)
    on_surface = np.kron(cv2.erode(even, np.ones((3, 3), np.uint8)), block) > 0
    size = (values.shape[1] * factor, values.shape[0] * factor)
    interpolated = cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
    enlarged = np.where(on_surface, interpolated, np.kron(values, block))
    return np.asarray(enlarged[: shape[0], : shape[1]], float) * factor


def _patterns(
    photos: StereoPhotos, rig: StereoRig, scale: float
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Return the logarithms of rectified left photos, and the patterns of left and right photos."""
    logs = [_rectified_log(picture, rig, "L", scale) for picture in photos.left]
    left = [texture(values, EDGE, FLOOR) for values in logs]
    right = [texture(_rectified_log(picture, rig, "R", scale), EDGE, FLOOR) for picture in photos.right]
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


@dataclass(frozen=True)
class _Match:
    """Disparities (h, w) near a start, whether the photos match, and the correlation."""

    disparity: np.ndarray
    known: np.ndarray
    correlation: np.ndarray  # float32, reduced if the minimum of the cost is at the limit of the candidates


def _best(matches: Sequence[_Match], step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return disparities (h, w), and whether the photos match, of the match with the largest correlation.

    `step` (h, w): difference of the nearest and farthest start; the first match is kept where it is small.
    """
    correlation = np.stack([blurred(match.correlation, CHOICE_PX) for match in matches])
    correlation[0] += LEAD
    best = np.where(step < MIN_STEP_PX, 0, correlation.argmax(axis=0))
    return np.choose(best, [match.disparity for match in matches]), np.choose(best, [match.known for match in matches])


def _refined(left: Sequence[np.ndarray], right: Sequence[np.ndarray], start: np.ndarray, level: Refinement) -> _Match:
    """Match patterns near start disparities (h, w)."""
    import cv2

    count = round(level.reach_px / level.step_px)
    candidates = np.arange(-count, count + 1) * level.step_px
    v, u = np.mgrid[: start.shape[0], : start.shape[1]].astype(np.float32)
    correlation, evidence = (np.empty((*start.shape, len(candidates)), np.float32) for _ in range(2))
    for number, change in enumerate(candidates.tolist()):
        at = (u - start - change).astype(np.float32)
        moved = [
            cv2.remap(pattern, at, v, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT, borderValue=0.0)
            for pattern in right
        ]
        correlation[..., number], evidence[..., number] = _correlation(left, moved)
    best = minima(aggregate((1 - correlation) * np.minimum(evidence, 1), SMALL_STEP, LARGE_STEP))
    nearest = np.clip(np.rint(best), 0, len(candidates) - 1).astype(int)[..., None]
    reached, contrast = (np.take_along_axis(part, nearest, axis=2)[..., 0] for part in (correlation, evidence))
    inside = (best > 0.5) & (best < len(candidates) - 1.5)
    known = inside & (reached > MIN_CORRELATION) & (contrast > MIN_EVIDENCE)
    disparity = start + np.interp(best, np.arange(len(candidates)), candidates)
    return _Match(disparity, known, np.where(inside, reached, reached - np.float32(AT_LIMIT)))


def _without_speckles(disparity: np.ndarray, known: np.ndarray, scale: float) -> np.ndarray:
    """Return the known pixels (h, w) without small areas that steps separate from all others.

    `scale`: of the disparities relative to a photo of the reference size.
    """
    import cv2

    unit = SPECKLE_STEP_PX / 16
    steps = np.where(known, np.clip(np.rint(disparity / unit), 0, np.iinfo(np.int16).max), -1).astype(np.int16)
    cv2.filterSpeckles(steps, -1, round(SPECKLE_PX * scale**2), 16)
    return known & (steps >= 0)


def _correlation(left: Sequence[np.ndarray], right: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the correlation (h, w) of patterns in a window around each pixel, and their contrast."""
    product, norm = (np.zeros(left[0].shape, np.float32) for _ in range(2))
    for one, other in zip(left, right, strict=True):
        product += one * other
        norm += (one**2 + other**2) / 2
    product, norm = blurred(product, WINDOW_PX), blurred(norm, WINDOW_PX)
    return product / np.maximum(norm, 1e-3), norm
