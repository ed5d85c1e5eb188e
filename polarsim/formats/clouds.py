"""Point clouds of any scanner: PLY, text, LAS and LAZ."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.nasa import CLOUD_SUFFIXES, finite_points, read_rows
from polarsim.formats.readers import reader

LAS_SUFFIXES = (".las", ".laz")
SUFFIXES = (*CLOUD_SUFFIXES, *LAS_SUFFIXES)


@reader("cloud", largest_mb=4000)
def read_any_cloud(path: str | Path) -> np.ndarray:
    """Return the points (n, 3) float64 of a cloud, in the unit of the file.

    Points with NaN or inf are skipped with a warning.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(f"unknown extension {suffix!r}, expected {', '.join(SUFFIXES)}")
    return finite_points(_read_las(path) if suffix in LAS_SUFFIXES else read_rows(path), path, logging.WARNING)


def _read_las(path: str | Path) -> np.ndarray:
    import laspy

    return np.asarray(laspy.read(path).xyz, float)
