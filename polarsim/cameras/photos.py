"""Rig poses, lenses and lamps refined on photos, in which meshes shaded under the Sun lamps are found again.

Scans place tripods to the millimetres and hundredths of a degree by which a scan was registered to its camera, and
nothing in the scans tells that error. Photos do.
"""

from __future__ import annotations

import logging
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.cameras.adjust import Adjusted, Priors, Sightings, adjust, offsets_px
from polarsim.cameras.lamps import Prior, Shot, refine_lamp, shots_of
from polarsim.cameras.options import CamerasOptions
from polarsim.cameras.rounding import rounded, rounded_figures, rounded_rig
from polarsim.cameras.shading import Surface, look, surface_of
from polarsim.formats import colmap, lamps
from polarsim.formats.best_photos import Photos, Pictures, best_pictures, read_all_shrunk
from polarsim.formats.files import writing_folder
from polarsim.formats.rigs import PlacedRig, read_all_placed, write_placed
from polarsim.formats.scene import read_terrain
from polarsim.geometry.patches import Window, find
from polarsim.geometry.poses import angle_between
from polarsim.photo import View
from polarsim.progress import track

log = logging.getLogger("polarsim")


def refine_cameras(
    *, terrain: int, located: Path, meshes: Path, photos: Path | None, cameras: Path, options: CamerasOptions
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
    start = read_all_placed(located)
    placed = start
    pictures = best_pictures(terrain, photos) if photos is not None and options.photo_scales else {}
    suns: dict[str, np.ndarray] = {}
    if found := {view for view in pictures if view[0] in placed and not placed[view[0]].surveyed}:
        name, surface = f"terrain {terrain:02d}", surface_of(read_terrain(meshes, terrain))
        placed, suns = _refined(name, placed, surface, {view: pictures[view] for view in found}, options)
    with writing_folder(cameras) as folder:
        for path in located.iterdir():
            if path.is_file():
                shutil.copyfile(path, folder / path.name)
        for position, rig in placed.items():
            if rig is not start[position]:
                write_placed(folder / f"Pos{position}.json", rig)
        if suns:
            lamps.write_suns(folder, suns)
        colmap.write_model(folder / "colmap", placed)


def _refined(
    name: str, located: dict[str, PlacedRig], surface: Surface, pictures: Pictures, options: CamerasOptions
) -> tuple[dict[str, PlacedRig], dict[str, np.ndarray]]:
    """Rigs and found lamps, in turn from coarse to fine.

    Rigs whose photos match the meshes are refined; the others get the adjusted lenses alone.
    """
    current = located
    surveyed = lamps.surveyed_suns(located)
    suns: dict[str, np.ndarray] = {}
    for scale in options.photo_scales:
        photos = read_all_shrunk(pictures, located, scale)
        seen = {
            (position, camera): _sightings(
                surface, current[position], camera, photos[position, camera], scale, surveyed | suns, options
            )
            for position, camera in track(sorted(photos), f"cameras of {name}, scale {scale:g}")
        }
        seen = _of_sure_positions(name, seen, options.photo_min_windows)
        if not seen:
            log.warning("%s: photos do not match the meshes, cameras stay as they were located", name)
            return located, {}
        sure = {position: located[position] for position, _ in seen}
        lenses = scale == options.photo_scales[-1]
        adjusted = adjust(sure, seen, _priors(options), options.photo_independent, lenses)
        rig = next(iter(adjusted.placed.values())).rig
        current = {position: replace(one, rig=rig) for position, one in located.items()} | adjusted.placed
        suns = _found_suns(name, shots_of(surface, adjusted.placed, photos, scale), surveyed, suns, options)
    for azimuth, place in suns.items():
        off_mm = 1000 * np.linalg.norm(place - surveyed[azimuth])
        log.info("%s: lamp %s stands %.0f mm from its survey", name, azimuth, off_mm)
    return {
        position: _described(position, located[position], adjusted, seen)
        if position in sure
        else replace(one, rig=rounded_rig(one.rig))
        for position, one in current.items()
    }, suns


def _sightings(
    surface: Surface,
    rig: PlacedRig,
    camera: str,
    photos: Photos,
    scale: float,
    suns: Mapping[str, np.ndarray],
    options: CamerasOptions,
) -> Sightings:
    """Where the photos of a view, shrunk by a scale, show points of the meshes, in pixels of the full photo."""
    seen = look(surface, rig.camera(camera).scaled(scale))
    window = _window(options)
    points, pixels, whitening = [], [], []
    for azimuth, photo in photos.items():
        found = find(seen.under(suns[azimuth]), photo, seen.met, window)
        column, row = found.pixel.astype(int).T
        points.append(seen.points[row, column].astype(float))
        pixels.append(found.seen / scale)
        whitening.append(found.whitening * scale)
    return Sightings(np.concatenate(points), np.concatenate(pixels), np.concatenate(whitening))


def _window(options: CamerasOptions) -> Window:
    return Window(
        options.photo_window_px // 2,
        options.photo_search_px,
        options.photo_step_px,
        options.photo_likeness,
        options.photo_noise,
    )


def _found_suns(
    name: str,
    shots: Mapping[str, list[Shot]],
    surveyed: Mapping[str, np.ndarray],
    found: Mapping[str, np.ndarray],
    options: CamerasOptions,
) -> dict[str, np.ndarray]:
    """The Sun lamps whose shadows photos show, where these say that they stood; a start is what was found before."""
    suns = {}
    for azimuth in track(sorted(shots), f"lamps of {name}"):
        prior = Prior(surveyed[azimuth], options.lamp_sd_mm / 1000)
        start = found.get(azimuth, prior.place)
        place = refine_lamp(start, prior, shots[azimuth], _window(options), options.photo_independent)
        if place is not None:
            suns[azimuth] = place
    return suns


def _of_sure_positions(name: str, seen: Mapping[View, Sightings], least: int) -> dict[View, Sightings]:
    """The sightings of the positions that have enough of them."""
    counts: dict[str, int] = {}
    for (position, _), found in seen.items():
        counts[position] = counts.get(position, 0) + len(found.pixels)
    for position, count in counts.items():
        if count < least:
            log.warning("%s, %s: %d windows of its photos match the meshes, no refinement", name, position, count)
    return {view: found for view, found in seen.items() if counts[view[0]] >= least}


def _priors(options: CamerasOptions) -> Priors:
    return Priors(
        pose_m=options.photo_pose_sd_mm / 1000,
        pose_rad=float(np.radians(options.photo_pose_sd_deg)),
        rig_m=options.rig_sd_mm / 1000,
        rig_rad=float(np.radians(options.rig_sd_deg)),
        focal_px=options.focal_sd_px,
        centre_px=options.centre_sd_px,
        k1=options.k1_sd,
    )


def _told_off_px(off: np.ndarray, found: Sightings) -> np.ndarray:
    """(n,) how far windows are off, (n, 2) px, along the direction that each tells best: across its edges."""
    return np.abs(np.einsum("nk,nk->n", np.linalg.eigh(found.whitening)[1][:, :, 1], off))


def _described(position: str, located: PlacedRig, adjusted: Adjusted, seen: Mapping[View, Sightings]) -> PlacedRig:
    """The adjusted rig with how well photos and meshes agree, before and now, and its formal standard deviations."""
    rig = adjusted.placed[position]
    own = {camera: found for (where, camera), found in seen.items() if where == position}
    before, now = (
        np.concatenate([_told_off_px(offsets_px(one, camera, found), found) for camera, found in own.items()])
        for one in (located, rig)
    )
    moved = located.sandbox_from_left.inverse() @ rig.sandbox_from_left
    sd = np.sqrt(np.diag(adjusted.covariance[position]))
    quality = {
        **located.quality,
        "windows": float(len(now)),
        "median_off_before_px": float(np.median(before)),
        "median_off_px": float(np.median(now)),
        "moved_mm": float(1000 * np.linalg.norm(moved.translation)),
        "turned_deg": float(np.degrees(angle_between(located.sandbox_from_left, rig.sandbox_from_left))),
        "sd_mm": float(1000 * np.linalg.norm(sd[3:])),
        "sd_deg": float(np.degrees(np.linalg.norm(sd[:3]))),
    }
    return PlacedRig(
        rounded_rig(rig.rig), rounded(rig.sandbox_from_left), f"{located.method}, photos", rounded_figures(quality)
    )
