"""Localisation of rigs without scans and labels, by photo features shared with localised positions.

Terrain 13 was photographed from seven positions within decimetres, and only three of them were scanned. Photos from
nearly the same place under the same lamp show the same texture. Their SIFT features (Lowe, IJCV 60 (2004) 91) are
matched, features of the localised photo are projected onto the meshes, and the pose is estimated from these points
(P3P within RANSAC, then least squares). Between distant positions, such as A and C, too few features match.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

import numpy as np

from polarsim.cameras.rounding import rounded, rounded_metrics
from polarsim.cameras.shading import MeshSurface
from polarsim.geometry.camera import Camera
from polarsim.geometry.features import Features, match_features, sift_features
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.run_files.best_photos import BestPhotos, ViewPhotos, read_resized
from polarsim.run_files.rigs import FEATURES, LocalisedRig
from polarsim.tone import to_uint8

FEATURE_SCALE = 0.5  # of the photos in which features are detected
_MAX_FEATURES = 6000  # maximum number of features of a photo
_MAX_REPROJECTION_PX = 2.0  # maximum reprojection error of an inlier, pixels of the shrunk photo
_DRAWS = 5000
MIN_INLIERS, MIN_INLIER_SHARE = 30, 0.25  # minimum number of inliers, and minimum share of inliers among the matches
log = logging.getLogger("polarsim")


def localise_by_features(
    name: str,
    positions: Iterable[str],
    localised: Mapping[str, LocalisedRig],
    surface: MeshSurface,
    pictures: BestPhotos,
) -> dict[str, LocalisedRig]:
    """Localise the positions with enough matches to a localised position; log a warning for each of the rest.

    The localised rigs have the same calibration. `name`: name of the terrain, for messages.
    """
    rig = next(iter(localised.values())).rig
    lens = rig.left.scaled(FEATURE_SCALE)
    shown: dict[str, ViewPhotos] = {
        view[0]: {azimuth: read_resized(path, rig.left, FEATURE_SCALE) for azimuth, path in by_azimuth.items()}
        for view, by_azimuth in pictures.items()
        if view[1] == "L"
    }
    features = {position: _features(photos) for position, photos in shown.items()}
    by_features = {}
    for position in sorted(set(positions) & set(features)):
        points, pixels = [np.empty((0, 3))], [np.empty((0, 2))]
        for other, rig_of_other in localised.items():
            camera = rig_of_other.camera("L").scaled(FEATURE_SCALE)
            for azimuth in sorted(set(features[position]) & set(features.get(other, ()))):
                here, there = features[position][azimuth], features[other][azimuth]
                first, second = match_features(there, here)
                on_mesh, hit = _points(surface, camera, there.pixels[first])
                points.append(on_mesh[hit])
                pixels.append(here.pixels[second][hit])
        pose, metrics = _pose(np.concatenate(points), np.concatenate(pixels), lens)
        if pose is None:
            log.warning("%s, position %s: too few features match photos of localised positions", name, position)
            continue
        by_features[position] = LocalisedRig(rig, pose, FEATURES, metrics)
    return by_features


def _features(photos: ViewPhotos) -> dict[str, Features]:
    """Return the features of each photo, by the azimuth of the Sun lamp."""
    return {
        azimuth: sift_features(to_uint8(np.rint(photo).astype(np.uint16)), _MAX_FEATURES)
        for azimuth, photo in photos.items()
    }


def _points(surface: MeshSurface, camera: Camera, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh points (n, 3) at pixels (n, 2), sandbox frame, metres, and a mask (n,) of the rays that hit."""
    directions = camera.directions(pixels).astype(np.float32)
    origins = np.broadcast_to(camera.centre.astype(np.float32), directions.shape)
    distance, _ = surface.rays.nearest(origins, directions)
    hit = np.isfinite(distance)
    return camera.centre + np.where(hit, distance, 0.0)[:, None] * directions, hit


def _pose(points: np.ndarray, pixels: np.ndarray, lens: Lens) -> tuple[Pose | None, dict[str, float]]:
    """Return `sandbox_from_left` from points (n, 3) at pixels (n, 2), and its metrics; None with too few inliers."""
    import cv2

    if len(points) < MIN_INLIERS:
        return None, {}
    rays = lens.directions(pixels)[:, :2]
    tolerance = _MAX_REPROJECTION_PX / lens.fx
    plain = np.eye(3)
    done, rotation, translation, inliers = cv2.solvePnPRansac(
        points, rays, plain, None, iterationsCount=_DRAWS, reprojectionError=tolerance, confidence=0.9999,
        flags=cv2.SOLVEPNP_P3P,
    )  # fmt: skip
    if not done or len(inliers) < max(MIN_INLIERS, MIN_INLIER_SHARE * len(points)):
        return None, {}
    chosen = inliers[:, 0]
    rotation, translation = cv2.solvePnPRefineLM(points[chosen], rays[chosen], plain, None, rotation, translation)
    projected, _ = cv2.projectPoints(points[chosen], rotation, translation, plain, None)
    off_px = np.linalg.norm(projected[:, 0] - rays[chosen], axis=1) * lens.fx / FEATURE_SCALE
    pose = Pose.from_rotvec(rotation.ravel(), translation.ravel()).inverse()
    metrics = {"matches": len(points), "agreeing": len(chosen), "features_off_px": np.median(off_px)}
    return rounded(pose), rounded_metrics({name: float(value) for name, value in metrics.items()})
