"""Rigs that neither scans nor labels localise, by what their photos share with those of localised positions.

Terrain 13 was photographed from seven positions within decimetres, and its scans are of three of them. Photos under the
same lamp from nearly the same place show the same texture: their SIFT features (Lowe, IJCV 60 (2004) 91) are matched,
those of the localised photo lie on the meshes, and the pose is the one that sees these points where the other photo has
them (P3P within RANSAC, then least squares). From far away, as from position A to C, too few features match: then
nothing is found.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping

import numpy as np

from polarsim.cameras.rounding import rounded, rounded_metrics
from polarsim.cameras.shading import Surface
from polarsim.geometry.camera import Camera
from polarsim.geometry.features import Features, match_features, sift_features
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.run_files.best_photos import Photos, Pictures, read_shrunk
from polarsim.run_files.rigs import FEATURES, LocalisedRig
from polarsim.tone import to_8bit

SCALE = 0.5  # of the photos in which features are looked for
_MOST = 6000  # features of a photo
_OFF_PX = 2.0  # farthest of a point from where the pose sees it, in pixels of the shrunk photo
_DRAWS = 5000
LEAST_MATCHES, LEAST_SHARE = 30, 0.25  # that agree with the pose; of all matches
log = logging.getLogger("polarsim")


def localise_by_features(
    name: str, positions: Iterable[str], localised: Mapping[str, LocalisedRig], surface: Surface, pictures: Pictures
) -> dict[str, LocalisedRig]:
    """Those of the positions whose left photos share enough with a localised position's; the others are a warning.

    Parameters
    ----------
    name
        Of the terrain, for messages.
    localised : position -> LocalisedRig
        Rigs to start from; all have one calibration.
    pictures
        Photos by view and azimuth of the Sun lamp.
    """
    rig = next(iter(localised.values())).rig
    lens = rig.left.scaled(SCALE)
    shown: dict[str, Photos] = {
        view[0]: {azimuth: read_shrunk(path, lens) for azimuth, path in by_azimuth.items()}
        for view, by_azimuth in pictures.items()
        if view[1] == "L"
    }
    features = {position: _features(photos) for position, photos in shown.items()}
    found = {}
    for position in sorted(set(positions) & set(features)):
        points, pixels = [np.empty((0, 3))], [np.empty((0, 2))]
        for other, known in localised.items():
            camera = known.camera("L").scaled(SCALE)
            for azimuth in sorted(set(features[position]) & set(features.get(other, ()))):
                here, there = features[position][azimuth], features[other][azimuth]
                first, second = match_features(there, here)
                on_mesh, hit = _points(surface, camera, there.pixels[first])
                points.append(on_mesh[hit])
                pixels.append(here.pixels[second][hit])
        pose, metrics = _pose(np.concatenate(points), np.concatenate(pixels), lens)
        if pose is None:
            log.warning(
                "%s, position %s: its photos share too little with those of localised positions", name, position
            )
            continue
        found[position] = LocalisedRig(rig, pose, FEATURES, metrics)
    return found


def _features(photos: Photos) -> dict[str, Features]:
    """Return the features of each photo, by the azimuth of the Sun lamp."""
    return {
        azimuth: sift_features(to_8bit(np.rint(photo).astype(np.uint16))[..., 0], _MOST)
        for azimuth, photo in photos.items()
    }


def _points(surface: Surface, camera: Camera, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) what the meshes show at pixels (n, 2), sandbox frame, metres, and (n,) bool: where they show anything."""
    directions = camera.directions(pixels).astype(np.float32)
    origins = np.broadcast_to(camera.centre.astype(np.float32), directions.shape)
    distance, _ = surface.rays.nearest(origins, directions)
    hit = np.isfinite(distance)
    return camera.centre + np.where(hit, distance, 0.0)[:, None] * directions, hit


def _pose(points: np.ndarray, pixels: np.ndarray, lens: Lens) -> tuple[Pose | None, dict[str, float]]:
    """`sandbox_from_left` from which points (n, 3) are seen at pixels (n, 2), and how well; None: too few agree."""
    import cv2

    if len(points) < LEAST_MATCHES:
        return None, {}
    rays = lens.directions(pixels)[:, :2]
    tolerance = _OFF_PX / lens.fx
    plain = np.eye(3)
    done, rotation, translation, agreeing = cv2.solvePnPRansac(
        points, rays, plain, None, iterationsCount=_DRAWS, reprojectionError=tolerance, confidence=0.9999,
        flags=cv2.SOLVEPNP_P3P,
    )  # fmt: skip
    if not done or len(agreeing) < max(LEAST_MATCHES, LEAST_SHARE * len(points)):
        return None, {}
    chosen = agreeing[:, 0]
    rotation, translation = cv2.solvePnPRefineLM(points[chosen], rays[chosen], plain, None, rotation, translation)
    seen, _ = cv2.projectPoints(points[chosen], rotation, translation, plain, None)
    off_px = np.linalg.norm(seen[:, 0] - rays[chosen], axis=1) * lens.fx / SCALE
    pose = Pose.from_rotvec(rotation.ravel(), translation.ravel()).inverse()
    metrics = {"matches": len(points), "agreeing": len(chosen), "features_off_px": np.median(off_px)}
    return rounded(pose), rounded_metrics({name: float(value) for name, value in metrics.items()})
