"""NASA's files: stereo calibration, range maps, scan clouds, and where photos and scans lie below a root.

Files count in millimetres and OpenCV's pixels; what is read here counts in metres and in ours.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import ENCODINGS, text_of, write_text, writing
from polarsim.formats.readers import reader
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, checked_rotation
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import HEIGHT, SUNS, WIDTH, PhotoKey, is_exposure
from polarsim.survey import POSITION_DISTANCE_MM

log = logging.getLogger("polarsim")

CALIBRATION_NAME = "stereo.calibration"
RANGE_FOLDER = "GroundTruth_RectifiedRangeMaps"
CLOUD_SUFFIXES = (".xyz", ".txt", ".pts", ".ply")
MM = 0.001  # metres

_SHORTEST_BASELINE, _LONGEST_BASELINE = 0.25, 0.35  # metres; NASA's is 0.3016
_MAX_TILT = 0.5  # of the baseline against the left camera's x axis, sine
_MAX_OFF_CENTRE = 0.15  # of a principal point from the middle of the image, as a share of its width and height
_ENTRY = re.compile(r"([A-Z0-9_]+):(.*)")
_COUNTS = {
    "CAMERA_MATRIX_LEFT": (9,),
    "DISTORTION_COEFFICIENTS_LEFT": (4, 5, 8, 12, 14),
    "CAMERA_MATRIX_RIGHT": (9,),
    "DISTORTION_COEFFICIENTS_RIGHT": (4, 5, 8, 12, 14),
    "ROTATION_MATRIX": (9,),
    "TRANSLATION_VECTOR": (3,),
}
_PHOTO = re.compile(r"Pos([A-G])_\d+_L(on|off)/(NoSun|Sun_(\d+))/Cam([LR])_(.+)_(\d{4})\.(?i:png)")
_MOST_BANDS = 8  # of a range map; three are read
_CLOUD_START = 50  # lines at the start of a text cloud that must hold its first point
_PTX_HEADER = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)  # numbers per line: columns, rows, place and axes of the scanner, matrix
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+(?:[eE][+-]?\d+)?|[+-]?\d+|(?i:[+-]?(?:nan|inf))")
_NO_DATA_TAG = 42113  # of GDAL
_NEAREST, _FARTHEST = 0.1, 1000.0  # metres, of the median pixel of a range map: beyond, the unit is another one


@reader("calibration", largest_mb=1)
def read_calibration(path: str | Path) -> StereoRig:
    """Read `stereo.calibration`: `KEY: numbers` a line in any order; unknown keys and other lines are passed over.

    Raises
    ------
    FormatError
        No text; a key that is missing, given twice or with another count of numbers; no camera matrix or rotation;
        distortion beyond k3; a principal point far from the middle of a photo; cameras that are not about 0.30 m
        apart, or with the right camera on the left.
    """
    entries = _entries(text_of(path))
    rotation = checked_rotation(entries["ROTATION_MATRIX"].reshape(3, 3))
    translation = entries["TRANSLATION_VECTOR"]
    if not _SHORTEST_BASELINE <= np.linalg.norm(translation) <= _LONGEST_BASELINE:
        raise FormatError(f"TRANSLATION_VECTOR is {np.linalg.norm(translation):.4g} m long, expected about 0.30")
    left_from_right = Pose(rotation, translation).inverse()  # OpenCV: x_right = R x_left + T
    x, y, z = left_from_right.translation
    if x < 0 or np.hypot(y, z) > _MAX_TILT * np.linalg.norm(translation):
        raise FormatError(
            f"TRANSLATION_VECTOR puts the right camera at x {x:.3g}, y {y:.3g}, z {z:.3g} m in the left one's frame, "
            "expected x 0.30, y 0, z 0: left and right exchanged? (x_right = R x_left + T, x of T < 0)"
        )
    return StereoRig(_lens(entries, "LEFT"), _lens(entries, "RIGHT"), left_from_right)


def _entries(text: str) -> dict[str, np.ndarray]:
    entries: dict[str, np.ndarray] = {}
    for line in text.splitlines():
        found = _ENTRY.fullmatch(line.strip())
        if not found or found[1] not in _COUNTS:
            continue
        if found[1] in entries:
            raise FormatError(f"{found[1]} is given twice")
        try:
            entries[found[1]] = np.array([float(field) for field in found[2].split()])
        except ValueError as error:
            raise FormatError(f"{found[1]}: {error}") from error
    for name, counts in _COUNTS.items():
        if name not in entries:
            raise FormatError(f"the key {name} is missing")
        if len(entries[name]) not in counts:
            raise FormatError(f"{name} has {len(entries[name])} numbers, expected {' or '.join(map(str, counts))}")
        if not np.isfinite(entries[name]).all():
            raise FormatError(f"{name} has a number that is not finite")
    return entries


def _lens(entries: dict[str, np.ndarray], side: str) -> Lens:
    matrix = entries[f"CAMERA_MATRIX_{side}"].reshape(3, 3)
    distortion = entries[f"DISTORTION_COEFFICIENTS_{side}"]
    if np.any(distortion[5:]):
        raise FormatError(
            f"DISTORTION_COEFFICIENTS_{side}: terms beyond k3 are not zero, only k1 k2 p1 p2 k3 are known"
        )
    skew, bottom = matrix[[0, 1], [1, 0]], matrix[2]
    if np.any(skew) or np.any(bottom != [0, 0, 1]) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise FormatError(f"CAMERA_MATRIX_{side} is no camera matrix fx 0 cx 0 fy cy 0 0 1")
    lens = Lens.from_opencv(matrix, distortion[:5], (WIDTH, HEIGHT))
    if abs(lens.cx / WIDTH - 0.5) > _MAX_OFF_CENTRE or abs(lens.cy / HEIGHT - 0.5) > _MAX_OFF_CENTRE:
        raise FormatError(
            f"CAMERA_MATRIX_{side}: principal point {lens.cx:.0f}, {lens.cy:.0f} px, expected near "
            f"{WIDTH // 2}, {HEIGHT // 2}: calibrated on images of another size than {WIDTH} x {HEIGHT}?"
        )
    return lens


def write_calibration(path: str | Path, rig: StereoRig) -> None:
    """Write `stereo.calibration` with 6 significant digits, as NASA's; four distortion terms where k3 is zero."""
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
def read_range_map(path: str | Path, size: tuple[int, int] = (WIDTH, HEIGHT)) -> np.ndarray:
    """Return points (h, w, 3) float32, metres, in the rectified left frame; NaN where the map has no data.

    A pixel has no data where its z is not positive or the file's no-data value, its bands are not finite, or all three
    are equal: no camera sees a point at x = y = z, and this is how marks such as 99999 appear.

    Parameters
    ----------
    size : (width, height)
        Size that the map must have, px. It is checked before any pixel is read.

    Raises
    ------
    FormatError
        No TIFF, a compression that needs another package, another size, fewer than three bands, no valid point, or
        values that are not in millimetres.
    """
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # it would log many lines of a file that is refused in one
    with tifffile.TiffFile(path) as tiff:
        bands_last = _bands_last(tiff.series[0].shape if tiff.series else (), size)
        page: Any = tiff.pages[0]
        no_data = page.tags.get(_NO_DATA_TAG)
        bands = _decoded(tiff, page)
    if bands.dtype.kind not in "fiu":
        raise FormatError(f"values of type {bands.dtype}, a range map has numbers")
    points = (bands[..., :3] if bands_last else np.moveaxis(bands[:3], 0, -1)).astype(np.float32)
    x, y, z = np.moveaxis(points, -1, 0)
    with np.errstate(invalid="ignore"):
        empty = ~np.isfinite(points).all(axis=-1) | (z <= 0) | ((x == y) & (y == z))
    if no_data is not None:
        empty |= z == np.float32(str(no_data.value).strip("\0 "))  # a true x or y may be 0, a usual value of the tag
    points *= np.float32(MM)
    points[empty] = np.nan
    if empty.all():
        raise FormatError("no valid point")
    middle = float(np.median(z[~empty][::64]))  # a part of the pixels is enough for the unit
    if not _NEAREST <= middle <= _FARTHEST:
        raise FormatError(f"the median distance is {middle / MM:.4g}, expected millimetres: convert the unit")
    return points


