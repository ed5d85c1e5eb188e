"""Point clouds of scanners: PLY, text, LAS and LAZ. polarsim writes text."""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import ENCODINGS, writing
from polarsim.formats.nasa import MM
from polarsim.formats.readers import reader

log = logging.getLogger("polarsim")

CLOUD_SUFFIXES = (".xyz", ".txt", ".pts", ".ply")
LAS_SUFFIXES = (".las", ".laz")
SUFFIXES = (*CLOUD_SUFFIXES, *LAS_SUFFIXES)
_MAX_HEADER_LINES = 50  # of a text cloud before the first point
# Numbers per line of the header of a Leica PTX file: columns, rows, position, axes and matrix of the scanner.
_PTX_HEADER = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?|[+-]?\d+|(?i:[+-]?(?:nan|inf))")


@reader("cloud", largest_mb=4000)
def read_any_cloud(path: str | Path) -> np.ndarray:
    """Return the points (n, 3) float64 of a cloud, in the unit of the file.

    Points with NaN or inf are skipped with a warning.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FormatError(f"unknown extension {suffix!r}, expected {', '.join(SUFFIXES)}")
    return _finite_points(_read_las(path) if suffix in LAS_SUFFIXES else _read_rows(path), path, logging.WARNING)


@reader("cloud", largest_mb=4000)
def read_cloud(path: str | Path, unit: Literal["mm", "m"] = "mm") -> np.ndarray:
    """Read the points (n, 3) float64 of a scan, in `unit` in the file, as metres."""
    points = _finite_points(_read_rows(path), path, logging.INFO)
    return points * MM if unit == "mm" else points


def _read_las(path: str | Path) -> np.ndarray:
    import laspy

    return np.asarray(laspy.read(path).xyz, float)


def _read_rows(path: str | Path) -> np.ndarray:
    """Read the rows (n, 3) of a PLY file or of text, with rows that have no finite coordinates.

    Text has `x y z ...` per line after any header; further columns are ignored. Fields are separated by blanks, commas
    or semicolons. Decimal commas are accepted between blanks or semicolons.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in CLOUD_SUFFIXES:
        raise FormatError(f"unknown suffix of a cloud, expected {', '.join(CLOUD_SUFFIXES)}")
    return _read_ply(path) if suffix == ".ply" else _read_ascii_cloud(path)


def _finite_points(points: np.ndarray, path: str | Path, level: int) -> np.ndarray:
    """Return the points (n, 3) with three finite coordinates, and log the numbers of others.

    Scanners write rays without a hit as three NaN, whose number is logged with a `level` of logging; other points with
    NaN or inf are a warning. A cloud without finite points is an error.
    """
    finite, without_hit = np.isfinite(points).all(axis=1), np.isnan(points).all(axis=1)
    if rays := int(without_hit.sum()):
        log.log(level, "%s: %d of %d points skipped, all coordinates are nan (no hit)", path, rays, len(points))
    if invalid := int((~finite & ~without_hit).sum()):
        log.warning("%s: %d of %d points skipped, a coordinate is nan or inf", path, invalid, len(points))
    if not finite.any():
        raise FormatError("no point")
    return points[finite]


@dataclass(frozen=True)
class _Dialect:
    """Separator, decimal mark and encoding of a text cloud."""

    separator: str  # of fields, in the syntax of pandas
    decimal: str
    encoding: str

    def fields(self, line: str) -> list[str]:
        return line.split() if self.separator == r"\s+" else [field.strip() for field in line.split(self.separator)]

    def numbers(self, line: str) -> list[float]:
        """Return the first three numbers of a line, or fewer if the line is shorter. An empty field is NaN."""
        return [float(field.replace(self.decimal, ".") or "nan") for field in self.fields(line)[:3]]


