"""Photos of the ground of a terrain with poses and lamps: merged own photos, or published cover photos."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.formats import png
from polarsim.photo import Bracket, PhotoKey, Terrain, terrain_text
from polarsim.relief.heights import PhotoView
from polarsim.render.fitting.exposures import merge_exposures
from polarsim.run_files.lamps import read_suns
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import read_all_localised
from polarsim.site import Site

log = logging.getLogger("polarsim")
BRIGHTEST_GREY = 250  # grey values of covers above it may be clipped
MIN_USABLE = 0.2  # minimum share of pixels that are neither clipped nor black in all exposures


def read_ground_photos(site: Site, terrain: Terrain, photos: Path, cameras: Path) -> list[PhotoView]:
    """Return a view for each position, camera and Sun lamp of a terrain, from photos without rover light.

    All exposures of 12-bit photos are merged (`merge_exposures`). Photos with 8 bits have an unknown tone curve; one
    exposure of each view and lamp is used. Unreadable, saturated and black photos are excluded with a warning, as are
    photos from positions without a confirmed pose.

    Parameters
    ----------
    photos : Path
        Table of photos, or folder of images with keys as names.
    cameras : Path
        Folder of the rig poses and lamps of the terrain.
    """
    rigs = read_all_localised(cameras)
    proven = {position: rig for position, rig in rigs.items() if not rig.unproven}
    if not site.options(terrain).surveyed:
        log.warning("terrain %s: its lamps were not surveyed, no photo is used for the ground", terrain_text(terrain))
        return []
    lamps = read_suns(cameras, rigs, site, terrain)
    brackets: dict[Bracket, list[tuple[PhotoKey, Path]]] = {}
    for key, path in sorted(pictures_at(photos).items()):
        if key.terrain == terrain and key.light == "off" and key.azimuth in lamps and key.position in proven:
            brackets.setdefault(key.bracket, []).append((key, path))
    views = []
    for bracket in brackets.values():
        key = bracket[0][0]
        try:
            picture, linear = _picture([path for _, path in bracket], [key.exposure_ms for key, _ in bracket])
        except PolarsimError as error:
            log.warning("%s: not used for the ground", error)
            continue
        usable = float(np.isfinite(picture).mean())
        if usable < MIN_USABLE:
            log.warning("%s: not used for the ground, only %.0f%% of the pixels are well exposed", key, 100 * usable)
            continue
        camera = proven[key.position].camera(key.camera)
        if picture.shape != camera.lens.shape:
            log.warning("%s: not used for the ground, it is %d x %d px", key, *picture.shape[::-1])
            continue
        views.append(PhotoView(key, picture, camera, lamps[key.azimuth], linear))
    return views


def _picture(paths: Sequence[Path], exposures_ms: Sequence[int]) -> tuple[np.ndarray, bool]:
    """Return a picture (h, w) float32, NaN where clipped or black, and whether it is linear."""
    first = png.read_png(paths[-1])
    if first.dtype == np.uint8:
        grey = first if first.ndim == 2 else first[..., 0]
        return np.where(grey > BRIGHTEST_GREY, np.nan, grey.astype(np.float32)), False
    size = first.shape[1], first.shape[0]
    merged = merge_exposures((png.read_photo(path, size), time) for path, time in zip(paths, exposures_ms, strict=True))
    assert merged is not None
    return np.where(np.isfinite(merged.variance), merged.rate, np.nan).astype(np.float32), True
