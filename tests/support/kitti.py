"""Readers of KITTI files, equivalent to the devkit."""

from pathlib import Path

import numpy as np

HALF_PIXEL = 0.5  # origin: centre of the first pixel in KITTI, corner in polarsim


def read_objects(path: Path) -> list[tuple[str, np.ndarray, float, int]]:
    """Return type, box (4,) in pixels of polarsim, truncated share and occlusion of every object."""
    rows = [line.split() for line in path.read_text("ascii").splitlines()]
    assert all(len(row) == 15 for row in rows)
    return [(row[0], np.array(row[4:8], float) + HALF_PIXEL, float(row[1]), int(row[2])) for row in rows]


def read_calibration(path: Path) -> dict[str, np.ndarray]:
    """Return matrices with three rows by name."""
    rows = (line.split(": ") for line in path.read_text("ascii").splitlines())
    return {name: np.array(values.split(), float).reshape(3, -1) for name, values in rows}


def disparity_of(picture: np.ndarray) -> np.ndarray:
    """Return the disparities of a 16-bit image in pixels, NaN for missing values."""
    return np.where(picture > 0, picture / 256, np.nan)