def _read_ascii_cloud(path: str | Path) -> np.ndarray:
    import pandas as pd

    encoding = _encoding(path)
    with Path(path).open(encoding=encoding, errors="replace") as lines:
        start = [line for _, line in zip(range(_MAX_HEADER_LINES), lines, strict=False)]
    _refuse_ptx(start)
    dialects = ((number, _dialect(line, encoding)) for number, line in enumerate(start))
    first, dialect = next(((number, spelling) for number, spelling in dialects if spelling is not None), (0, None))
    if dialect is None:
        raise FormatError(f"no point among the first {_MAX_HEADER_LINES} lines, expected lines of x y z")
    try:
        table = pd.read_csv(
            path,
            sep=dialect.separator,
            decimal=dialect.decimal,
            header=None,
            skiprows=first,
            usecols=[0, 1, 2],
            dtype=float,
            encoding=dialect.encoding,
            encoding_errors="replace",
        )
    except ValueError:
        _require_points(path, first, dialect)
        raise
    points = table.to_numpy(dtype=float)
    partial = np.isnan(points).any(axis=1) & ~np.isnan(points).all(axis=1)  # all NaN: a ray without a hit
    if partial.any():
        _require_points(path, first, dialect)
    return points


def _encoding(path: str | Path) -> str:
    with Path(path).open("rb") as file:
        start = file.read(4)
    return next((encoding for mark, encoding in ENCODINGS if start.startswith(mark)), "utf-8")


def _dialect(line: str, encoding: str) -> _Dialect | None:
    """Return the dialect of a line of x y z, or None for other lines, such as a header."""
    fields = line.split()
    if ";" in line:
        dialect = _Dialect(";", "," if "," in line else ".", encoding)
    elif "," in line and len(fields) >= 3 and all(_DECIMAL_COMMA.fullmatch(field) for field in fields[:3]):
        dialect = _Dialect(r"\s+", ",", encoding)
    else:
        dialect = _Dialect("," if "," in line else r"\s+", ".", encoding)
    try:
        return dialect if len(dialect.numbers(line)) == 3 else None
    except ValueError:
        return None


def _refuse_ptx(start: list[str]) -> None:
    """Raise an error for a Leica PTX file with another suffix, whose matrix rows would be read as points."""
    filled = [line.split() for line in start if line.strip()][: len(_PTX_HEADER)]
    if tuple(map(len, filled)) == _PTX_HEADER and all(row[0].isdigit() for row in filled[:2]):
        raise FormatError("a PTX file with scanner matrices: export the points as x y z in the left camera frame")


def _require_points(path: str | Path, first: int, dialect: _Dialect) -> None:
    """Raise an error for the first line after the header that is not x y z. Slow; for files with an error."""
    with Path(path).open(encoding=dialect.encoding, errors="replace") as lines:
        for number, line in enumerate(lines):
            if number < first or not line.strip():
                continue
            try:
                coordinates = dialect.numbers(line)
            except ValueError as error:
                raise FormatError(f"{error}, expected x y z", line=number + 1) from error
            if len(coordinates) < 3:
                raise FormatError("fewer than 3 numbers, expected x y z", line=number + 1)


def _read_ply(path: str | Path) -> np.ndarray:
    import trimesh

    with Path(path).open("rb") as file:
        loaded: Any = trimesh.load(file, file_type="ply", process=False)
    return np.array(loaded.vertices, dtype=float).reshape(-1, 3)


def write_cloud(path: str | Path, points_m: np.ndarray, intensity: np.ndarray, unit: Literal["mm", "m"] = "mm") -> None:
    """Write points (n, 3), metres, as ASCII `x y z intensity`: tenths of a millimetre and integer intensities."""
    import pyarrow as pa
    from pyarrow import csv

    factor, digits = (MM, 1) if unit == "mm" else (1.0, 4)
    rounded = np.round(np.asarray(points_m, float) / factor, digits) + 0.0  # no "-0"
    columns = {name: rounded[:, n] for n, name in enumerate("xyz")}
    table = pa.table({**columns, "intensity": np.asarray(intensity).astype(np.int64)})
    options = csv.WriteOptions(include_header=False, delimiter=" ", quoting_style="none")
    with writing(path) as temporary:
        csv.write_csv(table, str(temporary), options)