def _decoded(tiff: Any, page: Any) -> np.ndarray:
    try:
        return np.asarray(tiff.series[0].asarray())
    except (ImportError, ValueError) as error:  # tifffile decodes no compression or predictor, or another error
        if not isinstance(error, ImportError) and "imagecodecs" not in str(error):
            raise
        name = getattr(page.compression, "name", page.compression)
        raise FormatError(
            f"compression {name} with predictor {int(page.predictor)} needs the package imagecodecs: install it, "
            "or save the map without compression"
        ) from error


def _bands_last(shape: tuple[int, ...], size: tuple[int, int]) -> bool:
    """Whether the bands of an image of this shape come last (or first); refuses any other shape."""
    width, height = size
    if len(shape) == 3 and shape[:2] == (height, width) and 3 <= shape[2] <= _MOST_BANDS:
        return True
    if len(shape) == 3 and shape[1:] == (height, width) and 3 <= shape[0] <= _MOST_BANDS:
        return False
    stated = " x ".join(map(str, shape)) or "nothing"
    raise FormatError(f"{stated}, expected {height} rows, {width} columns and 3 bands X Y Z")


def write_range_map(path: str | Path, points_m: np.ndarray) -> None:
    """Write points (h, w, 3), metres, as three float32 bands in millimetres; NaN (no point) becomes 0."""
    import tifffile

    bands = np.nan_to_num(np.asarray(points_m, np.float32) / np.float32(MM), nan=0.0, posinf=0.0, neginf=0.0)
    with writing(path) as temporary:
        tifffile.imwrite(
            temporary, bands, photometric="minisblack", planarconfig="contig", metadata=None, software=False
        )


