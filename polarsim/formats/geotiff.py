"""Elevation models as GeoTIFF files, read through rasterio: heights around a place, in metres.

The file, or a side file `.aux.xml` or `.tfw`, must have a projected or local frame in metres, north up. Only the part
that is asked for is read. Holes are errors, whether a tag marks them or not.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats.readers import reader

METRES = ("", "m", "metre", "metres", "meter", "meters")  # names of the heights' unit; most files give none
LOWEST_M, HIGHEST_M = -9_300.0, 11_000.0  # the Moon's heights are -9.1 to 10.8 km (LOLA): beyond, a hole without a tag
_RADIUS_M = (1_700_000.0, 1_760_000.0)  # distances from the Moon's centre, in place of heights
_STEEPEST, _CLIFF_M = 10.0, 100.0  # a step between neighbours above 84 degrees and a cliff's height is a hole's edge
MOST_PIXELS = 100_000_000
_MORE = 3  # pixels beyond what is asked for, which a spline reaches into
_LEAST = 4  # pixels along a side, for a cubic spline


@dataclass(frozen=True)
class Elevation:
    """Heights (rows, columns) of pixels with centres at x (columns,), east of a place, and y (rows,), north of it; m.

    x and y ascend.
    """

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
    """The first band of a file around a place.

    Parameters
    ----------
    half_m : float
        The file must have heights so far to all four sides of the place.
    far_m : float
        Heights are read so far to each side, where there are some.
    centre_m : (float, float), optional
        The place in the file's own frame, east and north; by default the middle of the file.

    Raises
    ------
    FormatError
        No GeoTIFF; no projected or local frame in metres; turned; too small; holes, with or without a no-data tag;
        radii or other values that are no heights of the Moon.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning
    except ImportError as error:
        raise PolarsimError("elevation models are read with rasterio: pip install 'polarsim[rover]'") from error
    with warnings.catch_warnings(), rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="TRUE"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # it is refused in one line
        # With TRUE, GDAL lists no folder, and reads the side files .aux.xml, .tfw and .msk.
        with rasterio.open(path, driver="GTiff") as file:
            _require_metres(file)
            return _around(file, half_m, far_m, centre_m)


def _require_metres(file: Any) -> None:
    if file.crs is None:
        raise FormatError(
            "no coordinate reference system in the file or its .aux.xml, expected one in metres: gdal_edit.py -a_srs"
        )
    if file.crs.is_geographic:
        raise FormatError("its frame is geographic, in degrees; a projected one in metres was expected")
    unit, factor = file.crs.units_factor  # of projected and local frames
    if factor != 1.0:
        raise FormatError(f"its frame is in {unit} of {factor:g} m, metres were expected")
    heights = (file.units[0] or "").strip().lower()
    if heights not in METRES:
        raise FormatError(f"its heights are in {heights!r}, metres were expected")
    shape = file.transform
    if shape.b or shape.d or not (shape.a > 0 and shape.e < 0):
        raise FormatError(f"pixels with the transform {tuple(shape)[:6]}, north was expected to be up")


def _around(file: Any, half_m: float, far_m: float, centre_m: tuple[float, float] | None) -> Elevation:
    from rasterio.windows import Window

    step_x, step_y = file.transform.a, -file.transform.e
    west, north = file.transform.c, file.transform.f
    east, south = west + step_x * file.width, north - step_y * file.height
    x, y = centre_m or ((west + east) / 2, (south + north) / 2)
    # Heights are known between centres of pixels.
    room = min(x - west - step_x / 2, east - step_x / 2 - x, y - south - step_y / 2, north - step_y / 2 - y)
    if not room >= half_m:
        raise FormatError(
            f"{file.width} x {file.height} pixels of {step_x:g} x {step_y:g} m reach {room:g} m to the nearest side of "
            f"({x:.2f}, {y:.2f}) m, {half_m:g} m were asked for"
        )
    left, right = (round((x + side * far_m - west) / step_x) + side * _MORE for side in (-1, 1))
    top, bottom = (round((north - y + side * far_m) / step_y) + side * _MORE for side in (-1, 1))
    left, right, top, bottom = max(left, 0), min(right, file.width), max(top, 0), min(bottom, file.height)
    if min(right - left, bottom - top) < _LEAST:
        raise FormatError(f"pixels of {step_x:g} x {step_y:g} m: fewer than {_LEAST} along a side of what is asked for")
    if (right - left) * (bottom - top) > MOST_PIXELS:
        raise FormatError(f"{right - left} x {bottom - top} pixels, at most {MOST_PIXELS} are read")
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
    """Refuse heights (rows, columns), metres, with holes: NaN, or outside of what the Moon has."""
    holes = ~((height >= LOWEST_M) & (height <= HIGHEST_M))
    if not holes.any():
        return
    known = height[np.isfinite(height)]
    if len(known) and _RADIUS_M[0] < np.median(known) < _RADIUS_M[1]:
        raise FormatError(
            f"values around {np.median(known):.0f}, which are radii: subtract the Moon's mean radius, 1737400 m"
        )
    if len(known) and holes.all():
        raise FormatError(
            f"values from {known.min():g} to {known.max():g}, heights of the Moon are {LOWEST_M:g} to {HIGHEST_M:g} m: "
            "check unit, scale and offset"
        )
    row, column = (int(first) for first in np.argwhere(holes)[0])
    raise FormatError(
        f"{int(holes.sum())} of {holes.size} {pixels} have no height, the first at {at(row, column)}; fill the holes"
    )


def _require_steps(height: np.ndarray, step_m: tuple[float, float], at: Callable[[int, int], str]) -> None:
    """Refuse heights with a step that no ground has: the edge of a hole whose value is within the Moon's heights."""
    for axis, pixel_m in ((1, step_m[0]), (0, step_m[1])):
        steps = np.abs(np.diff(height, axis=axis))
        if (steps > _STEEPEST * pixel_m + _CLIFF_M).any():
            row, column = (int(first) for first in np.argwhere(steps > _STEEPEST * pixel_m + _CLIFF_M)[0])
            raise FormatError(
                f"a step of {steps[row, column]:.0f} m between pixels of {pixel_m:g} m at {at(row, column)}: "
                "a hole without a no-data tag, set it with gdal_edit.py -a_nodata and fill the hole"
            )
