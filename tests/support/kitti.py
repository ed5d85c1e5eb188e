"""KITTI files as the devkit reads them."""

from pathlib import Path

import numpy as np

HALF_PIXEL = 0.5  # KITTI counts pixels from the first one's centre, polarsim from its corner


def read_objects(path: Path) -> list[tuple[str, np.ndarray, float, int]]:
    """Type, box (4,) in polarsim's pixels, truncated share and occlusion of every object."""
    rows = [line.split() for line in path.read_text("ascii").splitlines()]
    assert all(len(row) == 15 for row in rows)
    return [(row[0], np.array(row[4:8], float) + HALF_PIXEL, float(row[1]), int(row[2])) for row in rows]


def read_calibration(path: Path) -> dict[str, np.ndarray]:
    """Matrices with three rows by name."""
    rows = (line.split(": ") for line in path.read_text("ascii").splitlines())
    return {name: np.array(values.split(), float).reshape(3, -1) for name, values in rows}


def disparity_of(picture: np.ndarray) -> np.ndarray:
    """Disparities in pixels of a 16-bit picture, NaN where there is none."""
    return np.where(picture > 0, picture / 256, np.nan)
