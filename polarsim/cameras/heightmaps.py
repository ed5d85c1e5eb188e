"""Coarse alignment of two levelled scans by correlation of rotated and translated height maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter

from polarsim.geometry.poses import Pose

RELIEF_WIDTH = 0.15  # metres: standard deviation of the blur that estimates the local level
RELIEF_LIMIT = 0.06  # metres: limits the weight of walls and large rocks
PEAK_CELLS = 4  # minimum distance between two peaks of a correlation, cells
MIN_OVERLAP = 0.25  # minimum overlap of a translation, share of the smaller map


@dataclass(frozen=True)
class ScanHeights:
    """Mean heights of square cells: rows along y, columns along x, from -reach to +reach; NaN in empty cells."""

    height: np.ndarray  # (rows, columns) metres
    step: float

    @property
    def known(self) -> np.ndarray:
        return np.isfinite(self.height)

    def relief(self) -> np.ndarray:
        """Return heights (rows, columns) above their surroundings, clipped; 0 in empty cells."""
        known = self.known.astype(float)
        blur = RELIEF_WIDTH / self.step
        weight = gaussian_filter(known, blur)
        level = gaussian_filter(np.nan_to_num(self.height), blur) / np.maximum(weight, 1e-6)
        return np.asarray(np.clip(np.where(self.known, self.height - level, 0), -RELIEF_LIMIT, RELIEF_LIMIT))


def height_map(points: np.ndarray, reach: float | np.ndarray, step: float) -> ScanHeights:
    """Return mean heights of points (n, 3) in cells of `step` over a rectangle of +-`reach`, () or (2,), metres."""
    columns, rows = (2 * round(float(along) / step) for along in np.broadcast_to(reach, 2))
    cells = np.floor((points[:, :2] + reach) / step).astype(int)
    inside = ((cells >= 0) & (cells < [columns, rows])).all(axis=1)
    cell = cells[inside, 1] * columns + cells[inside, 0]
    count = np.bincount(cell, minlength=rows * columns)
    total = np.bincount(cell, weights=points[inside, 2], minlength=rows * columns)
    with np.errstate(invalid="ignore"):
        return ScanHeights((total / np.where(count > 0, count, np.nan)).reshape(rows, columns), step)


def correlate_rotations(
    fixed: np.ndarray,
    moving: np.ndarray,
    reach: float | np.ndarray,
    step: float,
    yaws: np.ndarray,
    translation: float,
    count: int,
) -> list[Pose]:
    """Return the best `fixed_from_moving` of two levelled clouds (n, 3), by correlation of their relief, best first.

    `yaws` (y,): rotations about +z to try, radians.
    `translation`: maximum translation along x and y, metres: the walls of the box are similar to each other.
    `count`: maximum number of poses; they differ by more than a few steps or a rotation.
    """
    target = _MaskedSpectra.of(height_map(fixed, reach, step))
    peaks: list[tuple[float, float, np.ndarray]] = []
    for yaw in yaws:
        rotated = Pose.from_rotvec(np.array([0, 0, yaw]), np.zeros(3)).apply(moving)
        score = target.correlate(_MaskedSpectra.of(height_map(rotated, reach, step)))
        peaks += [(value, yaw, cells * step) for value, cells in _peaks(score, round(translation / step), count)]
    peaks.sort(key=lambda peak: -peak[0])
    kept: list[tuple[float, np.ndarray]] = []
    yaw_step = float(np.abs(np.diff(yaws)).min()) if len(yaws) > 1 else 0.0
    for _, yaw, offset in peaks:
        near = any(
            abs(yaw - other) < 1.5 * yaw_step and np.abs(offset - taken).max() < (PEAK_CELLS + 1) * step
            for other, taken in kept
        )
        if not near and len(kept) < count:
            kept.append((yaw, offset))
    return [Pose.from_rotvec(np.array([0, 0, yaw]), np.append(offset, 0.0)) for yaw, offset in kept]


@dataclass(frozen=True)
class _MaskedSpectra:
    """Spectra of a map's relief, of its square and of its mask, padded so that translations do not wrap."""

    relief: np.ndarray
    square: np.ndarray
    mask: np.ndarray
    known: float
    side: int

    @classmethod
    def of(cls, heights: ScanHeights) -> _MaskedSpectra:
        relief, known = heights.relief(), heights.known.astype(float)
        side = fft.next_fast_len(2 * max(known.shape), real=True)
        parts = (np.asarray(fft.rfft2(part, s=(side, side))) for part in (relief, relief**2, known))
        return cls(next(parts), next(parts), next(parts), float(known.sum()), side)

    def correlate(self, moving: _MaskedSpectra) -> np.ndarray:
        """Return the normalised correlation (side, side) over common cells for every translation of `moving`.

        Masked correlation after Padfield, IEEE Trans. Image Process. 21 (2012) 2706.
        """

        def product(first: np.ndarray, second: np.ndarray) -> np.ndarray:
            return np.asarray(fft.irfft2(first * np.conj(second), s=(self.side, self.side)))

        both = np.maximum(product(self.mask, moving.mask), 1e-3)
        mean, mean_moving = product(self.relief, moving.mask), product(self.mask, moving.relief)
        cross = product(self.relief, moving.relief) - mean * mean_moving / both
        energy = np.maximum(product(self.square, moving.mask) - mean**2 / both, 0)
        energy_moving = np.maximum(product(self.mask, moving.square) - mean_moving**2 / both, 0)
        score = cross / np.sqrt(np.maximum(energy * energy_moving, 1e-12))
        return np.where(both >= MIN_OVERLAP * min(self.known, moving.known), score, -1)


def _peaks(score: np.ndarray, limit: int, count: int) -> list[tuple[float, np.ndarray]]:
    """Return the highest scores within `limit` cells, not adjacent, with translations (2,) along x and y in cells."""
    limit = min(limit, len(score) // 2 - 1)
    near = np.roll(score, (limit, limit), axis=(0, 1))[: 2 * limit + 1, : 2 * limit + 1].copy()
    peaks = []
    for _ in range(count):
        row, column = np.unravel_index(near.argmax(), near.shape)
        peaks.append((float(near[row, column]), np.array([column - limit, row - limit], float)))
        around = [slice(max(0, index - PEAK_CELLS), index + PEAK_CELLS + 1) for index in (row, column)]
        near[tuple(around)] = -np.inf
    return peaks


def agreement(
    fixed: np.ndarray, moving: np.ndarray, reach: float | np.ndarray, step: float, tolerance: float
) -> tuple[float, int]:
    """Return the share of common cells of two aligned clouds with equal heights, and the number of common cells."""
    first, second = height_map(fixed, reach, step), height_map(moving, reach, step)
    off = np.abs(first.height - second.height)[first.known & second.known]
    return (float((off < tolerance).mean()) if len(off) else 0.0), len(off)


def relief_correlation(
    fixed: np.ndarray, moving: np.ndarray, reach: float | np.ndarray, step: float, min_sd: float
) -> float:
    """Return the correlation of the relief of two aligned clouds (n, 3), (m, 3) over common cells, -1 to 1.

    Return 1 if the standard deviation of both reliefs is below `min_sd` metres, or without common cells.
    """
    first, second = height_map(fixed, reach, step), height_map(moving, reach, step)
    both = first.known & second.known
    one, two = first.relief()[both], second.relief()[both]
    if not len(one) or max(one.std(), two.std()) < min_sd:
        return 1.0
    return float(((one - one.mean()) * (two - two.mean())).mean() / max(one.std() * two.std(), 1e-12))
