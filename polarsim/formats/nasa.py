"""NASA's files: stereo calibration and range maps. `clouds` reads the scans, `site_files` finds all files below a root.

The files use millimetres and OpenCV's pixel coordinates. Readers return metres and polarsim's pixel coordinates.
"""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import write_text, writing
from polarsim.formats.readers import reader
from polarsim.formats.stated_calibration import StatedCalibration, StatedLens
from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import StereoRig

MM = 0.001  # metres

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


def range_map_path(folder: str | Path, position: str) -> Path:
    """Return the path of the range map of a position in the folder of range maps of a terrain."""
    return Path(folder) / f"Pos{position}_org-XYZ.tif"
