"""Folders of the pictures of a drive, and the columns of their tables."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from polarsim.errors import RoverError
from polarsim.render.options import Model
from polarsim.run_files.picture_sets import PictureSet

BOX = ["x0", "y0", "x1", "y1"]
POSE_COLUMNS = ("frame", "time_s", "x_m", "y_m", "z_m", "qw", "qx", "qy", "qz")
TRUTH_COLUMNS = ("frame", "time_s", "kind", "rock", *BOX, "pixels", "distance_m", "height_m")
DETECTION_COLUMNS = ("frame", "kind", "confidence", *BOX)


def picture_folder(folder: Path, view: str, sun: str, model: Model, exposure_ms: float) -> Path:
    """Return the folder of a set of pictures of a view: see `run_files.picture_sets`."""
    return folder / view / str(PictureSet(sun, model, exposure_ms))


def frame_files(pictures: Path, frames: Iterable[int]) -> list[Path]:
    """Return the files of frames in a folder of pictures; a missing file is a `RoverError`."""
    files = [pictures / f"{frame:05d}.png" for frame in frames]
    for path in files:
        if not path.is_file():
            raise RoverError("the picture is missing", path=path)
    return files


def labels_folder(folder: Path, view: str, sun: str) -> Path:
    """Return the folder of the labels of a view under a Sun."""
    return folder / view / f"{sun}_labels"
