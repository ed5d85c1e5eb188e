"""Refinement of rig poses, lenses and lamps: meshes shaded under the Sun lamps are matched with the photos.

The pose of a scan relative to its camera has errors of millimetres and hundredths of a degree that scans cannot reveal,
but photos can.
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

from polarsim.cameras.adjust import REPEATABILITY, Adjustment, MatchedPoints, Priors, adjust, offsets_px
from polarsim.cameras.features import localise_by_features
from polarsim.cameras.lamps import LampView, lamp_views, lamps_elsewhere, offset_text, refine_lamp
from polarsim.cameras.options import RefinementOptions
from polarsim.cameras.rounding import rounded, rounded_metrics, rounded_rig
from polarsim.cameras.shading import MeshSurface, cast_view, surface_of
from polarsim.cameras.wall_shadows import refine_by_wall_shadows
from polarsim.formats import colmap
from polarsim.formats.files import relative_to, writing_folder
from polarsim.geometry.patches import MatchingOptions, match_windows
from polarsim.geometry.poses import angle_between
from polarsim.photo import PositionCamera, Terrain, reduced_scale, terrain_text
from polarsim.progress import track
from polarsim.run_files import lamps
from polarsim.run_files.best_photos import BestPhotos, ViewPhotos, best_pictures, read_all_resized
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import STEREO, LocalisedRig, read_all_localised, write_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.run_files.walls import Walls, write_walls
from polarsim.site import Site

# Windows of 21 px of a shaded view, every 12 px, are matched within 5 px. Their correlation with the photo is at least
# 0.6, and the noise of their position is 0.4 of sqrt((1 - correlation) / second derivative of the correlation).
WINDOW = MatchingOptions(21 // 2, 5, 12, 0.6, 0.4)
MIN_WINDOWS = 200  # minimum number of matched windows for the refinement of a position
INDEPENDENT = 300  # maximum weight of a view, in windows: the errors of neighbouring windows are correlated
# Accuracy of registered scans relative to their cameras, standard deviations on each axis.
PRIORS = Priors(pose_m=0.003, pose_rad=float(np.radians(0.1)))
# Range maps from photos: relative poses and calibration are fitted to the same photos, by hundreds of windows.
# Meshes of these range maps resemble the photos less than scans do: on smooth sand, windows match by chance.
STEREO_PRIORS = Priors(0.001, float(np.radians(0.02)), replace(REPEATABILITY, focal_px=0.5, centre_px=0.3))
_REFINED = ", photos"  # end of the method of a refined rig
_MODEL_POINTS = 20_000  # maximum number of mesh vertices in a COLMAP model
log = logging.getLogger("polarsim")


def refine_cameras(
    *,
    site: Site,
    terrain: Terrain,
    located: Path,
    meshes: Path,
    photos: Path | None,
    cameras: Path,
    options: RefinementOptions,
    covers: Path | None = None,
    drawn: Path | None = None,
) -> None:
    """Write the folder `cameras`: the files of `located`, with poses, lenses and lamps refined on photos.

    Without photos (`photos.parquet`) that show the meshes, the poses are not changed. Walls that are missing in the
    scans are fitted to the shadows in the photos and written as `walls.json`.

    `covers`, `drawn`: folders of published photos and of the masks of their drawn lines; the walls are fitted to them
    if there are no own photos.
    """
    mesh = read_terrain(meshes, terrain, site.sandbox_of(terrain))
    localised = start = read_all_localised(located)
    pictures = best_pictures(terrain, photos) if photos is not None and options.scales else {}
    suns: dict[str, np.ndarray] = {}
    walls: Walls | None = None
    name = f"terrain {terrain_text(terrain)}"
    if photos is not None and options.scales and not pictures:
        log.warning("%s: no well exposed photo under a Sun lamp with the rover light off: poses, lamps and walls are "
                    "not refined", name)  # fmt: skip
    if any(view[0] in localised and not localised[view[0]].unproven for view in pictures):
        surface = surface_of(mesh)
        localised = _add_by_features(name, localised, surface, pictures)
        shown = {view: of for view, of in pictures.items() if view[0] in localised and not localised[view[0]].unproven}
        elsewhere = _lamps_elsewhere(site, terrain, localised, surface, shown, options)
        shown = {
            view: {azimuth: path for azimuth, path in of.items() if azimuth not in elsewhere}
            for view, of in shown.items()
            if set(of) - elsewhere
        }
        localised, suns = _refine(site, terrain, localised, surface, shown, options)
        if photos is not None:
            suns, walls = _refine_by_wall_shadows(site, terrain, mesh, photos, localised, suns, elsewhere)
    elif covers is not None and mesh.walls is not None:
        lamp_positions = lamps.surveyed_suns(localised, site, terrain)
        _, walls = refine_by_wall_shadows(name, terrain, mesh, covers, localised, lamp_positions, site, set(), drawn)
    with writing_folder(cameras) as folder:
        for path in located.iterdir():
            if path.is_file():
                shutil.copyfile(path, folder / path.name)
        for position, rig in localised.items():
            if rig is not start.get(position):
                write_localised(folder / f"Pos{position}.json", rig)
        if suns:
            lamps.write_suns(folder, suns)
        if walls is not None:
            write_walls(folder, walls)
        names = {} if photos is None else image_names(photos, cameras / "colmap", site.usual_exposure_ms)
        colmap.write_model(folder / "colmap", localised, names, model_points(mesh.vertices))


def image_names(photos: Path, folder: Path, usual_exposure_ms: int) -> dict[tuple[str, str], str]:
    """Return a Sun-lit photo of about the usual exposure for each position and camera, as a path from `folder`."""
    best: dict[tuple[str, str], tuple[Any, ...]] = {}
    for key, path in pictures_at(photos).items():
        rank = (not key.has_sun, key.light == "on", abs(math.log2(key.exposure_ms / usual_exposure_ms)), key)
        view = (key.position, key.camera)
        best[view] = min(best.get(view, (*rank, path)), (*rank, path))
    return {view: relative_to(ranked[-1], folder) for view, ranked in best.items()}


def model_points(vertices: np.ndarray) -> np.ndarray:
    """Return at most `_MODEL_POINTS` of the vertices (n, 3), evenly spaced in their list."""
    return np.asarray(vertices[:: max(1, math.ceil(len(vertices) / _MODEL_POINTS))], float)


def _add_by_features(
    name: str, located: dict[str, LocalisedRig], surface: MeshSurface, pictures: BestPhotos
) -> dict[str, LocalisedRig]:
    """Add rigs of positions whose photos share enough features with the localised positions."""
    sure = {position: one for position, one in located.items() if not one.unproven}
    unsure = {view[0] for view in pictures} - set(sure)
    return located | (localise_by_features(name, unsure, sure, surface, pictures) if unsure else {})


def _lamps_elsewhere(
    site: Site,
    terrain: Terrain,
    located: Mapping[str, LocalisedRig],
    surface: MeshSurface,
    pictures: BestPhotos,
    options: RefinementOptions,
) -> set[str]:
    """Return the azimuths whose photos show another lamp or another scene; log them in a warning."""
    scale = reduced_scale(options.scales[0], next(iter(located.values())).rig.left.width)
    left = {view: of for view, of in pictures.items() if view[1] == "L"}
    views = lamp_views(surface, located, read_all_resized(left, located, scale), scale)
    elsewhere = lamps_elsewhere(views, lamps.surveyed_suns(located, site, terrain), WINDOW)
    if elsewhere:
        shares = ", ".join(f"azimuth {azimuth} ({share:.0%})" for azimuth, share in elsewhere.items())
        log.warning("terrain %s: photos that show another lamp or scene are not used for poses, lamps and walls: %s of "
                    "the predicted shadow edges match", terrain_text(terrain), shares)  # fmt: skip
    return set(elsewhere)


def _refine(
    site: Site,
    terrain: Terrain,
    located: dict[str, LocalisedRig],
    surface: MeshSurface,
    pictures: BestPhotos,
    options: RefinementOptions,
) -> tuple[dict[str, LocalisedRig], dict[str, np.ndarray]]:
    """Refine rigs and lamps alternately, from coarse to fine.

    Rigs whose photos match the meshes are refined; the remaining rigs only get the adjusted lenses.
    """
    name, current = f"terrain {terrain_text(terrain)}", located
    surveyed = lamps.surveyed_suns(located, site, terrain)
    suns: dict[str, np.ndarray] = {}
    width = next(iter(located.values())).rig.left.width
    for of_usual_photos in options.scales:
        scale = reduced_scale(of_usual_photos, width)
        photos = read_all_resized(pictures, located, scale)
        matches = {
            (position, camera): _match_view(
                surface, current[position], camera, photos[position, camera], scale, surveyed | suns
            )
            for position, camera in track(sorted(photos), f"cameras of {name}, scale {scale:g}")
        }
        matches = _with_enough_windows(name, matches)
        if not matches:
            log.warning("%s: the photos do not match the meshes, the poses are not refined", name)
            return located, {}
        reliable = {position: located[position] for position, _ in matches}
        lenses = of_usual_photos == options.scales[-1]
        adjusted = adjust(reliable, matches, _priors(reliable), INDEPENDENT, lenses)
        rig = next(iter(adjusted.localised.values())).rig
        current = {position: replace(one, rig=rig) for position, one in located.items()} | adjusted.localised
        suns = _refine_suns(name, lamp_views(surface, adjusted.localised, photos, scale), surveyed, suns)
    for azimuth, lamp in suns.items():
        log.info("%s: lamp %s is %s from its survey", name, azimuth, offset_text(lamp, surveyed[azimuth]))
    return {
        position: _describe(position, located[position], adjusted, matches)
        if position in reliable
        else replace(one, rig=rounded_rig(one.rig))
        for position, one in current.items()
    }, suns


def _priors(located: Mapping[str, LocalisedRig]) -> Priors:
    """Return the accuracy of poses and calibration before the refinement."""
    return STEREO_PRIORS if all(one.method == STEREO for one in located.values()) else PRIORS


def _match_view(
    surface: MeshSurface,
    rig: LocalisedRig,
    camera: str,
    photos: ViewPhotos,
    scale: float,
    suns: Mapping[str, np.ndarray],
) -> MatchedPoints:
    """Match mesh points with the photos of a view, shrunk by a scale; return pixels of the full photo."""
    hits = cast_view(surface, rig.camera(camera).scaled(scale))
    points, pixels, whitening = [], [], []
    for azimuth, photo in photos.items():
        windows = match_windows(hits.shade(suns[azimuth]), photo, hits.hit, WINDOW)
        column, row = windows.pixel.astype(int).T
        points.append(hits.points[row, column].astype(float))
        pixels.append(windows.seen / scale)
        whitening.append(windows.whitening * scale)
    return MatchedPoints(np.concatenate(points), np.concatenate(pixels), np.concatenate(whitening))


def _refine_suns(
    name: str,
    views: Mapping[str, list[LampView]],
    surveyed: Mapping[str, np.ndarray],
    previous: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """Return refined positions of the Sun lamps with enough visible shadows, starting from previous positions."""
    suns = {}
    for azimuth in track(sorted(views), f"lamps of {name}"):
        start = previous.get(azimuth, surveyed[azimuth])
        lamp = refine_lamp(start, surveyed[azimuth], views[azimuth], WINDOW, INDEPENDENT)
        if lamp is not None:
            suns[azimuth] = lamp
    return suns


def _refine_by_wall_shadows(
    site: Site,
    terrain: Terrain,
    mesh: TerrainMesh,
    photos: Path,
    localised: Mapping[str, LocalisedRig],
    suns: dict[str, np.ndarray],
    elsewhere: set[str],
) -> tuple[dict[str, np.ndarray], Walls | None]:
    """Return lamps and walls (None: unchanged) fitted to the shadow edges of walls in photos of refined rigs.

    `elsewhere`: azimuths whose photos show another lamp.
    """
    refined = {position: rig for position, rig in localised.items() if rig.method.endswith(_REFINED)}
    if not refined or mesh.walls is None:
        return suns, None
    surveyed = lamps.surveyed_suns(localised, site, terrain)
    known = {azimuth: lamp for azimuth, lamp in (surveyed | suns).items() if azimuth not in elsewhere}
    name = f"terrain {terrain_text(terrain)}"
    moved, walls = refine_by_wall_shadows(name, terrain, mesh, photos, refined, known, site, set(suns))
    return {**suns, **moved}, walls


def _with_enough_windows(
    name: str, matches: Mapping[PositionCamera, MatchedPoints]
) -> dict[PositionCamera, MatchedPoints]:
    """Select the matched points of positions with enough of them."""
    counts: Counter[str] = Counter()
    for (position, _), points in matches.items():
        counts[position] += len(points.pixels)
    for position, count in counts.items():
        if count < MIN_WINDOWS:
            log.warning("%s, %s: only %d windows of its photos match the meshes, no refinement", name, position, count)
    return {view: points for view, points in matches.items() if counts[view[0]] >= MIN_WINDOWS}


def _offset_px(off: np.ndarray, points: MatchedPoints) -> np.ndarray:
    """Return the offsets (n,) of windows, (n, 2) px, along the direction with the smallest error: across edges."""
    return np.abs(np.einsum("nk,nk->n", np.linalg.eigh(points.whitening)[1][:, :, 1], off))


def _describe(
    position: str, located: LocalisedRig, adjusted: Adjustment, matches: Mapping[PositionCamera, MatchedPoints]
) -> LocalisedRig:
    """Return the adjusted rig with offsets between photos and meshes before and after, and its standard deviations."""
    rig = adjusted.localised[position]
    points = {camera: part for (where, camera), part in matches.items() if where == position}
    before, now = (
        np.concatenate([_offset_px(offsets_px(current, camera, part), part) for camera, part in points.items()])
        for current in (located, rig)
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
        rounded_rig(rig.rig), rounded(rig.sandbox_from_left), f"{located.method}{_REFINED}", rounded_metrics(metrics)
    )
