"""Elevation models as GeoTIFF files, read through rasterio: heights around a place, in metres.

The file must say where it lies: a projected frame in metres, north up. Only the part that is asked for is read.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats.readers import reader

METRES = ("", "m", "metre", "metres", "meter", "meters")  # names of the heights' unit; most files give none
FARTHEST_M = 20_000.0  # no height of the Moon is as far from its mean radius: what is, is a hole without a mark
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
        No GeoTIFF; no projected frame, or not in metres; turned; too small; holes.
    """
    try:
        import rasterio
        from rasterio.errors import NotGeoreferencedWarning
    except ImportError as error:
        raise PolarsimError("elevation models are read with rasterio: pip install 'polarsim[rover]'") from error
    with warnings.catch_warnings(), rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"):
        warnings.simplefilter("ignore", NotGeoreferencedWarning)  # it is refused in one line
        with rasterio.open(path, driver="GTiff") as file:
            _require_metres(file)
            return _around(file, half_m, far_m, centre_m)


def _require_metres(file: Any) -> None:
    if file.crs is None:
        raise FormatError("no coordinate reference system, a projected one in metres was expected")
    if not file.crs.is_projected:
        raise FormatError("its frame is geographic, in degrees; a projected one in metres was expected")
    unit, factor = file.crs.linear_units_factor
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
    holes = ~(np.abs(height) < FARTHEST_M)
    if holes.any():
        row, column = (int(first) for first in np.argwhere(holes)[0])
        place = west + (left + column + 0.5) * step_x, north - (top + row + 0.5) * step_y
        raise FormatError(
            f"{int(holes.sum())} of {holes.size} pixels within {far_m:g} m have no height, the first at "
            f"({place[0]:.2f}, {place[1]:.2f}) m"
        )
    return Elevation(
        west - x + (np.arange(left, right) + 0.5) * step_x,
        (north - y - (np.arange(top, bottom) + 0.5) * step_y)[::-1],
        height[::-1],
    )
