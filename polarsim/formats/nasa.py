"""NASA's files: stereo calibration, range maps and scan clouds. `site_files` finds them below a root.

The files use millimetres and OpenCV's pixel coordinates. Readers return metres and polarsim's pixel coordinates.
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import ENCODINGS, write_text, writing
from polarsim.formats.readers import reader
from polarsim.formats.stated_calibration import StatedCalibration, StatedLens
from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import StereoRig

log = logging.getLogger("polarsim")

MM = 0.001  # metres
CLOUD_SUFFIXES = (".xyz", ".txt", ".pts", ".ply")

_ENTRY = re.compile(r"([A-Z0-9_]+):(.*)")
_COUNTS = {
    "CAMERA_MATRIX_LEFT": (9,),
    "DISTORTION_COEFFICIENTS_LEFT": (4, 5, 8, 12, 14),
    "CAMERA_MATRIX_RIGHT": (9,),
    "DISTORTION_COEFFICIENTS_RIGHT": (4, 5, 8, 12, 14),
    "ROTATION_MATRIX": (9,),
    "TRANSLATION_VECTOR": (3,),
}
_MAX_BANDS = 8  # of a range map; the first three are read
_MAX_HEADER_LINES = 50  # of a text cloud before the first point
# Numbers per line of the header of a Leica PTX file: columns, rows, position, axes and matrix of the scanner.
_PTX_HEADER = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?|[+-]?\d+|(?i:[+-]?(?:nan|inf))")
_NO_DATA_TAG = 42113  # GDAL_NODATA
_MIN_MEDIAN_M, _MAX_MEDIAN_M = 0.1, 1000.0  # median distance of a range map; other values mean another unit


def is_calibration(text: str) -> bool:
    """Return whether a text has an entry of `stereo.calibration`."""
    matches = (_ENTRY.fullmatch(line.strip()) for line in text.splitlines())
    return any(match is not None and match[1] in _COUNTS for match in matches)


def parse_calibration(text: str) -> StatedCalibration:
    """Parse `stereo.calibration`: lines `KEY: numbers` in any order. Unknown keys and other lines are ignored."""
    entries = _entries(text)
    rotation = entries["ROTATION_MATRIX"].reshape(3, 3)
    left, right = (_stated_lens(entries, side) for side in ("LEFT", "RIGHT"))
    return StatedCalibration(left, right, rotation, entries["TRANSLATION_VECTOR"], "TRANSLATION_VECTOR")


def _entries(text: str) -> dict[str, np.ndarray]:
    entries: dict[str, np.ndarray] = {}
    for line in text.splitlines():
        match = _ENTRY.fullmatch(line.strip())
        if not match or match[1] not in _COUNTS:
            continue
        if match[1] in entries:
            raise FormatError(f"the key {match[1]} is repeated")
        try:
            entries[match[1]] = np.array([float(field) for field in match[2].split()])
        except ValueError as error:
            raise FormatError(f"{match[1]}: {error}") from error
    for name, counts in _COUNTS.items():
        if name not in entries:
            raise FormatError(f"the key {name} is missing")
        if len(entries[name]) not in counts:
            raise FormatError(f"{name} has {len(entries[name])} numbers, expected {' or '.join(map(str, counts))}")
        if not np.isfinite(entries[name]).all():
            raise FormatError(f"{name} has a number that is not finite")
    return entries


def _stated_lens(entries: dict[str, np.ndarray], side: str) -> StatedLens:
    matrix, distortion = f"CAMERA_MATRIX_{side}", f"DISTORTION_COEFFICIENTS_{side}"
    return StatedLens(entries[matrix].reshape(3, 3), entries[distortion], matrix, distortion)


def write_calibration(path: str | Path, rig: StereoRig) -> None:
    """Write `stereo.calibration` with 6 significant digits, as NASA does, and 4 distortion terms if k3 is zero."""
    right_from_left = rig.left_from_right.inverse()
    content = {
        "CAMERA_MATRIX_LEFT": rig.left.opencv_matrix(),
        "DISTORTION_COEFFICIENTS_LEFT": _terms(rig.left),
        "CAMERA_MATRIX_RIGHT": rig.right.opencv_matrix(),
        "DISTORTION_COEFFICIENTS_RIGHT": _terms(rig.right),
        "ROTATION_MATRIX": right_from_left.rotation,
        "TRANSLATION_VECTOR": right_from_left.translation,
    }
    lines = [f"{name}: {' '.join(f'{value:.6g}' for value in np.ravel(values))}\n" for name, values in content.items()]
    write_text(path, "".join(lines))


def _terms(lens: Lens) -> np.ndarray:
    return np.array(lens.distortion if lens.distortion[4] else lens.distortion[:4])


@reader("TIFF")
def read_range_map(path: str | Path, size: tuple[int, int]) -> np.ndarray:
    """Return points (h, w, 3) float32, metres, in the rectified left frame; NaN where the map has no data.

    A pixel has no data if z is not positive or equals the no-data value of the file, if a band is not finite, or if
    the three bands are equal: a point at x = y = z is outside the field of view, and markers such as 99999 have this
    form.

    The expected size (width, height), px, is checked before pixels are read.
    """
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # errors are reported below in a single line
    with tifffile.TiffFile(path) as tiff:
        bands_last = _bands_last(tiff.series[0].shape if tiff.series else (), size)
        page: Any = tiff.pages[0]
        no_data = page.tags.get(_NO_DATA_TAG)
        try:
            bands = np.asarray(tiff.series[0].asarray())
        except (ImportError, ValueError) as error:  # missing codec for a compression or predictor, or other errors
            if isinstance(error, ImportError) or "imagecodecs" in str(error):
                name = getattr(page.compression, "name", page.compression)  # a number that tifffile does not know
                raise FormatError(
                    f"compression {name} with predictor {int(page.predictor)} needs the package "
                    "imagecodecs: install it, or save the map without compression"
                ) from error
            raise
    if bands.dtype.kind not in "fiu":
        raise FormatError(f"values have the type {bands.dtype}, expected numbers")
    points = (bands[..., :3] if bands_last else np.moveaxis(bands[:3], 0, -1)).astype(np.float32)
    x, y, z = np.moveaxis(points, -1, 0)
    with np.errstate(invalid="ignore"):
        empty = ~np.isfinite(points).all(axis=-1) | (z <= 0) | ((x == y) & (y == z))
    if no_data is not None:
        empty |= z == np.float32(str(no_data.value).strip("\0 "))  # only z: the tag is often 0, a valid x or y
    points *= np.float32(MM)
    points[empty] = np.nan
    if empty.all():
        raise FormatError("no valid point")
    median = float(np.median(z[~empty][::64]))  # a sample of the pixels suffices to check the unit
    if not _MIN_MEDIAN_M <= median <= _MAX_MEDIAN_M:
        raise FormatError(f"the median distance is {median / MM:.4g}, expected millimetres: convert the unit")
    return points


def _bands_last(shape: tuple[int, ...], size: tuple[int, int]) -> bool:
    """Return whether the bands are the last axis of an image (or the first); raise an error for any other shape."""
    width, height = size
    if len(shape) == 3 and shape[:2] == (height, width) and 3 <= shape[2] <= _MAX_BANDS:
        return True
    if len(shape) == 3 and shape[1:] == (height, width) and 3 <= shape[0] <= _MAX_BANDS:
        return False
    stated = " x ".join(map(str, shape)) or "no image"
    raise FormatError(f"{stated}, expected {height} rows, {width} columns and 3 bands X Y Z")


def write_range_map(path: str | Path, points_m: np.ndarray) -> None:
    """Write points (h, w, 3), metres, as three float32 bands in millimetres. NaN (no point) is written as 0."""
    import tifffile

    bands = np.nan_to_num(np.asarray(points_m, np.float32) / np.float32(MM), nan=0.0, posinf=0.0, neginf=0.0)
    with writing(path) as temporary:
        tifffile.imwrite(
            temporary, bands, photometric="minisblack", planarconfig="contig", metadata=None, software=False
        )


@reader("cloud", largest_mb=4000)
def read_cloud(path: str | Path, unit: Literal["mm", "m"] = "mm") -> np.ndarray:
    """Read the points (n, 3) float64 of a scan, in `unit` in the file, as metres."""
    points = read_points(path)
    return points * MM if unit == "mm" else points


@reader("cloud", largest_mb=4000)
def read_points(path: str | Path) -> np.ndarray:
    """Read the points (n, 3) float64 of a cloud in the unit of the file.

    A PLY file, or text with `x y z ...` per line after any header; further columns are ignored. Fields are separated by
    blanks, commas or semicolons. Decimal commas are accepted between blanks or semicolons.
    """
    return finite_points(read_rows(path), path, logging.INFO)


def read_rows(path: str | Path) -> np.ndarray:
    """Read the rows (n, 3) of a cloud like `read_points`, with rows that have no finite coordinates."""
    suffix = Path(path).suffix.lower()
    if suffix not in CLOUD_SUFFIXES:
        raise FormatError(f"unknown suffix of a cloud, expected {', '.join(CLOUD_SUFFIXES)}")
    return _read_ply(path) if suffix == ".ply" else _read_ascii_cloud(path)


def finite_points(points: np.ndarray, path: str | Path, level: int) -> np.ndarray:
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


def range_map_path(folder: str | Path, position: str) -> Path:
    """Return the path of the range map of a position in the folder of range maps of a terrain."""
    return Path(folder) / f"Pos{position}_org-XYZ.tif"
