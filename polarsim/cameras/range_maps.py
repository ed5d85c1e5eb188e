"""Range maps of a terrain without scans, from the stereo photos of each position.

1. self_calibration: epipolar lines of features correct the stereo calibration.
2. disparities: left and right photos under all Sun lamps are matched.
3. scans: the range maps are registered as if they were scans.
4. crossings, self_calibration: the same ground in the range maps of two positions corrects calibration and poses.
5. disparities: the photos are matched again with the corrected calibration, at full resolution.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from polarsim.cameras.crossings import find_crossing
from polarsim.cameras.disparities import FULL, HALF, RangePoints, StereoPhotos, measure_points
from polarsim.cameras.rounding import rounded, rounded_rig
from polarsim.cameras.scans import register_scans
from polarsim.cameras.search_area import SearchArea
from polarsim.cameras.self_calibration import StereoPixels, correct_calibration
from polarsim.errors import ReconstructionError, RegistrationError
from polarsim.formats import nasa, png
from polarsim.formats.files import writing_folder
from polarsim.geometry.features import match_features, sift_features
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig, epipolar_distances, rectified_left, triangulated_depth
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, Terrain, photo_scale, terrain_text
from polarsim.progress import track
from polarsim.run_files.best_photos import BestPhotos, best_pictures
from polarsim.run_files.inventory import read_inventory, write_inventory
from polarsim.run_files.rigs import STEREO, LocalisedRig, read_rig, write_localised, write_rig
from polarsim.run_files.survey import surveyed_poses
from polarsim.site import Site
from polarsim.tone import to_uint8

log = logging.getLogger("polarsim")
MIN_MATCHED = 0.15  # minimum share of the pixels of a left photo that match the right photo; 0.65 to 0.75 is usual
# Minimum number of features that match, and their minimum share of all matches. On the analog there are 5000 to 7400
# at a position under four Suns, 99 % of all matches.
MIN_FEATURES, MIN_FEATURE_SHARE = 100, 0.5
MIN_CROSSINGS = 40  # minimum number of matched windows of two positions
REACHES = (0.15, 0.04)  # maximum displacement of matched orthophotos in each round, metres
_CONSEQUENCES = (  # of a round without matched windows
    "; only epipolar lines correct the calibration, and distances may be off by 1%",
    " with the corrected calibration; the range maps are registered like scans",
)
_CLIPPED = WHITE_LEVEL - 100  # grey values that may be clipped
_FEATURE_SCALE, _MAX_FEATURES = 0.5, 4000
_MAX_EPIPOLAR_PX = 6.0  # from the epipolar line of the uncorrected calibration, photos of the reference width
_DEPTH_MARGINS_M = (0.2, 1.0)  # of matched features around the range of depths


def measure_ranges(
    *,
    site: Site,
    terrain: Terrain,
    photos: Path,
    calibration: Path,
    inventory: Path,
    corrected: Path,
    measured: Path,
    maps: Path,
) -> None:
    """Write a range map per position to the folder `maps`, the corrected calibration, and an inventory with the maps.

    If positions show the same ground, `maps` also contains their poses, in a nearly level frame with any heading.

    Positions without pairs of photos that match are skipped with a warning.

    Raises
    ------
    ReconstructionError
        No position has left and right photos of the same scene under a Sun lamp.
    """
    rig, area = read_rig(calibration), SearchArea.of(site, terrain)
    pictures = best_pictures(terrain, photos)
    pairs = _read_pairs(terrain, pictures, rig)
    if not pairs:
        raise ReconstructionError(
            "no position has a well exposed left and right photo under the same Sun lamp, with the rover light off",
            path=photos,
        )
    features = {position: _matched_features(pictures, position, rig, area) for position in pairs}
    for position in [position for position, pixels in features.items() if not len(pixels.left)]:
        log.warning(
            "terrain %s, position %s: left and right photos share too few features, no range map: check that they "
            "show the same scene", terrain_text(terrain), position,
        )  # fmt: skip
        del features[position], pairs[position]
    by_features, _ = correct_calibration(rig, list(features.values()), {}, {})
    seen = _measure(terrain, pairs, by_features, area)
    if not seen:
        raise ReconstructionError(
            "no range map: left and right photos do not match, check that they show the same scene", path=photos
        )
    pairs = {position: pairs[position] for position in seen}
    features = {position: features[position] for position in seen}
    final, poses = _calibrated_by_ground(site, terrain, rig, by_features, pairs, features, seen, area)
    final = rounded_rig(final)
    grid = rectified_left(final)
    paths = {}
    with writing_folder(maps) as folder:
        for position in track(sorted(pairs), f"range maps of terrain {terrain_text(terrain)}"):
            points = measure_points(pairs[position], final, [HALF, FULL], area.depths).points_left
            path = nasa.range_map_path(folder, position)
            nasa.write_range_map(path, grid.left_from_rectified.inverse().apply(points))
            paths[position] = (maps / path.name).as_posix()
        for position, pose in sorted(poses.items()):
            write_localised(folder / f"Pos{position}.json", LocalisedRig(final, rounded(pose), STEREO))
    write_rig(corrected, final, "photos")
    write_inventory(measured, replace(read_inventory(inventory), range_maps=paths, clouds={}))


def _read_pairs(terrain: Terrain, pictures: BestPhotos, rig: StereoRig) -> dict[str, StereoPhotos]:
    """Return the photos of each position under the lamps of which left and right photos exist."""
    pairs = {}
    for position in sorted({view[0] for view in pictures}):
        left, right = (pictures.get((position, camera), {}) for camera in "LR")
        azimuths = sorted(set(left) & set(right))
        if not azimuths:
            log.warning(
                "terrain %s, position %s: no left and right photo of a Sun lamp", terrain_text(terrain), position
            )
            continue
        pairs[position] = StereoPhotos(
            [_light(left[azimuth], rig.left) for azimuth in azimuths],
            [_light(right[azimuth], rig.right) for azimuth in azimuths],
        )
    if single := [position for position, photos in pairs.items() if len(photos.left) == 1]:
        log.warning("terrain %s: photos under a single Sun lamp at %s, ground in shadow is not measured",
                    terrain_text(terrain), ", ".join(single))  # fmt: skip
    return pairs


def _light(path: Path, lens: Lens) -> np.ndarray:
    """Read a photo as light above black (h, w) float32, NaN where it may be clipped."""
    grey = png.read_photo(path, (lens.width, lens.height)).astype(np.float32)
    return np.where(grey < _CLIPPED, np.maximum(grey - BLACK_LEVEL, 0), np.nan).astype(np.float32)


def _matched_features(pictures: BestPhotos, position: str, rig: StereoRig, area: SearchArea) -> StereoPixels:
    """Match features of left and right photos of a position under each Sun lamp."""
    import cv2

    left, right = [np.empty((0, 2))], [np.empty((0, 2))]
    for azimuth in sorted(set(pictures[position, "L"]) & set(pictures[position, "R"])):
        found = []
        for camera in "LR":
            lens = rig.lens(camera)
            grey = to_uint8(png.read_photo(pictures[position, camera][azimuth], (lens.width, lens.height)))
            small = cv2.resize(grey, None, fx=_FEATURE_SCALE, fy=_FEATURE_SCALE, interpolation=cv2.INTER_AREA)
            found.append(sift_features(small, _MAX_FEATURES))
        first, second = match_features(*found)
        left.append(found[0].pixels[first] / _FEATURE_SCALE)
        right.append(found[1].pixels[second] / _FEATURE_SCALE)
    return possible_matches(rig, StereoPixels(np.concatenate(left), np.concatenate(right)), area.depths)


def possible_matches(rig: StereoRig, pixels: StereoPixels, depths: tuple[float, float]) -> StereoPixels:
    """Select the matches near epipolar lines and at depths of the sandbox; none if most matches contradict the rig.

    Of the matches of photos of different scenes, few are near epipolar lines.
    """
    depth = triangulated_depth(rig, pixels.left, pixels.right)
    likely = (depth > depths[0] - _DEPTH_MARGINS_M[0]) & (depth < depths[1] + _DEPTH_MARGINS_M[1])
    likely &= epipolar_distances(rig, pixels.left, pixels.right) < _MAX_EPIPOLAR_PX * photo_scale(rig.left.width)
    if likely.sum() < max(MIN_FEATURES, MIN_FEATURE_SHARE * len(likely)):
        likely[:] = False
    return StereoPixels(pixels.left[likely], pixels.right[likely])


def _measure(
    terrain: Terrain, pairs: Mapping[str, StereoPhotos], rig: StereoRig, area: SearchArea
) -> dict[str, RangePoints]:
    """Return the points of each position whose photos match."""
    seen = {}
    for position, photos in pairs.items():
        measured = measure_points(photos, rig, [HALF], area.depths)
        share = float(np.isfinite(measured.points_left[..., 2]).mean())
        if share < MIN_MATCHED:
            log.warning(
                "terrain %s, position %s: left and right photos match at %.0f%% of the pixels, %.0f%% needed: "
                "no range map", terrain_text(terrain), position, 100 * share, 100 * MIN_MATCHED,
            )  # fmt: skip
            continue
        seen[position] = measured
    return seen


def _calibrated_by_ground(
    site: Site,
    terrain: Terrain,
    stated: StereoRig,
    rig: StereoRig,
    pairs: Mapping[str, StereoPhotos],
    features: Mapping[str, StereoPixels],
    seen: Mapping[str, RangePoints],
    area: SearchArea,
) -> tuple[StereoRig, Mapping[str, Pose]]:
    """Return rig and `level_from_left` of positions, corrected by ground that pairs of positions measure.

    Without such ground, return the rig of the round before and no poses.
    """
    poses = _registered(site, terrain, seen, area)
    for number, reach in enumerate(REACHES):
        if number:
            seen = {position: measure_points(pairs[position], rig, [HALF], area.depths) for position in seen}
            if len(poses) < len(seen):  # errors of the calibration bend the ground, so that registration refuses it
                again = _registered(site, terrain, seen, area)
                poses = again if len(again) > len(poses) else poses
        crossings = {}
        for pair in combinations(sorted(poses), 2):
            crossing = find_crossing(seen, pair, rig, poses, reach, area.half)
            if len(crossing.fixed.left) >= MIN_CROSSINGS:
                crossings[pair] = crossing
        if not crossings:
            log.warning(
                "terrain %s: no two positions show the same ground%s", terrain_text(terrain), _CONSEQUENCES[number]
            )
            return rig, {}
        rig, poses = correct_calibration(stated, list(features.values()), crossings, poses)
        rig, poses = rounded_rig(rig), {position: rounded(pose) for position, pose in poses.items()}
        for pair, crossing in crossings.items():
            log.info(
                "terrain %s: %d windows of positions %s and %s match",
                terrain_text(terrain),
                len(crossing.fixed.left),
                *pair,
            )
    return rig, poses


def _registered(site: Site, terrain: Terrain, seen: Mapping[str, RangePoints], area: SearchArea) -> dict[str, Pose]:
    """Return `level_from_left` of the positions whose range maps show the same terrain."""
    scans = {name: points.points_left[np.isfinite(points.points_left[..., 2])] for name, points in seen.items()}
    try:
        network = register_scans(scans, surveyed_poses(site.tripods_of(terrain)), area)
    except RegistrationError as error:
        log.warning("terrain %s: %s", terrain_text(terrain), error.reason)
        return {}
    for refusal in network.refused:
        log.warning("terrain %s: %s", terrain_text(terrain), refusal.reason)
    # The last bits of a registration depend on the memory layout; matching would amplify them.
    return {position: rounded(pose) for position, pose in network.level_from_left.items()}