@reader("cloud", largest_mb=4000)
def read_cloud(path: str | Path, unit_m: float = MM) -> np.ndarray:
    """Points (n, 3) float64, metres, of a scan in its rectified left frame.

    Parameters
    ----------
    path : .xyz, .txt, .pts or .ply
        Text with `x y z ...` per line after any header (further columns are ignored), or a PLY file. Fields are
        separated by blanks, commas or semicolons; decimal commas are read where blanks or semicolons separate.
    unit_m : float
        The file's unit of length, metres.

    Raises
    ------
    FormatError
        Another suffix, no numbers, ragged lines, or no point.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in CLOUD_SUFFIXES:
        raise FormatError(f"a cloud's name ends in {', '.join(CLOUD_SUFFIXES)}", path=path)
    points = _read_ply(path) if suffix == ".ply" else _read_ascii_cloud(path)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise FormatError("no point", path=path)
    return points * unit_m


@dataclass(frozen=True)
class _Dialect:
    """Spelling of the points of a text cloud."""

    separator: str  # of fields, as pandas takes it
    decimal: str
    encoding: str

    def fields(self, line: str) -> list[str]:
        return line.split() if self.separator == r"\s+" else [field.strip() for field in line.split(self.separator)]

    def numbers(self, line: str) -> list[float]:
        """Return the first three numbers of a line, fewer where the line ends before; an empty field is NaN.

        Raises
        ------
        ValueError
            A field is no number.
        """
        return [float(field.replace(self.decimal, ".") or "nan") for field in self.fields(line)[:3]]


def _read_ascii_cloud(path: str | Path) -> np.ndarray:
    import pandas as pd

    encoding = _encoding(path)
    with Path(path).open(encoding=encoding, errors="replace") as lines:
        start = [line for _, line in zip(range(_CLOUD_START), lines, strict=False)]
    _refuse_ptx(start)
    spelled = ((number, _dialect(line, encoding)) for number, line in enumerate(start))
    first, dialect = next(((number, one) for number, one in spelled if one is not None), (0, None))
    if dialect is None:
        raise FormatError(f"no line of x y z among the first {_CLOUD_START}", path=path)
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
    partial = np.isnan(points).any(axis=1) & ~np.isnan(points).all(axis=1)  # all NaN: a ray that met nothing
    if partial.any():
        _require_points(path, first, dialect)
        log.warning("%s: %d points left out, a coordinate is not a number", path, int(partial.sum()))
    return points


def _encoding(path: str | Path) -> str:
    with Path(path).open("rb") as file:
        start = file.read(4)
    return next((encoding for mark, encoding in ENCODINGS if start.startswith(mark)), "utf-8")


def _dialect(line: str, encoding: str) -> _Dialect | None:
    """Return the spelling of a line of x y z; None for other lines, such as a header."""
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
    """Refuse Leica's PTX under another name: the rows of its matrices are no points."""
    filled = [line.split() for line in start if line.strip()][: len(_PTX_HEADER)]
    if tuple(map(len, filled)) == _PTX_HEADER and all(row[0].isdigit() for row in filled[:2]):
        raise FormatError("a PTX file with matrices of a scanner: export the points as x y z of the left camera")


