"""Stereo calibrations and lens calibrations of several programs, as a `StereoRig` that fits a site.

- NASA's `stereo.calibration`, see `nasa`
- OpenCV's YAML and ROS's `camera_info` (keys of `_opencv_stated`), also with a section per camera
- Kalibr's camchain, see `_kalibr_stated`
- COLMAP's `cameras.txt`; a rig also needs `images.txt`, see `colmap_text`

Conventions: x_right = R x_left + T, metres; camera matrices count pixels from the centre of the first pixel (OpenCV).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from polarsim.errors import ConfigError, FormatError
from polarsim.formats import colmap_text, nasa
from polarsim.formats.files import resolve_packaged, text_of
from polarsim.formats.readers import reader
from polarsim.formats.stated_calibration import StatedCalibration, StatedLens
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, orthogonal_rotation
from polarsim.geometry.stereo import StereoRig
from polarsim.site import Site

_TERMS = 5  # k1 k2 p1 p2 k3
_MAX_TILT = 0.5  # sine of the angle between the baseline and the x axis of the left camera
_MAX_OFF_CENTRE = 0.15  # distance of a principal point from the image centre, as a share of image width and height

# Normalised keys of OpenCV's programs and ROS, without the camera: `_key_of` splits `camera_matrix_left` and `M1`.
_MATRIX = ("camera_matrix", "matrix", "intrinsics", "intrinsic_matrix", "k", "m", "cm")
_DISTORTION = ("distortion_coefficients", "distortion", "dist_coeffs", "distcoeffs", "dist", "d")
_ROTATION = ("rotation_matrix", "rotation", "r")
_TRANSLATION = ("translation_vector", "translation", "t")
_WIDTH, _HEIGHT = ("image_width", "width"), ("image_height", "height")
_SIZE = ("image_size", "resolution", "size")
_SECTIONS = ("cam", "stereo", "extrinsics", "extrinsic", "calibration")  # words of keys without a meaning here
_SIDES = {"left": 0, "l": 0, "right": 1, "r": 1}


class _Loader(yaml.SafeLoader):
    """YAML loader that also reads OpenCV's matrices."""


def _matrix(loader: yaml.SafeLoader, node: yaml.MappingNode) -> dict[Any, Any]:
    return loader.construct_mapping(node, deep=True)


for _tag in ("opencv-matrix", "opencv-nd-matrix"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_tag}", _matrix)


@reader("calibration", largest_mb=1)
def read_calibration(path: str | Path, site: Site) -> StereoRig:
    """Read a calibration in any of the formats; raise an error if it does not fit the cameras of the site."""
    return checked_rig(read_stated(path), site)


@reader("calibration", largest_mb=1)
def read_stated(path: str | Path) -> StatedCalibration:
    """Read a calibration in any of the formats."""
    text = text_of(path)
    if Path(path).name == colmap_text.CAMERAS_NAME:
        return colmap_text.read_cameras(path)
    return nasa.parse_calibration(text) if nasa.is_calibration(text) else _parse_yaml(text)


@lru_cache(maxsize=4)
def _stated_rig(path: Path, site: str) -> StereoRig:
    return read_calibration(path, Site.model_validate_json(site))


def stated_rig(site: Site) -> StereoRig:
    """Return the rig of `cameras.calibration` of a site: the prior for terrains without a calibration."""
    if site.cameras.calibration is None:
        raise ConfigError(
            f"the site {site.name} has no calibration: expected a file {site.files.calibration or ''}".rstrip()
            + ", or `cameras.calibration` in the site file"
        )
    return _stated_rig(resolve_packaged(site.cameras.calibration), site.model_dump_json())


def checked_rig(stated: StatedCalibration, site: Site) -> StereoRig:
    """Return the rig of a calibration after a check of lenses and baseline; the second camera is ignored for one."""
    left = _lens(stated.left, site)
    if not site.cameras.stereo:
        return StereoRig.single(left)
    if stated.right is None or stated.rotation is None or stated.translation is None:
        missing = "the second camera" if stated.right is None else "rotation and translation of the second camera"
        raise FormatError(f"{missing} is missing, expected two cameras (cameras.stereo of the site {site.name})")
    low, high = site.cameras.baseline_m or (0.0, np.inf)
    length = float(np.linalg.norm(stated.translation))
    if not low <= length <= high:
        unit = ", is the unit millimetres?" if low <= length / 1000 <= high else ""
        raise FormatError(
            f"{stated.translation_name} is {length:.4g} m long, expected {low:g} to {high:g} (cameras.baseline_m of "
            f"the site {site.name}){unit}"
        )
    rotation = orthogonal_rotation(stated.rotation)
    left_from_right = Pose(rotation, stated.translation).inverse()  # OpenCV: x_right = R x_left + T
    x, y, z = left_from_right.translation
    if x < 0 or np.hypot(y, z) > _MAX_TILT * length:
        raise FormatError(
            f"{stated.translation_name} places the right camera at x {x:.3g}, y {y:.3g}, z {z:.3g} m in the frame of "
            f"the left camera, expected x {length:.2f}, y 0, z 0: are left and right exchanged? (x_right = R x_left + "
            "T, x of T < 0)"
        )
    return StereoRig(left, _lens(stated.right, site), left_from_right)


