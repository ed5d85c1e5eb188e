"""Lenses and rigs from COLMAP's text files `cameras.txt` and `images.txt`.

COLMAP's pixel centres are at integer + 0.5, poses are `camera_from_world` as quaternion (w x y z) and translation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.files import text_of
from polarsim.formats.stated_calibration import StatedCalibration, StatedLens
from polarsim.geometry.lens import HALF_PIXEL
from polarsim.geometry.poses import Pose

CAMERAS_NAME, IMAGES_NAME = "cameras.txt", "images.txt"
# Parameters of COLMAP's models as OpenCV's fx fy cx cy and distortion k1 k2 p1 p2 k3 k4 k5 k6.
_MODELS = {
    "SIMPLE_PINHOLE": "f f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f f cx cy k1",
    "RADIAL": "f f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
}
_MAX_TURN_DEG, _MAX_MOVE = 0.1, 0.01  # differences of the pairs of a rig: angle, and share of the baseline


def read_cameras(path: str | Path) -> StatedCalibration:
    """Read one or two cameras; the camera with the smaller id is the left one."""
    lenses: dict[int, StatedLens] = {}
    for number, fields in _lines(path):
        try:
            camera, model, width, height, *values = fields
            if model not in _MODELS:
                raise FormatError(f"camera model {model}, expected {', '.join(_MODELS)}", path=path, line=number)
            lenses[int(camera)] = _lens(int(camera), model, (int(width), int(height)), [float(v) for v in values])
        except (ValueError, IndexError) as error:
            raise FormatError(
                f"expected CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS, {error}", path=path, line=number
            ) from error
    if len(lenses) not in (1, 2):
        raise FormatError(f"{len(lenses)} cameras, expected one or two", path=path)
    left, *others = sorted(lenses)
    images = Path(path).with_name(IMAGES_NAME)
    if not others:
        return StatedCalibration(lenses[left])
    if not images.is_file():
        raise FormatError("the positions of two cameras are in images.txt, which is missing", path=images)
    motion = _rig_motion(images, left, others[0])
    return StatedCalibration(lenses[left], lenses[others[0]], motion.rotation, motion.translation, IMAGES_NAME)


def _lens(camera: int, model: str, size: tuple[int, int], values: list[float]) -> StatedLens:
    names = list(dict.fromkeys(_MODELS[model].split()))
    if len(values) != len(names):
        raise FormatError(f"camera {camera} has {len(values)} parameters, expected {len(names)}: {' '.join(names)}")
    of = dict(zip(names, values, strict=True))
    fx, fy = of.get("fx", of.get("f", 0.0)), of.get("fy", of.get("f", 0.0))
    matrix = np.array([[fx, 0, of["cx"] - HALF_PIXEL], [0, fy, of["cy"] - HALF_PIXEL], [0, 0, 1]])
    terms = np.array([of.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")])
    return StatedLens(matrix, terms, f"camera {camera}", f"camera {camera}", size)


def _rig_motion(path: Path, left: int, right: int) -> Pose:
    """Return `right_from_left` of the pairs of images, which are paired in the order of their names."""
    poses: dict[int, list[tuple[str, Pose]]] = {left: [], right: []}
    for number, fields in list(_lines(path, keep_empty=True))[::2]:  # every second line lists 2D points
        try:
            w, x, y, z, tx, ty, tz = (float(value) for value in fields[1:8])
            camera, name = int(fields[8]), " ".join(fields[9:])
        except (ValueError, IndexError) as error:
            raise FormatError(
                f"expected IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, {error}", path, number
            ) from error
        if camera in poses:
            poses[camera].append((name, Pose(_rotation(w, x, y, z), np.array([tx, ty, tz]))))
    if not poses[left] or len(poses[left]) != len(poses[right]):
        counts = " and ".join(f"{len(found)} of camera {camera}" for camera, found in poses.items())
        raise FormatError(f"images {counts}, expected pairs", path=path)
    pairs = zip(
        sorted(poses[left], key=lambda pair: pair[0]), sorted(poses[right], key=lambda pair: pair[0]), strict=True
    )
    motions = [right_from @ left_from.inverse() for (_, left_from), (_, right_from) in pairs]
    first = motions[0]
    for motion in motions[1:]:
        turn = np.degrees(np.arccos(np.clip((np.trace(motion.rotation.T @ first.rotation) - 1) / 2, -1, 1)))
        move = np.linalg.norm(motion.translation - first.translation) / np.linalg.norm(first.translation)
        if turn > _MAX_TURN_DEG or move > _MAX_MOVE:
            raise FormatError("pairs of images have different poses, expected those of a rig", path=path)
    return first


def _rotation(w: float, x: float, y: float, z: float) -> np.ndarray:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_quat([x, y, z, w]).as_matrix())


def _lines(path: str | Path, *, keep_empty: bool = False) -> list[tuple[int, list[str]]]:
    """Return numbers and fields of the lines that are no comments."""
    lines = [(number, line.split()) for number, line in enumerate(text_of(path).splitlines(), 1)]
    return [
        (number, fields) for number, fields in lines if (fields or keep_empty) and not (fields and fields[0][0] == "#")
    ]
