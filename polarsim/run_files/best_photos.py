"""Selection of the best exposed photo of each view and Sun lamp."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import WHITE_LEVEL, PhotoKey, PositionCamera, Terrain, terrain_text
from polarsim.progress import track
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import LocalisedRig

log = logging.getLogger("polarsim")

_USABLE = (60, WHITE_LEVEL - 200)  # range of grey values with low noise and without clipping
_SPARSE = 8  # step between sampled rows and columns
_MIN_USABLE = 0.03  # minimum share of usable pixels
BestPhotos = Mapping[PositionCamera, Mapping[str, Path]]  # by view, then by the azimuth of the Sun lamp
ViewPhotos = Mapping[str, np.ndarray]  # of a view, by the azimuth of the Sun lamp: (h, w) float32 grey values


def best_pictures(terrain: Terrain, photos: Path) -> BestPhotos:
    """Return the photo with the largest share of well exposed pixels of every view and Sun lamp, rover light off.

    Parameters
    ----------
    photos : Path
        `photos.parquet`. Unreadable photos, and views and lamps without a well exposed photo, are skipped with a
        warning.
    """
    best: dict[tuple[PositionCamera, str], tuple[float, Path]] = {}
    badly_exposed: dict[tuple[PositionCamera, str], PhotoKey] = {}  # a photo of each view and lamp without a better one
    for key, path in track(sorted(pictures_at(photos).items()), f"photos of terrain {terrain_text(terrain)}"):
        if key.terrain != terrain or key.light == "on" or not key.has_sun:
            continue
        try:
            sparse = png.read_photo(path, None)[::_SPARSE, ::_SPARSE]
        except PolarsimError as error:
            log.warning("%s: not used for the cameras", error)
            continue
        usable = float(((sparse > _USABLE[0]) & (sparse < _USABLE[1])).mean())
        group = ((key.position, key.camera), key.azimuth)
        if usable > max(_MIN_USABLE, best[group][0] if group in best else 0.0):
            best[group] = usable, path
        badly_exposed.setdefault(group, key)
    badly_exposed = {group: key for group, key in badly_exposed.items() if group not in best}
    if badly_exposed:
        log.warning(
            "terrain %s: %d of %d views under a Sun lamp have only dark or saturated photos, %s for example: not used "
            "for the cameras", terrain_text(terrain), len(badly_exposed), len(badly_exposed) + len(best),
            min(badly_exposed.values()),
        )  # fmt: skip
    pictures: dict[PositionCamera, dict[str, Path]] = {}
    for (view, azimuth), (_, path) in sorted(best.items()):
        pictures.setdefault(view, {})[azimuth] = path
    return pictures


def read_all_resized(
    pictures: BestPhotos, localised: Mapping[str, LocalisedRig], scale: float
) -> dict[PositionCamera, ViewPhotos]:
    """Read the photos of every view by the azimuth of the Sun lamp, resized by a factor."""
    lenses = {(position, camera): localised[position].rig.lens(camera) for position, camera in pictures}
    return {
        view: {azimuth: read_resized(path, lenses[view], scale) for azimuth, path in by_azimuth.items()}
        for view, by_azimuth in pictures.items()
    }


def read_resized(path: Path, lens: Lens, scale: float) -> np.ndarray:
    """Read the grey values (h, w) float32 of a photo of a lens, resized by a factor."""
    import cv2

    photo, small = png.read_photo(path, (lens.width, lens.height)), lens.scaled(scale)
    shrunk = cv2.resize(photo, (small.width, small.height), interpolation=cv2.INTER_AREA)
    return np.asarray(shrunk, np.float32)
