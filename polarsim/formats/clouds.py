"""Point clouds of any scanner: PLY, text, LAS and LAZ."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.nasa import CLOUD_SUFFIXES, read_points
from polarsim.formats.readers import reader

LAS_SUFFIXES = (".las", ".laz")
SUFFIXES = (*CLOUD_SUFFIXES, *LAS_SUFFIXES)


@reader("cloud", largest_mb=4000)
def read_any_cloud(path: str | Path) -> np.ndarray:
    """Return the points (n, 3) float64 of a cloud, in the unit of the file."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(f"unknown extension {suffix!r}, expected {', '.join(SUFFIXES)}")
    if suffix not in LAS_SUFFIXES:
        return read_points(path)
    import laspy

    points = np.asarray(laspy.read(path).xyz, float)
    if not len(points):
        raise FormatError("no point")
    return points