def _require_points(path: str | Path, first: int, dialect: _Dialect) -> None:
    """Name the first line after the header that is no x y z; slow, for files with an error."""
    with Path(path).open(encoding=dialect.encoding, errors="replace") as lines:
        for number, line in enumerate(lines):
            if number < first or not line.strip():
                continue
            try:
                found = dialect.numbers(line)
            except ValueError as error:
                raise FormatError(f"{error}, a point is x y z", path=path, line=number + 1) from error
            if len(found) < 3:
                raise FormatError("fewer than 3 numbers, a point is x y z", path=path, line=number + 1)


def _read_ply(path: str | Path) -> np.ndarray:
    import trimesh

    loaded: Any = trimesh.load(path, file_type="ply", process=False)
    return np.array(loaded.vertices, dtype=float).reshape(-1, 3)


def write_cloud(path: str | Path, points_m: np.ndarray, intensity: np.ndarray) -> None:
    """Write points (n, 3), metres, as ASCII `x y z intensity`: tenths of a millimetre, whole intensities."""
    import pyarrow as pa
    from pyarrow import csv

    tenths = np.round(np.asarray(points_m, float) / MM, 1) + 0.0  # no "-0"
    columns = {name: tenths[:, n] for n, name in enumerate("xyz")}
    table = pa.table({**columns, "intensity": np.asarray(intensity).astype(np.int64)})
    options = csv.WriteOptions(include_header=False, delimiter=" ", quoting_style="none")
    with writing(path) as temporary:
        csv.write_csv(table, str(temporary), options)


def find_terrain_folder(root: str | Path, terrain: int) -> Path | None:
    """The folder `TerrainNN_Name` below a root, or one level deeper; None where there is none.

    Raises
    ------
    FormatError
        There are two.
    """
    name = re.compile(rf"Terrain{terrain:02d}_.*")
    for pattern in ("*", "*/*"):
        found = sorted(path for path in Path(root).glob(pattern) if name.fullmatch(path.name) and path.is_dir())
        if len(found) > 1:
            raise FormatError(f"two folders of terrain {terrain:02d}, {found[0].name} and {found[1].name}", path=root)
        if found:
            return found[0]
    return None


def find_calibration(terrain_folder: str | Path) -> Path | None:
    """`stereo.calibration` of a terrain's folder, or one level deeper."""
    found = [
        *sorted(Path(terrain_folder).glob(CALIBRATION_NAME)),
        *sorted(Path(terrain_folder).glob(f"*/{CALIBRATION_NAME}")),
    ]
    return found[0] if found else None


