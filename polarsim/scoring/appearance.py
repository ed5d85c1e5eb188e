"""Appearance of a twin next to the photo: PSNR, SSIM and correlation after the best monotone tone curve.

The reflectance models and the exposure of a twin are approximate, so that grey values of twin and photo differ by an
unknown monotone curve. The curve is fitted for each photo (isotonic regression), and only the remaining differences
count: shadows, relief, walls, texture. Brightness is measured separately, in stops, on sand that the lamp lights: light
in shadows comes from walls and surroundings, which the twins approximate by a constant.

A curve with many levels also explains a part of the twin of another scene. Therefore `scoring.twin_photos` compares
each photo with the twin of another terrain as well.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.photo import BLACK_LEVEL
from polarsim.tone import display_white_level, to_uint8

REDUCTION = 4  # side in px of the squares whose mean is compared: differences of single pixels do not count
ROWS, COLUMNS = (0.15, 0.68), (0.10, 0.90)  # part of the image that shows the sandbox, share of height and width
SSIM_SIGMA_PX = 1.5  # standard deviation of the window of Wang et al., IEEE Trans. Image Process. 13 (2004) 600
LIT_DN, FULL_DN = 40, 4000  # range of grey values above black in which a ratio is neither noise nor clipped


@dataclass(frozen=True)
class Appearance:
    """Similarity of a twin and the photo after the best monotone tone curve."""

    psnr_db: float  # of 8-bit images with display tone mapping
    ssim: float
    correlation: float
    stops: float  # median |log2 (twin / photo)| on lit sand, without the median ratio; NaN without lit sand
    lit_px: int  # number of pixels of lit sand, at reduced size, that are neither dark nor clipped in both images
    log2_twin_over_photo: float  # median over these pixels
    log2_difference: float  # median of absolute values over these pixels


@dataclass(frozen=True)
class ReducedPhoto:
    """Compared part of a photo at reduced size, all (h, w)."""

    tones: np.ndarray  # float32, grey values of the displayed photo, 0 to 255
    light: np.ndarray | None  # float32, DN above black; None for 8-bit photos, whose tone curve is unknown
    valid: np.ndarray  # bool, pixels without an ignored pixel of the full size
    lit_sand: np.ndarray  # bool, pixels that show lit sand only


@dataclass(frozen=True)
class ToneCurve:
    """Increasing curve from grey values of the twin to grey values of the displayed photo."""

    levels: np.ndarray  # (n,) of the twin, increasing
    tones: np.ndarray  # (n,) of the photo, not decreasing

    def apply(self, twin: np.ndarray) -> np.ndarray:
        """Return the photo's grey values, float32, predicted from a twin of any shape."""
        return np.interp(twin, self.levels, self.tones).astype(np.float32)


def compare_appearance(
    photo: np.ndarray, twin: np.ndarray, ignored: np.ndarray | None = None, lit_sand: np.ndarray | None = None
) -> Appearance:
    """Compare a twin (h, w) uint16 and the photo on the part of the image that shows the sandbox.

    Parameters
    ----------
    photo : (h, w) uint16 or uint8
        Photo with linear grey values, or published photo with an unknown tone curve.
    ignored : (h, w) bool, optional
        Pixels of the photo that are not compared, such as drawn lines.
    lit_sand : (h, w) bool, optional
        Pixels whose brightness is compared; default: all.
    """
    reduced = reduce_photo(photo, ignored, lit_sand)
    return compare_reduced(reduced, reduce_picture(twin))


def reduce_photo(
    photo: np.ndarray, ignored: np.ndarray | None = None, lit_sand: np.ndarray | None = None
) -> ReducedPhoto:
    """Return the compared part of a photo, see `compare_appearance`."""
    used = photo if ignored is None or ignored.all() else photo[~ignored]
    tones = reduce_picture(to_uint8(photo, display_white_level(used)))
    everywhere = np.ones(tones.shape, bool)
    valid = everywhere if ignored is None else reduce_picture(ignored) == 0
    sand = everywhere if lit_sand is None else reduce_picture(~lit_sand) == 0
    light = None if photo.dtype == np.uint8 else reduce_picture(photo) - BLACK_LEVEL
    return ReducedPhoto(tones, light, valid, sand)


