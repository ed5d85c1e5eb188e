"""KITTI's object and stereo benchmark: label and calibration files as its devkit reads them.

KITTI counts pixels from the first one's centre, polarsim from its corner: half a pixel less leaves here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.geometry.lens import HALF_PIXEL

DISPARITY_STEPS = 256  # of a pixel, in pictures of disparity; 0 there: not known, or 256 px and more
UNKNOWN_3D = "-1 -1 -1 -1000 -1000 -1000 -10"  # as the devkit writes what is not known
MATRICES = ("P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")  # in the devkit's order


@dataclass(frozen=True)
class KittiObject:
    """A thing in the left picture: its box (4,) in our pixels, and how much of it is hidden."""

    kind: str
    box: np.ndarray
    truncated: float  # share beyond the picture, 0 to 1
    occluded: int  # 0 seen whole, 1 in part, 2 hardly, 3 unknown


def write_objects(path: str | Path, objects: Sequence[KittiObject]) -> None:
    """A line each, 2 decimals as KITTI has them; boxes in three dimensions are not known."""
    lines = []
    for one in objects:
        edges = " ".join(f"{edge - HALF_PIXEL:.2f}" for edge in one.box)
        lines.append(f"{one.kind} {one.truncated:.2f} {one.occluded} -10 {edges} {UNKNOWN_3D}\n")
    Path(path).write_text("".join(lines), encoding="ascii")


def disparity_picture(disparity: np.ndarray) -> np.ndarray:
    """Disparities (h, w) in pixels, NaN where there is none, as the devkit's 16-bit pictures hold them."""
    steps = np.round(disparity * DISPARITY_STEPS)
    return np.where((steps >= 1) & (steps <= np.iinfo(np.uint16).max), steps, 0).astype(np.uint16)


def write_calibration(path: str | Path, matrices: Mapping[str, np.ndarray]) -> None:
    """`P0` to `Tr_imu_to_velo` in the devkit's order, 12 digits."""
    lines = [f"{name}: {' '.join(f'{value:.12e}' for value in matrices[name].ravel())}\n" for name in MATRICES]
    Path(path).write_text("".join(lines), encoding="ascii")
