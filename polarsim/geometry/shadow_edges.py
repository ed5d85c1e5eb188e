"""Shadow edges in brightness profiles across a penumbra."""

from __future__ import annotations

import numpy as np

WINDOW_M = 0.22  # metres on both sides of an edge in which the profile is fitted, unless the penumbra is wide
BEYOND_M = 0.01  # metres outside the penumbra in which ground counts as fully lit or fully dark
CLEAR_M = 0.06  # minimum width of lit ground and of dark ground in the window, metres
FAINT = 0.3  # added to brightness relative to lit ground, so that glare and light of walls in deep shadow do not count
MIN_RATIO = 1.6  # minimum ratio of the brightness of lit and dark ground
MIN_KNOWN = 0.7  # minimum share of known points in the window
MAX_UNEXPLAINED = 0.3  # maximum share of the variance of log brightness that the fitted edge does not explain
COARSE = 2  # step between tested offsets, points
_DARKEST = 1e-3  # brightness relative to the brightest point, against logarithms of zero


def segment_share(height: np.ndarray) -> np.ndarray:
    """Return the share (n,) of a disc above a line; `height` (n,) of the centre above the line, in radii."""
    u = np.clip(height, -1.0, 1.0)
    return np.asarray(0.5 + (u * np.sqrt(1 - u**2) + np.arcsin(u)) / np.pi)


def shadow_edge_offsets(brightness: np.ndarray, penumbra: np.ndarray, step: float, reach: float) -> np.ndarray:
    """Return the offset (n,) of the shadow edge from the middle of profiles (n, k), metres; NaN without a clear edge.

    A disc lamp that rises above a straight edge is fitted: the edge is the point at which half of the disc is visible.
    The fit minimises differences of log brightness, because the brightness of sand in grazing light varies by factors.
    Lit ground has the geometric mean brightness of the points beyond the penumbra.

    `brightness`: linear, from the shadow to the light, NaN where unknown.
    `penumbra` (n,): half width of the penumbra, metres.
    `step`: distance between points, metres.
    `reach`: maximum offset, metres; less if the profile is shorter than `reach` and the window of the penumbra.
    """
    offset = np.full(len(brightness), np.nan)
    centre = brightness.shape[1] // 2
    for row, width in enumerate(penumbra):
        margin = round(max(WINDOW_M, width + CLEAR_M) / step)
        half = min(round(reach / step) + margin, centre)
        if half <= margin:
            continue
        profile = brightness[row, centre - half : centre + half + 1]
        windows = np.lib.stride_tricks.sliding_window_view(profile, 2 * margin + 1)[::COARSE]
        middle = (half - margin) / COARSE  # number of the window around the middle
        at = np.arange(-margin, margin + 1) * step
        unexplained = _unexplained(windows, at, max(float(width), step))
        best = int(unexplained.argmin())
        around = unexplained[best - 1 : best + 2] if 0 < best < len(unexplained) - 1 else np.full(3, np.inf)
        if np.isfinite(around).all() and around[1] < MAX_UNEXPLAINED:
            before, least, after = around
            curvature = before - 2 * least + after
            peak = (before - after) / (2 * curvature) if curvature > 0 else 0.0
            offset[row] = (best + peak - middle) * COARSE * step
    return offset


def _unexplained(window: np.ndarray, at: np.ndarray, width: float) -> np.ndarray:
    """Return the unexplained share (m,) of the variance of log brightness for an edge in the middle of windows (m, k).

    `at` (k,): offsets of the points from the middle, metres. Infinite for windows with gaps or without contrast.
    """
    share = np.full(len(window), np.inf)
    known = np.isfinite(window)
    is_dark, is_lit = at < -width - BEYOND_M, at > width + BEYOND_M
    chosen = (known.mean(axis=1) > MIN_KNOWN) & known[:, is_dark].any(axis=1)
    chosen &= (np.where(known, window, 0.0)[:, is_lit] > 0).any(axis=1)
    if not chosen.any():
        return share
    known, values = known[chosen], window[chosen]
    values = np.where(known, np.maximum(values, _DARKEST * np.nanmax(values, axis=1, keepdims=True)), 1.0)
    dark = _mean(values[:, is_dark], known[:, is_dark])[:, None]
    lit = np.exp(_mean(np.log(values[:, is_lit]), known[:, is_lit]))[:, None]
    observed = np.log(values + FAINT * lit)
    expected = np.log(dark + np.maximum(lit - dark, 0.0) * segment_share(at / width) + FAINT * lit)
    variance = _mean((observed - _mean(observed, known)[:, None]) ** 2, known)
    left = _mean((observed - expected) ** 2, known)
    usable = (lit > MIN_RATIO * dark)[:, 0] & (variance > 0)
    share[chosen] = np.where(usable, left / np.where(usable, variance, 1.0), np.inf)
    return share


def _mean(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return the mean (n,) of the known values (n, k)."""
    return np.asarray((values * known).sum(axis=1) / np.maximum(known.sum(axis=1), 1))
