"""Cameras of a terrain as a COLMAP model in text: `cameras.txt rigs.txt frames.txt images.txt points3D.txt`.

The model has a single rig, with the left (or only) camera as reference sensor, and a frame per position. Images are
photos, named by the path from the folder of the model, or `PosA_CamL` and `PosA_CamR` without photos. Models of a drive
have a frame per moment. Points are vertices of meshes, without tracks. COLMAP's world frame is the sandbox frame,
metres; pixel centres are at integer + 0.5, as in polarsim.

COLMAP's text format separates fields by blanks, so that a name must not contain blanks.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from polarsim.errors import FormatError, with_path
from polarsim.formats.files import share_file, writing_folder
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig

CAMERA_ID = {"L": 1, "R": 2}
RIG_ID = 1
_GREY = np.full(3, 128, np.uint8)  # colour of points; meshes have no colour


class LocalisedPair(Protocol):
    """A stereo rig at a position, such as `run_files.rigs.LocalisedRig`."""

    @property
    def rig(self) -> StereoRig: ...

    @property
    def sandbox_from_left(self) -> Pose: ...


def write_model(
    folder: str | Path,
    localised: Mapping[str, LocalisedPair],
    pictures: Mapping[tuple[str, str], str] | None = None,
    points: np.ndarray | None = None,
) -> None:
    """Write the rigs of a terrain by position. All rigs must have the same calibration.

    `pictures` are names of images by position and camera: paths from the folder that contain the position as `PosX` and
    the camera as `CamL` or `CamR`, or a photo key. A file with a blank in the name is linked into the model as
    `images/PosX_CamL.png`. `points` (n, 3) are points of the scene, sandbox frame, metres.
    """
    with with_path(folder):
        rig = common_rig(localised)
    linked: dict[str, Path] = {}  # name in the model -> file
    frames = []
    for position in sorted(localised):
        names: dict[str, str] = {}
        for camera in rig.sides:
            default_name = f"Pos{position}_Cam{camera}"
            name = (pictures or {}).get((position, camera), default_name)
            if len(name.split()) > 1:
                file = Path(os.path.normpath(Path(folder, name)))
                name = f"images/{default_name}{file.suffix}" if file.is_file() else default_name
                linked |= {name: file} if file.is_file() else {}
            names[camera] = name
        frames.append((names, localised[position].sandbox_from_left))
    points = np.zeros((0, 3)) if points is None else points
    with writing_folder(folder) as temporary:
        for name, file in linked.items():
            (temporary / name).parent.mkdir(exist_ok=True)
            share_file(file, temporary / name)
        write_pictures(temporary, rig, frames, points, np.tile(_GREY, (len(points), 1)))


def common_rig(localised: Mapping[str, LocalisedPair]) -> StereoRig:
    """Return the rig that all positions share."""
    if not localised:
        raise FormatError("no position given, a COLMAP model needs at least 1")
    first, *others = (pair.rig for pair in localised.values())
    for rig in others:
        moved = not np.allclose(rig.left_from_right.matrix, first.left_from_right.matrix, rtol=0, atol=1e-12)
        if moved or (rig.left, rig.right) != (first.left, first.right):
            names = ", ".join(sorted(localised))
            raise FormatError(f"positions {names} have different rigs, a COLMAP model has a single rig")
    return first


def write_pictures(
    folder: Path,
    rig: StereoRig,
    frames: Sequence[tuple[Mapping[str, str], Pose]],
    points: np.ndarray,
    colours: np.ndarray,
) -> None:
    """Write a model with the images of a single rig and with initial points for a reconstruction.

    `frames` are the names of the images by camera (one or both) and `sandbox_from_left` of each moment; `points` (n, 3)
    in the sandbox frame, metres, with `colours` (n, 3) uint8, have no tracks because images are not matched.
    """
    import pycolmap

    model = pycolmap.Reconstruction()
    for camera in rig.sides:
        model.add_camera(_camera(CAMERA_ID[camera], rig.lens(camera)))
    sensors = pycolmap.Rig(rig_id=RIG_ID)
    sensors.add_ref_sensor(_sensor("L"))
    if rig.is_stereo:
        sensors.add_sensor(_sensor("R"), _rigid(rig.left_from_right.inverse()))
    model.add_rig(sensors)
    for frame_id, (names, sandbox_from_left) in enumerate(frames, 1):
        _add_frame(model, frame_id, names, sandbox_from_left)
    for point, colour in zip(points, colours, strict=True):
        model.add_point3D(point, pycolmap.Track(), colour)
    folder.mkdir(parents=True, exist_ok=True)
    model.write_text(str(folder))


def _add_frame(model: Any, frame_id: int, names: Mapping[str, str], sandbox_from_left: Pose) -> None:
    import pycolmap

    frame = pycolmap.Frame(frame_id=frame_id, rig_id=RIG_ID)
    image_ids = {camera: 2 * frame_id - 2 + CAMERA_ID[camera] for camera in names}
    for camera in names:
        frame.add_data_id(pycolmap.data_t(_sensor(camera), image_ids[camera]))
    frame.rig_from_world = _rigid(sandbox_from_left.inverse())
    model.add_frame(frame)
    for camera, name in names.items():
        image = pycolmap.Image(name=name, camera_id=CAMERA_ID[camera], image_id=image_ids[camera])
        image.frame_id = frame_id
        model.add_image(image)


def _sensor(camera: str) -> Any:
    import pycolmap

    return pycolmap.sensor_t(pycolmap.SensorType.CAMERA, CAMERA_ID[camera])


def _camera(camera_id: int, lens: Lens) -> Any:
    import pycolmap

    k1, k2, p1, p2, k3 = lens.distortion
    model, tail = ("FULL_OPENCV", [k3, 0.0, 0.0, 0.0]) if k3 else ("OPENCV", [])
    return pycolmap.Camera(
        camera_id=camera_id,
        model=model,
        width=lens.width,
        height=lens.height,
        params=[lens.fx, lens.fy, lens.cx, lens.cy, k1, k2, p1, p2, *tail],
    )


def _rigid(pose: Pose) -> Any:
    import pycolmap

    return pycolmap.Rigid3d(np.column_stack([pose.rotation, pose.translation]))
