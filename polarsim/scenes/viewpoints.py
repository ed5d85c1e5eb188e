"""Where cameras and lamps of strewn scenes stand: anywhere from which much lit sand is seen."""

from __future__ import annotations

import numpy as np

from polarsim.errors import DetectError
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import looking
from polarsim.photo import HEIGHT, WIDTH
from polarsim.render.hits import Hits, cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import GROUND
from polarsim.scenes.options import SceneRanges

_COARSE = 1 / 32  # of a photo's size: pictures in which tries are looked at
_TRIES = 60
_AIMED = 0.7  # of the way from the centre of the sand to its edge: how far off a camera looks
_ROLL_SD_DEG = 2.0  # a tripod stands upright by eye
_ASIDE = 0.03  # of the picture's size: standard deviation of the principal point's position
# NASA's rig by its survey and by cameras fitted to published labels, with room around them (docs/notes/cameras.md).
_RIG_HEIGHT_M, _RIG_DISTANCE_M, _RIG_FOCAL_PX, _RIG_AIMED = (1.2, 1.9), (2.4, 4.6), (1950, 2200), 0.3
_DISTORTION_SD, _MOST_DISTORTION = 0.08, 0.15  # of k1: the rig's lenses have -0.11


def draw_camera(chosen: RenderOptions, ranges: SceneRanges, random: np.random.Generator) -> tuple[Camera, np.ndarray]:
    """A camera whose picture sand fills to the share that the ranges ask for, and points (n, 2) of that sand, metres.

    The points are those of the pixels of a coarse picture of level sand. The camera is scaled by `ranges.scale`. Of
    tries that all show too little the best one counts.

    Raises
    ------
    DetectError
        No try shows any sand.
    """
    best, seen = None, np.zeros((0, 2))
    of_rig = random.random() < ranges.rig_share
    for _ in range(_TRIES):
        camera = _any_camera(chosen, ranges, of_rig, random)
        view = camera.scaled(_COARSE)
        points = level_sand(view, chosen)
        if len(points) > len(seen):
            best, seen = camera, points
        if len(points) >= ranges.least_sand * view.lens.width * view.lens.height:
            break
    if best is None:
        raise DetectError("no camera sees the sand of a scene: covers.scenes asks for impossible views")
    return best.scaled(ranges.scale), seen


def level_sand(view: Camera, chosen: RenderOptions) -> np.ndarray:
    """(n, 2) points of level sand that the pixels of a picture see past the walls of the sandbox."""
    directions = view.pixel_directions().reshape(-1, 3)
    down = directions[directions[:, 2] < 0]
    centre, half = view.centre, chosen.rim_half_width_m
    points = centre[:2] - down[:, :2] * (centre[2] / down[:, 2:])
    inside = np.abs(points).max(axis=1) < half
    if chosen.rim:
        back = centre[:2] - points
        with np.errstate(divide="ignore", invalid="ignore"):
            leaves = np.nanmin((half * np.sign(back) - points) / back, axis=1)  # 1 is the camera
        inside &= (leaves >= 1) | (leaves * centre[2] > chosen.rim_height_m)
    return np.asarray(points[inside])


def draw_lamp(surfaces: Surfaces, sand: Hits, ranges: SceneRanges, random: np.random.Generator) -> Lamp:
    """A lamp that lights the share of the sand in the picture that the ranges ask for, or the best of some tries.

    `sand`: what `coarse_sand` found. The lamp's height above the horizon holds at the centre of the sand. A near lamp
    is as bright there as any Sun lamp.
    """
    best, most = None, -1.0
    for _ in range(_TRIES):
        lamp = _any_lamp(ranges, random)
        share = _lit_share(surfaces, sand, lamp)
        if share > most:
            best, most = lamp, share
        if share >= ranges.least_lit:
            break
    assert best is not None
    return best


def coarse_sand(surfaces: Surfaces, camera: Camera, ranges: SceneRanges) -> Hits:
    """Sand in a coarse picture of a camera that is scaled by `ranges.scale`."""
    view = camera.scaled(_COARSE / ranges.scale)
    hits = cast_strip(surfaces, view, slice(0, view.lens.height), smooth=False)
    return hits.part(np.flatnonzero(surfaces.id_of_face.take(hits.face) == GROUND))


def _any_camera(chosen: RenderOptions, ranges: SceneRanges, of_rig: bool, random: np.random.Generator) -> Camera:
    focal = random.uniform(*(_RIG_FOCAL_PX if of_rig else ranges.focal_px))
    bend = float(np.clip(_DISTORTION_SD * random.standard_normal(), -_MOST_DISTORTION, _MOST_DISTORTION))
    across, down = (np.array([WIDTH, HEIGHT]) * (0.5 + _ASIDE * random.standard_normal(2))).tolist()
    lens = Lens(focal, focal, across, down, (bend, 0.0, 0.0, 0.0, 0.0))
    yaw = random.uniform(0, 2 * np.pi)
    height = random.uniform(*(_RIG_HEIGHT_M if of_rig else ranges.camera_height_m))
    distance = random.uniform(*(_RIG_DISTANCE_M if of_rig else ranges.camera_distance_m))
    aimed = _RIG_AIMED if of_rig else _AIMED
    aim = random.uniform(-aimed, aimed, 2) * chosen.rim_half_width_m
    centre = np.array([*(aim - distance * np.array([np.cos(yaw), np.sin(yaw)])), height])
    roll = np.radians(_ROLL_SD_DEG) * random.standard_normal()
    return Camera(looking(centre, yaw, float(np.arctan2(height, distance)), float(roll)), lens)


def _any_lamp(ranges: SceneRanges, random: np.random.Generator) -> Lamp:
    azimuth, elevation = random.uniform(0, 360), random.uniform(*ranges.elevation_deg)
    if random.random() >= ranges.near_share:
        sun = Lamp.sun(azimuth, elevation)
        return Lamp(sun.position, distant=True)  # a point: its half shadows are thinner than a pixel
    direction, up = np.radians([azimuth, elevation])
    away = random.uniform(*ranges.lamp_distance_m)
    level = np.cos(up)
    return Lamp(away * np.array([level * np.cos(direction), level * np.sin(direction), np.sin(up)]))


def _lit_share(surfaces: Surfaces, sand: Hits, lamp: Lamp) -> float:
    to_lamp, _ = lamp.light_at(sand.point, falloff=False)
    facing = np.einsum("na,na->n", to_lamp, sand.plane) > 0
    lit = facing & ~surfaces.all.occluded(sand.point, to_lamp, 1.0)
    return float(lit.mean()) if len(lit) else 0.0
