"""Rig poses, lenses and lamps refined on photos, in which meshes shaded under the Sun lamps are found again.

Scans localise tripods to the millimetres and hundredths of a degree by which a scan was registered to its camera, and
nothing in the scans tells that error. Photos do.
"""

from __future__ import annotations

import logging
import math
import shutil
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.cameras.adjust import Adjusted, Priors, Sightings, adjust, offsets_px
from polarsim.cameras.features import localise_by_features
from polarsim.cameras.lamps import Shot, refine_lamp, shots_of
from polarsim.cameras.options import RefinementOptions
from polarsim.cameras.rounding import rounded, rounded_metrics, rounded_rig
from polarsim.cameras.shading import Surface, look, surface_of
from polarsim.formats import colmap
from polarsim.formats.files import relative_to, writing_folder
from polarsim.geometry.patches import Window, find
from polarsim.geometry.poses import angle_between
from polarsim.photo import USUAL_EXPOSURE_MS, PositionCamera
from polarsim.progress import track
from polarsim.run_files import lamps
from polarsim.run_files.best_photos import Photos, Pictures, best_pictures, read_all_shrunk
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import LocalisedRig, read_all_localised, write_localised
from polarsim.run_files.scene import read_terrain

# Windows of 21 px of a shaded view are looked for up to 5 px away, one every 12 px; their correlation with the photo is
# at least 0.6, and the noise of their position 0.4 of sqrt((1 - correlation) / bend of the correlation).
WINDOW = Window(21 // 2, 5, 12, 0.6, 0.4)
MIN_WINDOWS = 200  # positions with fewer windows found stay as located
INDEPENDENT = 300  # windows of a view that at most count: neighbours err alike
# What scans and the calibration are worth: how far registered scans stand off their cameras, and the calibration's
# repeatability. Metres, radians and pixels, standard deviations on each axis.
PRIORS = Priors(
    pose_m=0.003, pose_rad=float(np.radians(0.1)), rig_m=0.0005, rig_rad=float(np.radians(0.02)),
    focal_px=1.5, centre_px=1.5, k1=0.003,
)  # fmt: skip
_MODEL_POINTS = 20_000  # of the meshes in a COLMAP model
log = logging.getLogger("polarsim")


def refine_cameras(
    *, terrain: int, located: Path, meshes: Path, photos: Path | None, cameras: Path, options: RefinementOptions
) -> None:
    """Write the folder `cameras` anew: what `located` holds, poses, lenses and lamps refined where photos allow it.

    Parameters
    ----------
    located : Path
        Folder that `locate_cameras` wrote.
    meshes : Path
        The terrain's meshes, in the frame of these poses.
    photos : Path or None
        `photos.parquet`; without it, or without photos that show the meshes, everything stays as it was located.

    Raises
    ------
    FormatError
        A mesh, pose or table is missing or broken.
    """
    localised = start = read_all_localised(located)
    pictures = best_pictures(terrain, photos) if photos is not None and options.scales else {}
    suns: dict[str, np.ndarray] = {}
    if any(view[0] in localised and not localised[view[0]].unproven for view in pictures):
        name, surface = f"terrain {terrain:02d}", surface_of(read_terrain(meshes, terrain))
        localised = _with_features(name, localised, surface, pictures)
        shown = {view: of for view, of in pictures.items() if view[0] in localised and not localised[view[0]].unproven}
        localised, suns = _refined(name, localised, surface, shown, options)
    with writing_folder(cameras) as folder:
        for path in located.iterdir():
            if path.is_file():
                shutil.copyfile(path, folder / path.name)
        for position, rig in localised.items():
            if rig is not start.get(position):
                write_localised(folder / f"Pos{position}.json", rig)
        if suns:
            lamps.write_suns(folder, suns)
        names = {} if photos is None else image_names(photos, cameras / "colmap")
        colmap.write_model(folder / "colmap", localised, names, model_points(read_terrain(meshes, terrain).vertices))


def image_names(photos: Path, folder: Path) -> dict[tuple[str, str], str]:
    """A Sun-lit photo of about the usual exposure by position and camera, as a model's folder names it."""
    best: dict[tuple[str, str], tuple[Any, ...]] = {}
    for key, path in pictures_at(photos).items():
        rank = (key.azimuth == "no", key.light == "on", abs(math.log2(key.exposure_ms / USUAL_EXPOSURE_MS)), key)
        view = (key.position, key.camera)
        best[view] = min(best.get(view, (*rank, path)), (*rank, path))
    return {view: relative_to(ranked[-1], folder) for view, ranked in best.items()}


def model_points(vertices: np.ndarray) -> np.ndarray:
    """At most `_MODEL_POINTS` of the vertices (n, 3), evenly through their list."""
    return np.asarray(vertices[:: max(1, math.ceil(len(vertices) / _MODEL_POINTS))], float)


def _with_features(
    name: str, located: dict[str, LocalisedRig], surface: Surface, pictures: Pictures
) -> dict[str, LocalisedRig]:
    """The rigs, and those of further positions whose photos share enough with theirs."""
    sure = {position: one for position, one in located.items() if not one.unproven}
    unsure = {view[0] for view in pictures} - set(sure)
    return located | (localise_by_features(name, unsure, sure, surface, pictures) if unsure else {})


def _refined(
    name: str, located: dict[str, LocalisedRig], surface: Surface, pictures: Pictures, options: RefinementOptions
) -> tuple[dict[str, LocalisedRig], dict[str, np.ndarray]]:
    """Rigs and found lamps, in turn from coarse to fine.

    Rigs whose photos match the meshes are refined; the others get the adjusted lenses alone.
    """
    current = located
    surveyed = lamps.surveyed_suns(located)
    suns: dict[str, np.ndarray] = {}
    for scale in options.scales:
        photos = read_all_shrunk(pictures, located, scale)
        seen = {
            (position, camera): _sightings(
                surface, current[position], camera, photos[position, camera], scale, surveyed | suns
            )
            for position, camera in track(sorted(photos), f"cameras of {name}, scale {scale:g}")
        }
        seen = _of_sure_positions(name, seen)
        if not seen:
            log.warning("%s: photos do not match the meshes, cameras stay as they were located", name)
            return located, {}
        sure = {position: located[position] for position, _ in seen}
        lenses = scale == options.scales[-1]
        adjusted = adjust(sure, seen, PRIORS, INDEPENDENT, lenses)
        rig = next(iter(adjusted.localised.values())).rig
        current = {position: replace(one, rig=rig) for position, one in located.items()} | adjusted.localised
        suns = _found_suns(name, shots_of(surface, adjusted.localised, photos, scale), surveyed, suns)
    for azimuth, lamp in suns.items():
        off_mm = 1000 * np.linalg.norm(lamp - surveyed[azimuth])
        log.info("%s: lamp %s stands %.0f mm from its survey", name, azimuth, off_mm)
    return {
        position: _described(position, located[position], adjusted, seen)
        if position in sure
        else replace(one, rig=rounded_rig(one.rig))
        for position, one in current.items()
    }, suns


def _sightings(
    surface: Surface, rig: LocalisedRig, camera: str, photos: Photos, scale: float, suns: Mapping[str, np.ndarray]
) -> Sightings:
    """Where the photos of a view, shrunk by a scale, show points of the meshes, in pixels of the full photo."""
    seen = look(surface, rig.camera(camera).scaled(scale))
    points, pixels, whitening = [], [], []
    for azimuth, photo in photos.items():
        found = find(seen.under(suns[azimuth]), photo, seen.hit, WINDOW)
        column, row = found.pixel.astype(int).T
        points.append(seen.points[row, column].astype(float))
        pixels.append(found.seen / scale)
        whitening.append(found.whitening * scale)
    return Sightings(np.concatenate(points), np.concatenate(pixels), np.concatenate(whitening))


def _found_suns(
    name: str, shots: Mapping[str, list[Shot]], surveyed: Mapping[str, np.ndarray], found: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """The Sun lamps whose shadows photos show, where these say that they stood; a start is what was found before."""
    suns = {}
    for azimuth in track(sorted(shots), f"lamps of {name}"):
        start = found.get(azimuth, surveyed[azimuth])
        lamp = refine_lamp(start, surveyed[azimuth], shots[azimuth], WINDOW, INDEPENDENT)
        if lamp is not None:
            suns[azimuth] = lamp
    return suns


def _of_sure_positions(name: str, seen: Mapping[PositionCamera, Sightings]) -> dict[PositionCamera, Sightings]:
    """The sightings of the positions that have enough of them."""
    counts: Counter[str] = Counter()
    for (position, _), found in seen.items():
        counts[position] += len(found.pixels)
    for position, count in counts.items():
        if count < MIN_WINDOWS:
            log.warning("%s, %s: %d windows of its photos match the meshes, no refinement", name, position, count)
    return {view: found for view, found in seen.items() if counts[view[0]] >= MIN_WINDOWS}


def _offset_px(off: np.ndarray, found: Sightings) -> np.ndarray:
    """(n,) how far windows are off, (n, 2) px, along the direction that each tells best: across its edges."""
    return np.abs(np.einsum("nk,nk->n", np.linalg.eigh(found.whitening)[1][:, :, 1], off))


def _described(
    position: str, located: LocalisedRig, adjusted: Adjusted, seen: Mapping[PositionCamera, Sightings]
) -> LocalisedRig:
    """The adjusted rig with how well photos and meshes agree, before and now, and its formal standard deviations."""
    rig = adjusted.localised[position]
    own = {camera: found for (where, camera), found in seen.items() if where == position}
    before, now = (
        np.concatenate([_offset_px(offsets_px(one, camera, found), found) for camera, found in own.items()])
        for one in (located, rig)
    )
    moved = located.sandbox_from_left.inverse() @ rig.sandbox_from_left
    sd = np.sqrt(np.diag(adjusted.covariance[position]))
    metrics = {
        **located.metrics,
        "windows": float(len(now)),
        "median_off_before_px": float(np.median(before)),
        "median_off_px": float(np.median(now)),
        "moved_mm": float(1000 * np.linalg.norm(moved.translation)),
        "rotated_deg": float(np.degrees(angle_between(located.sandbox_from_left, rig.sandbox_from_left))),
        "sd_mm": float(1000 * np.linalg.norm(sd[3:])),
        "sd_deg": float(np.degrees(np.linalg.norm(sd[:3]))),
    }
    return LocalisedRig(
        rounded_rig(rig.rig), rounded(rig.sandbox_from_left), f"{located.method}, photos", rounded_metrics(metrics)
    )
