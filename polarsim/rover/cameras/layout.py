"""How pictures of a drive lie below its folder, and the columns of the tables beside them."""

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


def picture_set(sun: str, model: Model, exposure_ms: float) -> str:
    """Name of the pictures of a view in one light: `<Sun>_<model>_<exposure>`, see `formats.picture_sets`."""
    return str(PictureSet(sun, model, exposure_ms))


def picture_folder(folder: Path, view: str, sun: str, model: Model, exposure_ms: float) -> Path:
    """Where the pictures of a view under a Sun, in a model, at an exposure lie."""
    return folder / view / picture_set(sun, model, exposure_ms)


def require_pictures(paths: Iterable[Path]) -> None:
    """Refuse to go on without one of them.

    Raises
    ------
    RoverError
        The first that is missing.
    """
    for path in paths:
        if not path.is_file():
            raise RoverError("the picture is missing", path=path)


def labels_folder(folder: Path, view: str, sun: str) -> Path:
    """Where the labels of a view under a Sun lie."""
    return folder / view / f"{sun}_labels"