def _lens(stated: StatedLens, site: Site) -> Lens:
    width, height = site.images.size
    if stated.size not in (None, (width, height)):
        raise FormatError(
            f"{stated.name}: images of {stated.size[0]} x {stated.size[1]} pixels, expected {width} x {height}"
        )
    terms, matrix = stated.distortion, stated.matrix
    if np.any(terms[_TERMS:]):
        raise FormatError(f"{stated.distortion_name}: terms after k3 are not zero, only k1 k2 p1 p2 k3 are supported")
    if not np.isfinite(matrix).all() or not np.isfinite(terms).all():
        raise FormatError(f"{stated.name} has a number that is not finite")
    skew, bottom = matrix[[0, 1], [1, 0]], matrix[2]
    if np.any(skew) or np.any(bottom != [0, 0, 1]) or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise FormatError(f"{stated.name} is no camera matrix, expected fx 0 cx 0 fy cy 0 0 1")
    lens = Lens.from_opencv(matrix, terms[:_TERMS], (width, height))
    if abs(lens.cx / width - 0.5) > _MAX_OFF_CENTRE or abs(lens.cy / height - 0.5) > _MAX_OFF_CENTRE:
        raise FormatError(
            f"{stated.name}: principal point {lens.cx:.0f}, {lens.cy:.0f} px, expected near "
            f"{width // 2}, {height // 2}: was the calibration made with images of {width} x {height}?"
        )
    return lens


def _parse_yaml(text: str) -> StatedCalibration:
    """Parse Kalibr's or OpenCV's YAML."""
    body = re.sub(r"\A%YAML:[^\n]*\n", "", text)  # OpenCV's directive is invalid YAML
    content = yaml.load(body, Loader=_Loader)  # noqa: S506 (a SafeLoader)
    if not isinstance(content, Mapping):
        raise FormatError(
            "no calibration, expected NASA's stereo.calibration, OpenCV YAML, Kalibr's camchain YAML or COLMAP's "
            f"{colmap_text.CAMERAS_NAME}"
        )
    return _kalibr_stated(content) if "cam0" in content else _opencv_stated(content)


def _kalibr_stated(content: Mapping[str, Any]) -> StatedCalibration:
    """Return Kalibr's camchain: `cam0` is the left camera; `T_cn_cnm1` of `cam1` maps points of cam0 to cam1."""

    def lens(name: str) -> StatedLens:
        camera = content[name]
        for key, known in (("camera_model", ("pinhole",)), ("distortion_model", ("radtan", "none"))):
            if camera.get(key, known[0]) not in known:
                raise FormatError(f"{name}.{key}: {camera[key]!r}, expected {known[0]}: calibrate with pinhole-radtan")
        fx, fy, cx, cy = _numbers(camera, "intrinsics", name, (4,))
        width, height = _numbers(camera, "resolution", name, (2,)).astype(int).tolist()
        terms = _numbers(camera, "distortion_coeffs", name, (0, 4)) if "distortion_coeffs" in camera else np.zeros(0)
        matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        return StatedLens(matrix, terms, f"{name}.intrinsics", f"{name}.distortion_coeffs", (width, height))

    if "cam1" not in content:
        return StatedCalibration(lens("cam0"))
    motion = _numbers(content["cam1"], "T_cn_cnm1", "cam1", (16,)).reshape(4, 4)
    return StatedCalibration(lens("cam0"), lens("cam1"), motion[:3, :3], motion[:3, 3], "T_cn_cnm1")