def find_photos(terrain_folder: str | Path, terrain: int) -> list[tuple[PhotoKey, Path]]:
    """Every photo below a terrain's folder (one extra folder level may lie between), sorted by key.

    The middle token of a photo's name means nothing here. Pictures with other names are strays: logged once, left out.

    Raises
    ------
    FormatError
        Two files bear the same photo key.
    """
    photos: dict[PhotoKey, Path] = {}
    strays = []
    for path, key in _pictures(Path(terrain_folder), terrain):
        if key is None:
            strays.append(path.name)
        elif key in photos:
            raise FormatError(f"a second photo {key} beside {photos[key]}", path=path)
        else:
            photos[key] = path
    if strays:
        log.warning("%s: %d stray pictures left out, such as %s", terrain_folder, len(strays), strays[0])
    return sorted(photos.items())


def find_strays(terrain_folder: str | Path, terrain: int) -> list[Path]:
    """Pictures below a terrain's folder whose names are no photo's."""
    return [path for path, key in _pictures(Path(terrain_folder), terrain) if key is None]


def _pictures(folder: Path, terrain: int) -> Iterator[tuple[Path, PhotoKey | None]]:
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() == ".png"):
        above = len(path.relative_to(folder).parts) - 3
        found = _PHOTO.fullmatch("/".join(path.parts[-3:])) if above in (0, 1) else None
        yield path, _photo_key(found, terrain) if found else None


def _photo_key(found: re.Match[str], terrain: int) -> PhotoKey | None:
    azimuth = found[4] or "no"
    if azimuth not in ("no", *SUNS) or not is_exposure(int(found[7])):
        return None
    return PhotoKey(terrain, found[1], found[2], azimuth, found[5], int(found[7]))  # type: ignore[arg-type]


def photo_path(terrain_folder: str | Path, key: PhotoKey, token: str) -> Path:
    """Where NASA would have put a photo: `PosA_1500_Loff/Sun_30/CamL_<token>_0256.png`; a pair shares its token."""
    distance_mm = POSITION_DISTANCE_MM.get(key.position, POSITION_DISTANCE_MM["A"])
    sun = "NoSun" if key.azimuth == "no" else f"Sun_{key.azimuth}"
    position = f"Pos{key.position}_{distance_mm}_L{key.light}"
    return Path(terrain_folder) / position / sun / f"Cam{key.camera}_{token}_{key.exposure_ms:04d}.png"


def range_map_path(folder: str | Path, position: str) -> Path:
    """Name of a position's range map in the terrain's folder of range maps."""
    return Path(folder) / f"Pos{position}_org-XYZ.tif"


def find_scans(root: str | Path, terrain: int) -> tuple[dict[str, Path], dict[str, Path]]:
    """Range maps and clouds of a terrain below a root (one extra folder level may lie between), by position.

    Raises
    ------
    FormatError
        Two clouds of one position.
    """
    maps: dict[str, Path] = {}
    for pattern in (RANGE_FOLDER, f"*/{RANGE_FOLDER}"):
        for path in sorted(Path(root).glob(f"{pattern}/Terrain{terrain:02d}/Pos?_org-XYZ.[tT][iI][fF]")):
            maps.setdefault(path.name[3], path)
    clouds: dict[str, Path] = {}
    folder = find_terrain_folder(root, terrain)
    inside = [] if folder is None else [*sorted(folder.glob("Pos?.*")), *sorted(folder.glob("*/Pos?.*"))]
    for path in inside:
        if path.suffix.lower() not in CLOUD_SUFFIXES:
            if path.is_file():
                log.warning("%s: left out, a cloud's name ends in %s", path, ", ".join(CLOUD_SUFFIXES))
            continue
        if path.stem[3] in clouds:
            raise FormatError(f"a second cloud of position {path.stem[3]} beside {clouds[path.stem[3]]}", path=path)
        clouds[path.stem[3]] = path
    return maps, clouds
