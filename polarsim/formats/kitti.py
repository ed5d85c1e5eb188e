"""Label and calibration files of the KITTI object and stereo benchmarks, in the format of the KITTI devkit.

The origin of KITTI's pixel coordinates is the centre of the first pixel, that of polarsim its corner. Half a pixel is
subtracted on writing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL

DISPARITY_STEPS = 256  # grey levels per pixel of disparity; level 0: unknown, or 256 px and more
UNKNOWN_3D = "-1 -1 -1 -1000 -1000 -1000 -10"  # the devkit's values for an unknown box in three dimensions
MATRICES = ("P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")  # in the order of the devkit


@dataclass(frozen=True)
class KittiObject:
    """Object in the left image: bounding box (4,) in polarsim's pixels, truncation and occlusion."""

    kind: str
    box: np.ndarray
    truncated: float  # share outside the image, 0 to 1
    occluded: int  # 0 fully visible, 1 partly occluded, 2 largely occluded, 3 unknown


def write_objects(path: str | Path, objects: Sequence[KittiObject]) -> None:
    """Write an object per line with 2 decimals, as KITTI does. Boxes in three dimensions are unknown."""
    lines = []
    for item in objects:
        edges = " ".join(f"{edge - HALF_PIXEL:.2f}" for edge in item.box)
        lines.append(f"{item.kind} {item.truncated:.2f} {item.occluded} -10 {edges} {UNKNOWN_3D}\n")
    Path(path).write_text("".join(lines), encoding="ascii")


def disparity_picture(disparity: np.ndarray) -> np.ndarray:
    """Encode disparities (h, w) in pixels, NaN where unknown, as a 16-bit image of the devkit."""
    steps = np.round(disparity * DISPARITY_STEPS)
    return np.where((steps >= 1) & (steps <= np.iinfo(np.uint16).max), steps, 0).astype(np.uint16)


def write_calibration(path: str | Path, matrices: Mapping[str, np.ndarray]) -> None:
    """Write the matrices `P0` to `Tr_imu_to_velo` in the order of the devkit, with 12 digits."""
    lines = [f"{name}: {' '.join(f'{value:.12e}' for value in matrices[name].ravel())}\n" for name in MATRICES]
    Path(path).write_text("".join(lines), encoding="ascii")
