"""Shade that the sandbox's walls throw: where light passes them, and how high a photo shows them to be.

Survey and meshes localise lamps and walls to centimetres, and at a low Sun centimetres move the end of a wall's shade
by decimetres. The edge of that shade is there in the photo: all errors together are told by one number, the height that
the walls would have to have.
"""

from __future__ import annotations

import numpy as np

STEP = 0.01  # metres between the heights that are tried
RANGE = (0.4, 1.8)  # of the stated height
BAND = 0.04  # metres of height below and above the shade's edge that are compared
FEWEST = 50  # samples in a band that tell of its brightness
CLEAR = 1.6  # least ratio of the brightness above and below the edge
FAINT = 0.03  # of lit ground's brightness: differences of less, in the deepest shade, tell of no edge


def passing_heights(points: np.ndarray, lamp: np.ndarray, bounds: np.ndarray) -> np.ndarray:
    """(n,) z at which the light of a lamp (3,) to points (n, 3) passes the walls on bounds (2, 2); inf: it need not."""
    to_lamp = lamp - points
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(to_lamp[:, :2] > 0, bounds[1] - points[:, :2], bounds[0] - points[:, :2]) / to_lamp[:, :2]
    share = np.fmin.reduce(np.where(shares >= 0, shares, np.inf), axis=1)
    return np.where(share < 1, points[:, 2] + share * to_lamp[:, 2], np.inf)


def shading_height(passing: np.ndarray, rate: np.ndarray, stated: float) -> float:
    """Height of walls whose shade ends where a photo shows it to end; the stated one where it shows no such end.

    Parameters
    ----------
    passing, rate : (n,) float
        Height above the ground, metres, at which light passes the walls on its way to bare ground, and how bright that
        ground is in the photo.
    stated
        Of the walls, metres.
    """
    order = np.argsort(passing, kind="stable")
    passing, rate = passing[order], rate[order]
    faint = FAINT * float(np.percentile(rate, 90)) if len(rate) else 0.0
    best, edge, half_lit = CLEAR, stated, 0.0
    for tried in np.arange(RANGE[0] * stated, RANGE[1] * stated, STEP):
        dark, lit = _median(passing, rate, tried - BAND, tried), _median(passing, rate, tried, tried + BAND)
        if lit + faint > best * (dark + faint):
            best, edge, half_lit = (lit + faint) / (dark + faint), tried, (dark + lit) / 2
    while half_lit and _median(passing, rate, edge, edge + STEP) < half_lit:  # a lamp's disc makes the edge soft
        edge += STEP
    return float(edge)


def _median(passing: np.ndarray, rate: np.ndarray, low: float, high: float) -> float:
    """Of the brightness where light passes between two heights, passing in order; NaN where few samples tell."""
    start, end = np.searchsorted(passing, [low, high])
    return float(np.median(rate[start:end])) if end - start >= FEWEST else np.nan
