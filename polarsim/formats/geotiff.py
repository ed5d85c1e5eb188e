"""Elevation models as GeoTIFF files, read with rasterio: heights around a point, in metres.

The file, or a side file `.aux.xml` or `.tfw`, must have a projected or local frame in metres, north up. Only the
requested part is read. Missing heights are errors, with or without a no-data tag.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.readers import reader

METRES = ("", "m", "metre", "metres", "meter", "meters")  # accepted units of heights; most files state no unit
LOWEST_M, HIGHEST_M = -9_300.0, 11_000.0  # heights of the Moon are -9.1 to 10.8 km (LOLA); other values are holes
_RADIUS_M = (1_700_000.0, 1_760_000.0)  # range of distances from the Moon's centre, which some files have as heights
_MAX_SLOPE, _MAX_CLIFF_M = 10.0, 100.0  # a step steeper than 84 degrees and higher than a cliff is the edge of a hole
MAX_WINDOW_PIXELS = 100_000_000
_MARGIN_PX = 3  # pixels around the requested part that a spline needs
_MIN_SIDE_PX = 4  # minimum number of pixels along a side, for a cubic spline


@dataclass(frozen=True)
class Elevation:
    """Heights (rows, columns) at pixel centres x (columns,) east and y (rows,) north of a point, metres; ascending."""

    x: np.ndarray
    y: np.ndarray
    height: np.ndarray

    @property
    def pixel_m(self) -> float:
        return float(max(self.x[1] - self.x[0], self.y[1] - self.y[0]))


@reader("GeoTIFF", largest_mb=50_000)
def read_elevation(
    path: str | Path, half_m: float, far_m: float, centre_m: tuple[float, float] | None = None
) -> Elevation:
    """Read the first band of a file around a point in the frame of the file, east and north (default: the centre).

    The file must cover the distance `half_m` from the point to all four sides; heights are read up to the distance
    `far_m` from the point, if the file has them.
    """
    import rasterio
    from rasterio.errors import NotGeoreferencedWarning

    with warnings.catch_warnings(), rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="TRUE"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # `_require_metres` raises a one-line error
        # TRUE: GDAL reads the side files .aux.xml, .tfw and .msk without listing the folder.
        with rasterio.open(path, driver="GTiff") as file:
            _require_metres(file)
            return _around(file, half_m, far_m, centre_m)


def _require_metres(file: Any) -> None:
    if file.crs is None:
        raise FormatError(
            "no coordinate reference system in the file or its .aux.xml, expected one in metres: gdal_edit.py -a_srs"
        )
    if file.crs.is_geographic:
        raise FormatError("the coordinate system is geographic, in degrees; expected a projected system in metres")
    unit, factor = file.crs.units_factor  # of projected and local frames
    if factor != 1.0:
        raise FormatError(f"the coordinate system has the unit {unit} ({factor:g} m), expected metres")
    heights = (file.units[0] or "").strip().lower()
    if heights not in METRES:
        raise FormatError(f"heights are in {heights!r}, expected metres")
    shape = file.transform
    if shape.b or shape.d or not (shape.a > 0 and shape.e < 0):
        raise FormatError(f"the pixel transform is {tuple(shape)[:6]}, expected north up: rotate the image")


def _around(file: Any, half_m: float, far_m: float, centre_m: tuple[float, float] | None) -> Elevation:
    from rasterio.windows import Window

    step_x, step_y = file.transform.a, -file.transform.e
    west, north = file.transform.c, file.transform.f
    east, south = west + step_x * file.width, north - step_y * file.height
    x, y = centre_m or ((west + east) / 2, (south + north) / 2)
    # Heights can be interpolated only between pixel centres.
    room = min(x - west - step_x / 2, east - step_x / 2 - x, y - south - step_y / 2, north - step_y / 2 - y)
    if not room >= half_m:
        raise FormatError(
            f"{file.width} x {file.height} pixels of {step_x:g} x {step_y:g} m reach {room:g} m to the nearest side of "
            f"({x:.2f}, {y:.2f}) m, expected at least {half_m:g} m"
        )
    left, right = (round((x + side * far_m - west) / step_x) + side * _MARGIN_PX for side in (-1, 1))
    top, bottom = (round((north - y + side * far_m) / step_y) + side * _MARGIN_PX for side in (-1, 1))
    left, right, top, bottom = max(left, 0), min(right, file.width), max(top, 0), min(bottom, file.height)
    if min(right - left, bottom - top) < _MIN_SIDE_PX:
        raise FormatError(
            f"pixels of {step_x:g} x {step_y:g} m: the requested part has fewer than {_MIN_SIDE_PX} along a side"
        )
    if (right - left) * (bottom - top) > MAX_WINDOW_PIXELS:
        raise FormatError(f"{right - left} x {bottom - top} pixels requested, at most {MAX_WINDOW_PIXELS} are read")
    band = file.read(1, window=Window(left, top, right - left, bottom - top), masked=True)
    height = np.ma.filled(band.astype(float), np.nan) * file.scales[0] + file.offsets[0]

    def at(row: int, column: int) -> str:
        place = west + (left + column + 0.5) * step_x, north - (top + row + 0.5) * step_y
        return f"({place[0]:.2f}, {place[1]:.2f}) m, value {band.data[row, column]:g}"

    _require_heights(height, f"pixels within {far_m:g} m", at)
    _require_steps(height, (step_x, step_y), at)
    return Elevation(
        west - x + (np.arange(left, right) + 0.5) * step_x,
        (north - y - (np.arange(top, bottom) + 0.5) * step_y)[::-1],
        height[::-1],
    )


def _require_heights(height: np.ndarray, pixels: str, at: Callable[[int, int], str]) -> None:
    """Raise an error if heights (rows, columns), metres, are NaN or outside the range of heights on the Moon."""
    holes = ~((height >= LOWEST_M) & (height <= HIGHEST_M))
    if not holes.any():
        return
    known = height[np.isfinite(height)]
    if len(known) and _RADIUS_M[0] < np.median(known) < _RADIUS_M[1]:
        raise FormatError(
            f"the median value {np.median(known):.0f} is a radius: subtract the mean radius of the Moon, 1737400 m"
        )
    if len(known) and holes.all():
        raise FormatError(
            f"values from {known.min():g} to {known.max():g}, expected heights from {LOWEST_M:g} to {HIGHEST_M:g} m: "
            "check unit, scale and offset"
        )
    row, column = (int(first) for first in np.argwhere(holes)[0])
    raise FormatError(
        f"{int(holes.sum())} of {holes.size} {pixels} have no height, the first at {at(row, column)}: fill the holes"
    )


def _require_steps(height: np.ndarray, step_m: tuple[float, float], at: Callable[[int, int], str]) -> None:
    """Raise an error for a step that ground cannot have: the edge of a hole filled with a plausible height."""
    for axis, pixel_m in ((1, step_m[0]), (0, step_m[1])):
        steps = np.abs(np.diff(height, axis=axis))
        if (steps > _MAX_SLOPE * pixel_m + _MAX_CLIFF_M).any():
            row, column = (int(first) for first in np.argwhere(steps > _MAX_SLOPE * pixel_m + _MAX_CLIFF_M)[0])
            raise FormatError(
                f"a step of {steps[row, column]:.0f} m between pixels of {pixel_m:g} m at {at(row, column)}: "
                "a hole without a no-data tag? Set the tag with gdal_edit.py -a_nodata and fill the hole"
            )
