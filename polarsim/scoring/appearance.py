"""Appearance of a twin next to the photo: PSNR, SSIM and correlation after the best monotone tone curve.

The reflectance models and the exposure of a twin are approximate, so that grey values of twin and photo differ by an
unknown monotone curve. The curve is fitted for each photo (isotonic regression), and only the remaining differences
count: shadows, relief, walls, texture. Brightness is measured separately, in stops.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.tone import display_white_level, to_8bit

SCALE = 0.25  # scale of the compared images: differences of single pixels do not count
ROWS, COLUMNS = (0.15, 0.68), (0.10, 0.90)  # part of the image that shows the sandbox, share of height and width
SSIM_SIGMA_PX = 1.5  # standard deviation of the window of Wang et al., IEEE Trans. Image Process. 13 (2004) 600
LIT_DN, FULL_DN = 40, 4000  # range of grey values above black in which a ratio is neither noise nor clipped


@dataclass(frozen=True)
class Appearance:
    """Similarity of a twin and the photo after the best monotone tone curve."""

    psnr_db: float  # of 8-bit images with display tone mapping
    ssim: float
    correlation: float
    stops: float  # median |log2 (photo / twin)| of lit pixels, without the median ratio; NaN without lit pixels


def compare_appearance(photo: np.ndarray, twin: np.ndarray) -> Appearance:
    """Compare a twin and the photo, both (h, w) uint16, on the part of the image that shows the sandbox."""
    white = display_white_level(photo)
    shown = _reduced(to_8bit(photo, white)[..., 0])
    fitted = fit_tone(_reduced(twin), shown)
    error = float(((shown - fitted) ** 2).mean())
    return Appearance(
        10 * float(np.log10(255**2 / max(error, 1e-6))),
        structural_similarity(shown, fitted),
        _correlation(shown, fitted),
        _stops(_reduced(photo) - BLACK_LEVEL, _reduced(twin) - BLACK_LEVEL),
    )


def fit_tone(twin: np.ndarray, photo: np.ndarray) -> np.ndarray:
    """Return the photo's grey values (h, w) predicted from those of the twin (h, w) by the best increasing curve.

    Pixels of equal twin value get the same prediction, so that the order of pixels has no effect.
    """
    from scipy.optimize import isotonic_regression

    _, index, counts = np.unique(twin, return_inverse=True, return_counts=True)
    means = np.bincount(index.ravel(), photo.ravel()) / counts
    curve = isotonic_regression(means, weights=counts).x
    return np.asarray(curve[index.ravel()].reshape(twin.shape), np.float32)


def structural_similarity(first: np.ndarray, second: np.ndarray) -> float:
    """Return the mean structural similarity of two images (h, w) float32 with grey values from 0 to 255."""
    import cv2

    def mean(picture: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.GaussianBlur(picture, (0, 0), SSIM_SIGMA_PX, borderType=cv2.BORDER_REFLECT))

    mean1, mean2 = mean(first), mean(second)
    variance1, variance2 = mean(first * first) - mean1**2, mean(second * second) - mean2**2
    covariance = mean(first * second) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    similarity = (2 * mean1 * mean2 + c1) * (2 * covariance + c2)
    return float((similarity / ((mean1**2 + mean2**2 + c1) * (variance1 + variance2 + c2))).mean())


def _reduced(picture: np.ndarray) -> np.ndarray:
    """Return the compared part (h, w) of an image at reduced size, float32."""
    import cv2

    small = cv2.resize(picture.astype(np.float32), None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA)
    rows, columns = (
        slice(round(low * side), round(high * side))
        for side, (low, high) in zip(small.shape, (ROWS, COLUMNS), strict=True)
    )
    return np.ascontiguousarray(small[rows, columns])


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    if min(np.ptp(first), np.ptp(second)) < 1e-3:  # a constant image explains nothing
        return 0.0
    return float(np.corrcoef(first.ravel(), second.ravel())[0, 1])


def _stops(photo: np.ndarray, twin: np.ndarray) -> float:
    lit = (np.minimum(photo, twin) > LIT_DN) & (np.maximum(photo, twin) < FULL_DN)
    if not lit.any():
        return float("nan")
    ratio = np.log2(photo[lit] / twin[lit])
    return float(np.median(np.abs(ratio - np.median(ratio))))
