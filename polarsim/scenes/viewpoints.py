"""Random cameras and lamps of scenes, with a minimum share of visible and lit sand."""

from __future__ import annotations

import numpy as np

from polarsim.errors import DetectError
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.photo import REFERENCE_SIZE_PX, REFERENCE_WIDTH_PX
from polarsim.render.hits import Hits, cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import GROUND
from polarsim.scenes.options import SceneRanges

_COARSE = 1 / 32  # scale of the images for testing candidates
_TRIES = 60
_AIMED = 0.7  # maximum distance of the camera target from the centre of the sand, over half the width
_ROLL_SD_DEG = 2.0  # standard deviation of the roll of a tripod
_PRINCIPAL_SD = 0.03  # standard deviation of the principal point, over the image size
# NASA's rig from the survey and from cameras fitted to published labels, with a margin (docs/notes/cameras.md).
_RIG_HEIGHT_M, _RIG_DISTANCE_M, _RIG_FOCAL_PX, _RIG_AIMED = (1.2, 1.9), (2.4, 4.6), (1950, 2200), 0.3
_DISTORTION_SD, _MAX_DISTORTION = 0.08, 0.15  # standard deviation and limit of k1; NASA's rig: -0.11


def draw_camera(
    half: float, wall_height: float, ranges: SceneRanges, random: np.random.Generator
) -> tuple[Camera, np.ndarray]:
    """Return a random camera with at least `ranges.min_sand_share` of sand, and visible points (n, 2) of sand, metres.

    The points correspond to the pixels of a coarse image of level sand. The camera is scaled by `ranges.scale`. If no
    candidate shows enough sand, the best candidate is returned.
    """
    best, visible = None, np.zeros((0, 2))
    of_rig = random.random() < ranges.rig_share
    for _ in range(_TRIES):
        camera = _any_camera(half, ranges, of_rig, random)
        view = camera.scaled(_COARSE)
        points = level_sand(view, half, wall_height)
        if len(points) > len(visible):
            best, visible = camera, points
        if len(points) >= ranges.min_sand_share * view.lens.width * view.lens.height:
            break
    if best is None:
        raise DetectError(f"none of {_TRIES} random cameras shows sand; widen the ranges of the cameras")
    return best.scaled(ranges.scale), visible


def level_sand(view: Camera, half: float, wall_height: float) -> np.ndarray:
    """Return the points (n, 2) of level sand at the pixels of a camera that are not occluded by walls.

    `half`: half the width of the sand, metres. `wall_height`: metres above the sand, 0 without walls.
    """
    directions = view.pixel_directions().reshape(-1, 3)
    down = directions[directions[:, 2] < 0]
    centre = view.centre
    points = centre[:2] - down[:, :2] * (centre[2] / down[:, 2:])
    inside = np.abs(points).max(axis=1) < half
    if wall_height:
        back = centre[:2] - points
        with np.errstate(divide="ignore", invalid="ignore"):
            leaves = np.nanmin((half * np.sign(back) - points) / back, axis=1)  # ray parameter; 1 is the camera
        inside &= (leaves >= 1) | (leaves * centre[2] > wall_height)
    return np.asarray(points[inside])


def draw_lamp(surfaces: Surfaces, sand: Hits, ranges: SceneRanges, random: np.random.Generator) -> Lamp:
    """Return a random lamp that lights at least `ranges.min_lit_share` of the visible sand, or the best candidate.

    `sand`: result of `coarse_sand`. The elevation of the lamp is defined at the centre of the sand, and a near lamp has
    the intensity of a Sun lamp.
    """
    best, best_share = None, -1.0
    for _ in range(_TRIES):
        lamp = _any_lamp(ranges, random)
        share = _lit_share(surfaces, sand, lamp)
        if share > best_share:
            best, best_share = lamp, share
        if share >= ranges.min_lit_share:
            break
    assert best is not None
    return best


def coarse_sand(surfaces: Surfaces, camera: Camera, ranges: SceneRanges) -> Hits:
    """Return the hits on sand in a coarse image of a camera that is scaled by `ranges.scale`."""
    view = camera.scaled(_COARSE / ranges.scale)
    hits = cast_strip(surfaces, view, slice(0, view.lens.height), smooth=False)
    return hits.part(np.flatnonzero(surfaces.id_of_face.take(hits.face) == GROUND))


def _any_camera(half: float, ranges: SceneRanges, of_rig: bool, random: np.random.Generator) -> Camera:
    focal = random.uniform(*(_RIG_FOCAL_PX if of_rig else ranges.focal_px))
    k1 = float(np.clip(_DISTORTION_SD * random.standard_normal(), -_MAX_DISTORTION, _MAX_DISTORTION))
    cx, cy = (np.array(REFERENCE_SIZE_PX) * (0.5 + _PRINCIPAL_SD * random.standard_normal(2))).tolist()
    lens = Lens(focal, focal, cx, cy, (k1, 0.0, 0.0, 0.0, 0.0), width=REFERENCE_WIDTH_PX, height=REFERENCE_SIZE_PX[1])
    yaw = random.uniform(0, 2 * np.pi)
    height = random.uniform(*(_RIG_HEIGHT_M if of_rig else ranges.camera_height_m))
    distance = random.uniform(*(_RIG_DISTANCE_M if of_rig else ranges.camera_distance_m))
    aimed = _RIG_AIMED if of_rig else _AIMED
    aim = random.uniform(-aimed, aimed, 2) * half
    centre = np.array([*(aim - distance * np.array([np.cos(yaw), np.sin(yaw)])), height])
    roll = np.radians(_ROLL_SD_DEG) * random.standard_normal()
    return Camera(camera_pose(centre, yaw, float(np.arctan2(height, distance)), float(roll)), lens)


def _any_lamp(ranges: SceneRanges, random: np.random.Generator) -> Lamp:
    azimuth, elevation = random.uniform(0, 360), random.uniform(*ranges.elevation_deg)
    if random.random() >= ranges.near_share:
        sun = Lamp.sun(azimuth, elevation)
        return Lamp(sun.position, distant=True)  # a point lamp: penumbrae of the Sun are thinner than a pixel
    direction, up = np.radians([azimuth, elevation])
    distance = random.uniform(*ranges.lamp_distance_m)
    level = np.cos(up)
    return Lamp(distance * np.array([level * np.cos(direction), level * np.sin(direction), np.sin(up)]))


def _lit_share(surfaces: Surfaces, sand: Hits, lamp: Lamp) -> float:
    to_lamp, _ = lamp.light_at(sand.point, falloff=False)
    facing = np.einsum("na,na->n", to_lamp, sand.plane) > 0
    lit = facing & ~surfaces.all.occluded(sand.point, to_lamp, 1.0)
    return float(lit.mean()) if len(lit) else 0.0