def sandbox_part(picture: np.ndarray) -> np.ndarray:
    """Return the compared part of an image (h, w); height and width are multiples of `REDUCTION`."""
    rows, columns = (
        slice(*(REDUCTION * round(share * (side // REDUCTION)) for share in shares))
        for side, shares in zip(picture.shape, (ROWS, COLUMNS), strict=True)
    )
    return picture[rows, columns]


def reduce_picture(picture: np.ndarray) -> np.ndarray:
    """Return the compared part (h, w) of an image at reduced size, float32."""
    import cv2

    part = sandbox_part(picture).astype(np.float32)
    size = (part.shape[1] // REDUCTION, part.shape[0] // REDUCTION)
    return np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_AREA))


def compare_reduced(photo: ReducedPhoto, twin: np.ndarray, toned: np.ndarray | None = None) -> Appearance:
    """Compare a photo and a twin (h, w) float32, both reduced; NaN if no pixel is valid.

    `toned`: `toned_twin` of both, if already computed.
    """
    valid = photo.valid
    sand = valid & photo.lit_sand
    ratio = np.empty(0) if photo.light is None else log_ratio(photo.light[sand], twin[sand] - BLACK_LEVEL)
    typical = float(np.median(ratio)) if ratio.size else np.nan
    spread, difference = (float(np.median(np.abs(ratio - at))) if ratio.size else np.nan for at in (typical, 0))
    brightness = (spread, ratio.size, typical, difference)
    if not valid.any():
        return Appearance(np.nan, np.nan, np.nan, *brightness)
    toned = toned_twin(photo, twin) if toned is None else toned
    error = float(((photo.tones[valid] - toned[valid]) ** 2).mean())
    return Appearance(
        10 * float(np.log10(255**2 / max(error, 1e-6))),
        structural_similarity(photo.tones, toned, valid),
        _correlation(photo.tones[valid], toned[valid]),
        *brightness,
    )


def toned_twin(photo: ReducedPhoto, twin: np.ndarray) -> np.ndarray:
    """Return the reduced twin (h, w) with the best tone curve, float32, in grey values of the displayed photo."""
    return tone_of_twin(photo, twin).apply(twin)


def tone_of_twin(photo: ReducedPhoto, twin: np.ndarray) -> ToneCurve:
    """Return the best tone curve of the valid pixels of a photo and the twin (h, w), both reduced."""
    return fit_tone(twin[photo.valid], photo.tones[photo.valid])


def fit_tone(twin: np.ndarray, photo: np.ndarray) -> ToneCurve:
    """Return the increasing curve that best predicts grey values of the photo from those of the twin, same shape.

    Pixels of equal twin value are averaged first, so that the order of pixels has no effect.
    """
    from scipy.optimize import isotonic_regression

    levels, index, counts = np.unique(twin, return_inverse=True, return_counts=True)
    means = np.bincount(index.ravel(), photo.ravel()) / counts
    return ToneCurve(levels, isotonic_regression(means, weights=counts).x)


def log_ratio(photo: np.ndarray, twin: np.ndarray) -> np.ndarray:
    """Return log2(twin / photo), (n,), of pixels lit and not clipped in both; arguments in DN above black."""
    lit = (np.minimum(photo, twin) > LIT_DN) & (np.maximum(photo, twin) < FULL_DN)
    return np.log2(twin[lit] / photo[lit])


def structural_similarity(first: np.ndarray, second: np.ndarray, valid: np.ndarray | None = None) -> float:
    """Return the mean structural similarity of two images (h, w) float32 with grey values from 0 to 255.

    Only `valid` pixels (h, w) count; windows that contain others are averages of their valid pixels.
    """
    import cv2

    valid = np.ones(first.shape, bool) if valid is None else valid

    def blur(picture: np.ndarray) -> np.ndarray:
        picture = np.where(valid, picture, 0).astype(np.float32)
        return np.asarray(cv2.GaussianBlur(picture, (0, 0), SSIM_SIGMA_PX, borderType=cv2.BORDER_REFLECT))

    weight = np.where(valid, blur(np.ones_like(first)), 1)

    def mean(picture: np.ndarray) -> np.ndarray:
        return blur(picture) / weight

    mean1, mean2 = mean(first), mean(second)
    variance1, variance2 = mean(first * first) - mean1**2, mean(second * second) - mean2**2
    covariance = mean(first * second) - mean1 * mean2
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    similarity = (2 * mean1 * mean2 + c1) * (2 * covariance + c2)
    return float((similarity / ((mean1**2 + mean2**2 + c1) * (variance1 + variance2 + c2)))[valid].mean())


def _correlation(first: np.ndarray, second: np.ndarray) -> float:
    if min(np.ptp(first), np.ptp(second)) < 1e-3:  # a constant image explains nothing
        return 0.0
    return float(np.corrcoef(first, second)[0, 1])
