"""KITTI's object and stereo benchmark: label and calibration files as its devkit reads them.

KITTI counts pixels from the first one's centre, polarsim from its corner: half a pixel less leaves here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.readers import reader
from polarsim.formats.text_fields import fields_of, numbers
from polarsim.geometry.lens import HALF_PIXEL

FIELDS = 15  # type truncated occluded alpha bbox(4) dimensions(3) location(3) rotation_y
DISPARITY_STEPS = 256  # of a pixel, in pictures of disparity; 0 there: not known, or 256 px and more
UNKNOWN_3D = "-1 -1 -1 -1000 -1000 -1000 -10"  # as the devkit writes what is not known
MATRICES = {"P0": (3, 4), "P1": (3, 4), "P2": (3, 4), "P3": (3, 4), "R0_rect": (3, 3), "Tr_velo_to_cam": (3, 4),
            "Tr_imu_to_velo": (3, 4)}  # fmt: skip


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


@reader("KITTI file", largest_mb=100)
def read_objects(path: str | Path) -> list[KittiObject]:
    """The inverse of `write_objects`.

    Raises
    ------
    FormatError
        A line that is no object: file, line number and reason.
    """
    found = []
    for number, fields in fields_of(path, "KITTI file"):
        if len(fields) != FIELDS:
            raise FormatError(f"{len(fields)} fields, a KITTI object has {FIELDS}", path=path, line=number)
        values = numbers(path, number, fields[1:])
        box = values[3:7] + HALF_PIXEL
        if (box[2:] <= box[:2]).any() or values[1] not in (0, 1, 2, 3):
            raise FormatError("box without area, or occluded none of 0 to 3", path=path, line=number)
        found.append(KittiObject(fields[0], box, float(values[0]), int(values[1])))
    return found


def disparity_picture(disparity: np.ndarray) -> np.ndarray:
    """Disparities (h, w) in pixels, NaN where there is none, as the devkit's 16-bit pictures hold them."""
    steps = np.round(disparity * DISPARITY_STEPS)
    return np.where((steps >= 1) & (steps <= np.iinfo(np.uint16).max), steps, 0).astype(np.uint16)


def disparity_of(picture: np.ndarray) -> np.ndarray:
    """The inverse of `disparity_picture`: pixels, NaN where there is none."""
    return np.where(picture > 0, picture / DISPARITY_STEPS, np.nan)


def write_calibration(path: str | Path, matrices: Mapping[str, np.ndarray]) -> None:
    """`P0` to `Tr_imu_to_velo` in the devkit's order, 12 digits."""
    lines = [f"{name}: {' '.join(f'{value:.12e}' for value in matrices[name].ravel())}\n" for name in MATRICES]
    Path(path).write_text("".join(lines), encoding="ascii")


@reader("KITTI file", largest_mb=1)
def read_calibration(path: str | Path) -> dict[str, np.ndarray]:
    """The matrices by name.

    Raises
    ------
    FormatError
        One is missing or has another shape.
    """
    found = {}
    for number, fields in fields_of(path, "KITTI file"):
        name = fields[0].rstrip(":")
        values = numbers(path, number, fields[1:])
        if name not in MATRICES or values.size != np.prod(MATRICES[name]):
            raise FormatError(f"{name} with {values.size} numbers is no matrix of KITTI's", path=path, line=number)
        found[name] = values.reshape(MATRICES[name])
    if missing := [name for name in MATRICES if name not in found]:
        raise FormatError(f"{missing[0]} is missing", path=path)
    return found