def _opencv_stated(content: Mapping[str, Any]) -> StatedCalibration:
    """Return OpenCV's matrices by key, such as `camera_matrix_left`, `cameraMatrix1`, `M1`, or `left: {K: ...}`."""
    found: dict[tuple[str, int | None], tuple[str, Any]] = {}
    for name, value in _flat(content):
        quantity, side = _key_of(name)
        if quantity:
            if (quantity, side) in found:
                raise FormatError(f"{found[quantity, side][0]} and {name}: expected one of them")
            found[quantity, side] = name, value
    sides = sorted(
        {side for quantity, side in found if quantity == "matrix"}, key=lambda side: -1 if side is None else side
    )
    if not sides:
        raise FormatError("no camera matrix, expected camera_matrix and distortion_coefficients")
    if len(sides) > 2:
        raise FormatError(f"{len(sides)} camera matrices, expected one or two")

    def lens(side: int | None) -> StatedLens:
        name, value = found["matrix", side]
        terms_name, terms = found.get(("distortion", side), ("distortion_coefficients", []))
        stated = {key: found.get((key, side)) or found.get((key, None)) for key in ("width", "height", "size")}
        parts = [stated["size"]] if stated["size"] else [part for part in (stated["width"], stated["height"]) if part]
        size = [int(value) for name, part in parts for value in _array(part, name, (1, 2))]
        return StatedLens(
            _array(value, name, (9,)).reshape(3, 3), _array(terms, terms_name, (0, 4, 5, 8, 12, 14)), name, terms_name,
            (size[0], size[1]) if len(size) == 2 else None,
        )  # fmt: skip

    motion = {}
    for quantity, count in (("rotation", 9), ("translation", 3)):
        entries = [found[key] for key in found if key[0] == quantity]
        if len(entries) > 1:  # ROS: the rectification of each camera is also called R
            entries = [found[key] for key in found if key == (quantity, None)]
        motion[quantity] = (_array(entries[0][1], entries[0][0], (count,)), entries[0][0]) if entries else (None, "T")
    rotation, (translation, name) = motion["rotation"][0], motion["translation"]
    right = lens(sides[1]) if len(sides) == 2 else None
    return StatedCalibration(
        lens(sides[0]), right, None if rotation is None else rotation.reshape(3, 3), translation, name
    )


def _flat(content: Mapping[str, Any], above: str = "") -> list[tuple[str, Any]]:
    """Return entries by key, with the keys of sections joined by underscores. A matrix is a section with `data`."""
    entries: list[tuple[str, Any]] = []
    for key, value in content.items():
        name = f"{above}_{key}" if above else str(key)
        is_section = isinstance(value, Mapping) and "data" not in value
        entries += _flat(value, name) if is_section else [(name, value)]
    return entries


def _key_of(name: str) -> tuple[str | None, int | None]:
    """Return the quantity of a key, such as `matrix` or `rotation`, and the number of its camera."""
    snake = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    words = [word for word in re.split(r"[_\W]+|(?<=[a-z])(?=\d)", snake) if word and word not in _SECTIONS]
    side = None
    if len(words) > 1:
        named = next((word for word in words if word in _SIDES), None)
        number = next((word for word in words if word.isdigit()), None)
        if named is not None:
            side, words = _SIDES[named], [word for word in words if word != named]
        elif number is not None:
            side, words = int(number), [word for word in words if word != number]
    bare = "_".join(words)
    for quantity, names in (
        ("matrix", _MATRIX), ("distortion", _DISTORTION), ("rotation", _ROTATION), ("translation", _TRANSLATION),
        ("width", _WIDTH), ("height", _HEIGHT), ("size", _SIZE),
    ):  # fmt: skip
        if bare in names:
            return quantity, side
    return None, side


def _numbers(section: Mapping[str, Any], key: str, where: str, counts: tuple[int, ...]) -> np.ndarray:
    if key not in section:
        raise FormatError(f"{where}.{key} is missing")
    return _array(section[key], f"{where}.{key}", counts)


def _array(value: Any, name: str, counts: tuple[int, ...]) -> np.ndarray:
    """Return the numbers of a list, of nested lists, or of a matrix with `data`."""
    data = value["data"] if isinstance(value, Mapping) else value
    try:
        numbers = np.ravel(np.array(data, dtype=float))
    except (TypeError, ValueError) as error:
        raise FormatError(f"{name}: expected numbers, {error}") from error
    if len(numbers) not in counts:
        raise FormatError(f"{name} has {len(numbers)} numbers, expected {' or '.join(map(str, counts))}")
    if not np.isfinite(numbers).all():
        raise FormatError(f"{name} has a number that is not finite")
    return numbers
