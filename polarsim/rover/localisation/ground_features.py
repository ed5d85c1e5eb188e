"""Corners of the ground in a stereo pair, their disparities, and their positions in later pictures.

Corners (Shi & Tomasi, CVPR 1994) are tracked by the pyramidal method of Lucas and Kanade (Bouguet, Intel 2000). The
ground is nearly a plane, whose view from another camera is a homography. The old picture is warped by this homography
before the corners are tracked, so that patches have the same size and shape in both pictures.

Positions are OpenCV's: the centre of the first pixel is (0, 0).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from polarsim.detect.stereo.rectify import Rectification
from polarsim.geometry.contrast import local_contrast
from polarsim.geometry.poses import Pose

# Corners: maximum number, minimum quality relative to the best, minimum distance, and side of the window.
_CORNERS, _QUALITY, _APART_PX, _CORNER_PX = 400, 0.02, 7, 5
_WINDOW_PX, _LEVELS = 15, 2  # window and pyramid levels of Lucas and Kanade
_MAX_RETURN_PX = 0.5  # maximum distance from the start after tracking forwards and back
_PATCH_PX, _MIN_CORRELATION = 11, 0.7  # side of patches and their minimum correlation in both pictures
_ORB: dict[str, Any] = {"nfeatures": 1000, "fastThreshold": 8, "scaleFactor": 1.1, "nlevels": 6}
_MIN_INVERSE_DEPTH = 0.05  # 1/m, of matched features
_MIN_Z = 1e-3  # minimum depth after a motion, relative to the depth before
_ROW_PX = 0.7  # maximum difference of the rows of a corner in the left and the right picture
# Window of the local contrast; deviation, of 255, of ground without texture; grey values of a deviation in the result.
_CONTRAST_PX, _FLOOR, _SPREAD = 5.0, 3.0, 40.0
_DARK_SHARE, _BRIGHT_PERCENT = 0.25, 95.0  # dark: below this share of the bright percentile
_LARGE_SHARE, _EDGE_PX = 0.02, 6  # own shadow: dark areas above this share of the picture, and a margin
_BLOCK_PX, _DISPARITY_STEP_PX = 15, 16  # block matching: side of blocks, and divisor of the disparity range
# Planes by RANSAC: number of candidates, maximum error of disparities of inliers, and minimum number of inliers.
_PLANES, _PLANE_PX, _MIN_ON_PLANE = 100, 2.0, 12


def equal_contrast(picture: np.ndarray) -> np.ndarray:
    """Return a picture (h, w) uint8 with equal mean and deviation around each pixel, independent of the exposure."""
    contrast = local_contrast(picture.astype(np.float32), _CONTRAST_PX, _FLOOR)
    return np.asarray(np.clip(128 + _SPREAD * contrast, 0, 255), np.uint8)


def lit_ground(picture: np.ndarray) -> np.ndarray:
    """Return (h, w) uint8, 255 outside dark areas and outside a margin around large ones.

    The rover's own shadow is a large dark area. Its edge moves with the rover; edges of small shadows do not.
    """
    import cv2

    smooth = cv2.blur(picture, (5, 5))
    dark = (smooth <= _DARK_SHARE * np.percentile(smooth[::4, ::4], _BRIGHT_PERCENT)).astype(np.uint8)
    _, numbers, statistics, _ = cv2.connectedComponentsWithStats(dark)
    large = statistics[:, cv2.CC_STAT_AREA] >= _LARGE_SHARE * picture.size
    large[0] = False  # all pixels that are not dark
    edge = np.ones((2 * _EDGE_PX + 1, 2 * _EDGE_PX + 1), np.uint8)
    excluded = cv2.dilate(large[numbers].astype(np.uint8), edge) | dark
    return np.asarray(255 * (1 - excluded), np.uint8)


@dataclass(frozen=True)
class Ground:
    """Corners of a pair: positions (n, 2) in the left picture, inverse depth (n,), 1/m, and the plane of the ground.

    plane : (3,) inverse depth of the plane at a direction with z = 1, per component of the direction, 1/m.
    """

    left: np.ndarray  # (h, w) uint8, picture of equal contrast
    lit: np.ndarray  # (h, w) uint8, see `lit_ground`
    corners: np.ndarray
    inverse_depth: np.ndarray
    plane: np.ndarray


class GroundTracker:
    """Corners and tracks in rectified pictures of equal contrast."""

    def __init__(self, rig: Rectification, nearest_m: float, farthest_m: float) -> None:
        import cv2

        self.rig, self.matrix = rig, rig.lens.opencv_matrix()
        self._inverse = np.linalg.inv(self.matrix)
        self._range = float(rig.disparity(farthest_m)), float(rig.disparity(nearest_m))
        count = _DISPARITY_STEP_PX * int(np.ceil(self._range[1] / _DISPARITY_STEP_PX))
        self._matcher = cv2.StereoBM.create(count, _BLOCK_PX)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Return directions (n, 3) with z = 1 of positions (n, 2)."""
        return np.column_stack([pixels, np.ones(len(pixels))]) @ self._inverse.T

    def find(self, left: np.ndarray, right: np.ndarray, lit: np.ndarray) -> Ground | None:
        """Return the corners of a pair of equal contrast on lit ground; None if the ground was not found."""
        import cv2

        found = cv2.goodFeaturesToTrack(left, _CORNERS, _QUALITY, _APART_PX, mask=lit, blockSize=_CORNER_PX)
        if found is None or len(found) < _MIN_ON_PLANE:
            return None
        corners = found[:, 0].astype(float)
        margin = self._matcher.getNumDisparities()
        padded = [cv2.copyMakeBorder(side, 0, 0, margin, 0, cv2.BORDER_REPLICATE) for side in (left, right)]
        rough = self._matcher.compute(*padded)[:, margin:] / 16
        column, row = np.rint(corners).astype(int).T
        coarse = rough[row, column]
        known = (coarse >= self._range[0]) & (coarse <= self._range[1])
        plane = self._fit_plane(corners[known], coarse[known])
        if plane is None:
            return None
        expected = self._disparity(self.directions(corners) @ plane)
        disparity, good = self.disparities(left, right, corners, np.where(known, coarse, expected), plane)
        if good.sum() < _MIN_ON_PLANE:
            return None
        return Ground(left, lit, corners[good], disparity[good] / self._disparity(1.0), plane)

    def disparities(
        self, left: np.ndarray, right: np.ndarray, corners: np.ndarray, expected: np.ndarray, plane: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return disparities (n,), px, of corners (n, 2) near expected values, and whether they are valid."""
        aside = Pose(np.eye(3), np.array([-self.rig.baseline, 0.0, 0.0]))
        position, good = self.track(
            left, right, corners, corners - np.column_stack([expected, 0 * expected]), aside, plane
        )
        disparity = corners[:, 0] - position[:, 0]
        good &= np.abs(corners[:, 1] - position[:, 1]) < _ROW_PX
        return disparity, good & (disparity >= self._range[0]) & (disparity <= self._range[1])

    def track(
        self,
        old: np.ndarray,
        new: np.ndarray,
        corners: np.ndarray,
        expected: np.ndarray,
        new_from_old: Pose,
        plane: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 2) of corners (n, 2) in a new picture near expected ones, and whether they are valid.

        `new_from_old` and `plane`, in the frame of the old camera, warp the old picture.
        """
        import cv2

        warp = self.matrix @ (new_from_old.rotation + np.outer(new_from_old.translation, plane)) @ self._inverse
        warped = cv2.warpPerspective(old, warp, old.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
        start = cv2.perspectiveTransform(corners[:, None], warp)[:, 0].astype(np.float32)
        settings: dict[str, Any] = {
            "winSize": (_WINDOW_PX, _WINDOW_PX),
            "maxLevel": _LEVELS,
            "criteria": (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 0.01),
            "flags": cv2.OPTFLOW_USE_INITIAL_FLOW,
        }
        position, there, _ = cv2.calcOpticalFlowPyrLK(
            warped, new, start[:, None], expected.astype(np.float32)[:, None].copy(), **settings
        )
        back, here, _ = cv2.calcOpticalFlowPyrLK(new, warped, position, start[:, None].copy(), **settings)
        position = position[:, 0]
        good = self.inside(start) & self.inside(position) & (there.ravel() > 0) & (here.ravel() > 0)
        good &= np.linalg.norm(back[:, 0] - start, axis=1) < _MAX_RETURN_PX
        good[good] = _correlation(_patches(warped, start[good]), _patches(new, position[good])) >= _MIN_CORRELATION
        return position.astype(float), good

    def follow(self, ground: Ground, new: np.ndarray, lit: np.ndarray, guess: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 2) of corners on lit ground in a new picture, and whether they are valid.

        `guess` is `new_from_old`.
        """
        expected, _ = self.project(ground, guess)
        position, good = self.track(ground.left, new, ground.corners, expected, guess, ground.plane)
        column, row = np.rint(position[good]).astype(int).T
        good[good] = lit[row.clip(0, lit.shape[0] - 1), column.clip(0, lit.shape[1] - 1)] > 0
        return position, good

    def project(self, ground: Ground, new_from_old: Pose) -> tuple[np.ndarray, np.ndarray]:
        """Return positions (n, 2) and disparities (n,) of corners after a motion."""
        moved = new_from_old.rotate(self.directions(ground.corners))
        moved = moved + ground.inverse_depth[:, None] * new_from_old.translation
        depth = np.maximum(moved[:, 2], _MIN_Z)
        return (moved / depth[:, None] @ self.matrix.T)[:, :2], self._disparity(ground.inverse_depth / depth)

    def inside(self, position: np.ndarray) -> np.ndarray:
        """Return (n,) bool: positions (n, 2) inside the picture."""
        lens = self.rig.lens
        return np.asarray((position >= 0).all(axis=1) & (position[:, 0] < lens.width) & (position[:, 1] < lens.height))

    def match(self, ground: Ground, new: np.ndarray, lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Match features (Rublee et al., ICCV 2011) to a picture after an unknown motion.

        Return rough points (n, 3) on the plane in the frame of the old camera, m, and positions (n, 2).
        """
        import cv2

        orb, matcher = cv2.ORB.create(**_ORB), cv2.BFMatcher.create(cv2.NORM_HAMMING, True)
        old_points, old_descriptors = orb.detectAndCompute(ground.left, ground.lit)
        points, descriptors = orb.detectAndCompute(new, lit)
        if old_descriptors is None or descriptors is None:
            return np.zeros((0, 3)), np.zeros((0, 2))
        matched = matcher.match(old_descriptors, descriptors)
        rays = self.directions(np.array([old_points[pair.queryIdx].pt for pair in matched]).reshape(-1, 2))
        position = np.array([points[pair.trainIdx].pt for pair in matched]).reshape(-1, 2)
        inverse_depth = rays @ ground.plane
        near = inverse_depth > _MIN_INVERSE_DEPTH
        return rays[near] / inverse_depth[near, None], position[near]

    def _disparity(self, inverse_depth: np.ndarray | float) -> np.ndarray:
        return np.asarray(self.rig.lens.fx * self.rig.baseline * np.asarray(inverse_depth))

    def _fit_plane(self, corners: np.ndarray, disparity: np.ndarray) -> np.ndarray | None:
        """Fit the inverse depth of a plane to disparities by RANSAC; None without a plane."""
        if len(corners) < _MIN_ON_PLANE:
            return None
        rays, values = self.directions(corners), disparity
        rng = np.random.default_rng(0)
        triples = rng.integers(0, len(rays), (_PLANES, 3))
        with np.errstate(all="ignore"):
            determinants = np.linalg.det(rays[triples])
            triples = triples[np.abs(determinants) > 1e-4]
            if not len(triples):
                return None
            planes = np.linalg.solve(rays[triples], values[triples][..., None])[..., 0]
        near = np.abs(planes @ rays.T - values) < _PLANE_PX
        inside = near[np.argmax(near.sum(axis=1))]
        if inside.sum() < _MIN_ON_PLANE:
            return None
        fit = np.linalg.lstsq(rays[inside], values[inside], rcond=None)[0]
        return np.asarray(fit / self._disparity(1.0))


def moved_plane(plane: np.ndarray, new_from_old: Pose) -> np.ndarray:
    """Return a plane (see `Ground`) in the frame of another camera."""
    rotated = new_from_old.rotation @ plane
    return np.asarray(rotated / (1 + rotated @ new_from_old.translation))


def _patches(picture: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return (n, pixels) grey values around positions (n, 2)."""
    import cv2

    if not len(centres):  # OpenCV refuses empty maps
        return np.zeros((0, _PATCH_PX**2), np.float32)
    column, row = np.meshgrid(*2 * (np.arange(_PATCH_PX, dtype=np.float32) - _PATCH_PX // 2,))
    x, y = (
        (centre[:, None, None] + offset).reshape(-1, _PATCH_PX)
        for centre, offset in zip(centres.T, (column, row), strict=True)
    )
    return np.asarray(cv2.remap(picture, x, y, cv2.INTER_LINEAR).reshape(len(centres), -1), np.float32)


def _correlation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return (n,) coefficients of correlation of rows (n, pixels)."""
    first, second = (rows - rows.mean(axis=1, keepdims=True) for rows in (first, second))
    power = np.sum(first**2, axis=1) * np.sum(second**2, axis=1)
    return np.asarray(np.sum(first * second, axis=1) / np.sqrt(power + 1e-6))
