"""Check of a stereo calibration against the photos of a terrain."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import png
from polarsim.geometry.features import Features, match_features, sift_features
from polarsim.geometry.stereo import StereoRig, epipolar_distances, triangulated_depth
from polarsim.photo import PhotoKey, photo_scale
from polarsim.tone import to_uint8

_SCALE = 0.5  # scale of the photos for feature detection
_MAX_FEATURES = 2000
_MIN_MATCHES = 40  # minimum number of RANSAC inliers; pairs with fewer are not checked
_RANSAC_PX = 1.0  # maximum distance of an inlier from the epipolar line, in the reduced photo
# Maximum of the median distance of matches from the epipolar lines of the calibration, px of a photo of the reference
# width. On eight pairs of the analog 0.2 to 0.4 px; with a calibration at half the size 5 to 13 px, with exchanged
# lenses 16 to 23 px. In small photos, matches are less accurate than this, hence the lower limit.
_MAX_DISTANCE_PX, _MIN_LIMIT_PX = 3.0, 1.0
_MIN_IN_FRONT = 0.5  # minimum share of matches in front of the cameras

log = logging.getLogger("polarsim")


def check_calibration(
    photos: Mapping[PhotoKey, Path], rig: StereoRig, calibration: Path | None, usual_exposure_ms: int
) -> None:
    """Compare a calibration with a stereo pair of each position.

    Parameters
    ----------
    calibration : Path or None
        The file of the calibration; None: the stated calibration of the site.
    usual_exposure_ms
        The exposure that is preferred.

    Raises
    ------
    FormatError
        Left and right photos of a position are exchanged, or matched features are too far from the epipolar lines. The
        latter is only a warning for the stated calibration, which was not measured for these photos.
    """
    for left, right in _pairs(photos, usual_exposure_ms):
        a, b = _matched_pixels(photos[left], photos[right])
        if len(a) < _MIN_MATCHES:
            log.info("%s: too few features in both photos to check the stereo calibration", left)
            continue
        distance_px = float(np.median(epipolar_distances(rig, a, b)))
        in_front = float(np.mean(triangulated_depth(rig, a, b) > 0))
        where = f"{left} and {right} ({len(a)} matched features)"
        if in_front < _MIN_IN_FRONT:
            reason = f"left and right are exchanged: {1 - in_front:.0%} of the points in {where}"
            raise FormatError(f"{reason} would be behind the cameras", path=calibration or photos[left])
        if distance_px > max(_MIN_LIMIT_PX, _MAX_DISTANCE_PX * photo_scale(rig.left.width)):
            off = f"matches are {distance_px:.1f} px off the epipolar lines in {where}"
            reason = f"calibration contradicts the photos: {off}"
            if calibration:
                raise FormatError(reason, path=calibration)
            log.warning("no calibration of the terrain, and that of the site: %s", reason)


def _matched_pixels(left: Path, right: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return matched pixels (n, 2) of both photos.

    Wrong matches are removed by a fundamental matrix fitted to the matches (RANSAC), independent of the calibration.
    """
    import cv2

    in_left, in_right = _features(left), _features(right)
    first, second = match_features(in_left, in_right)
    a, b = in_left.pixels[first], in_right.pixels[second]
    if len(a) < _MIN_MATCHES:
        return a, b
    cv2.setRNGSeed(0)
    _, fits = cv2.findFundamentalMat(a, b, cv2.FM_RANSAC, _RANSAC_PX / _SCALE, 0.999, 2000)
    chosen = np.zeros(len(a), bool) if fits is None else fits.ravel().astype(bool)
    return a[chosen], b[chosen]


def _pairs(photos: Mapping[PhotoKey, Path], usual_exposure_ms: int) -> list[tuple[PhotoKey, PhotoKey]]:
    """Return the best exposed stereo pair of each position: lit by a Sun lamp, exposure nearest to the usual one."""
    best: dict[str, PhotoKey] = {}
    for key in sorted(photos):
        if key.camera == "L" and key.has_sun and key.other_camera in photos:
            former = best.get(key.position)
            rank = key.stops_from(usual_exposure_ms), key.light == "on"
            if former is None or rank < (former.stops_from(usual_exposure_ms), former.light == "on"):
                best[key.position] = key
    return [(key, key.other_camera) for key in best.values()]


def _features(path: Path) -> Features:
    """Return the features of a photo, in pixels of the full photo."""
    import cv2

    try:
        grey = to_uint8(png.read_photo(path, None))
    except PolarsimError as error:
        log.warning("%s: not used to check the calibration", error)
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    small = cv2.resize(grey, None, fx=_SCALE, fy=_SCALE, interpolation=cv2.INTER_AREA)
    features = sift_features(small, _MAX_FEATURES)
    return Features(features.pixels / _SCALE, features.descriptors)
