"""Which photo shows a view under a Sun lamp best."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import SUNS, WHITE_LEVEL, PositionCamera
from polarsim.progress import track
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import LocalisedRig

log = logging.getLogger("polarsim")

_USABLE = (60, WHITE_LEVEL - 200)  # grey values that neither noise nor clipping moves
_SPARSE = 8  # every so many rows and columns tell how well a photo is exposed
_LEAST_USABLE = 0.03  # share of such pixels in a photo that is worth a look
Pictures = Mapping[PositionCamera, Mapping[str, Path]]  # by view, then by the azimuth of the Sun lamp
Photos = Mapping[str, np.ndarray]  # of one view, by that azimuth: (h, w) float32 grey values


def best_pictures(terrain: int, photos: Path) -> Pictures:
    """The photo of every view and Sun lamp, rover light off, in which most pixels are well exposed.

    Parameters
    ----------
    photos : Path
        `photos.parquet`; a photo that cannot be read is a warning and left out.
    """
    best: dict[tuple[PositionCamera, str], tuple[float, Path]] = {}
    for key, path in track(sorted(pictures_at(photos).items()), f"photos of terrain {terrain:02d}"):
        if key.terrain != terrain or key.light == "on" or key.azimuth not in SUNS:
            continue
        try:
            sparse = png.read_photo(path)[::_SPARSE, ::_SPARSE]
        except PolarsimError as error:
            log.warning("%s: not used for the cameras", error)
            continue
        usable = float(((sparse > _USABLE[0]) & (sparse < _USABLE[1])).mean())
        group = ((key.position, key.camera), key.azimuth)
        if usable > max(_LEAST_USABLE, best[group][0] if group in best else 0.0):
            best[group] = usable, path
    pictures: dict[PositionCamera, dict[str, Path]] = {}
    for (view, azimuth), (_, path) in sorted(best.items()):
        pictures.setdefault(view, {})[azimuth] = path
    return pictures


def read_all_shrunk(
    pictures: Pictures, localised: Mapping[str, LocalisedRig], scale: float
) -> dict[PositionCamera, Photos]:
    """The photos of every view, by the azimuth of the Sun lamp, shrunk by a scale."""
    lenses = {(position, camera): localised[position].rig.lens(camera).scaled(scale) for position, camera in pictures}
    return {
        view: {azimuth: read_shrunk(path, lenses[view]) for azimuth, path in shown.items()}
        for view, shown in pictures.items()
    }


def read_shrunk(path: Path, lens: Lens) -> np.ndarray:
    """(h, w) float32 grey values of a photo, shrunk to the size of a lens."""
    import cv2

    shrunk = cv2.resize(png.read_photo(path), (lens.width, lens.height), interpolation=cv2.INTER_AREA)
    return np.asarray(shrunk, np.float32)
