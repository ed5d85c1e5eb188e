"""Camera poses of novel views: points, circles, curves, random positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from polarsim.errors import ConfigError, RenderError
from polarsim.formats.calibrations import stated_rig
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.randomness import generator
from polarsim.render.views.options import OrbitCameras, PathCameras, PinholeLens, PointCameras, RandomCameras, Views
from polarsim.run_files.rigs import read_localised

Heights = Callable[[np.ndarray], np.ndarray]  # surface height (n,) at points (n, 2), metres; -inf without surface
_TRIES = 1000  # maximum number of random positions per camera
_STEPS = 200  # steps between two waypoints for measuring the length of a curve


@dataclass(frozen=True)
class NamedCamera(Camera):
    """A named camera with the pose relative to the left camera of the pair."""

    name: str
    left_from_camera: Pose  # identity except for right cameras


def cameras_of(views: Views, heights: Heights, scale: float = 1.0) -> list[NamedCamera]:
    """Return all cameras of a scene in the order of the views file, numbered within each name.

    `heights`: surface heights, for the clearance of random cameras. `scale`: size of the images relative to the lens.
    """
    rig = rig_of(views)
    numbers: dict[str, int] = {}
    cameras = []
    for section in views.cameras:
        for pose in _POSES[type(section)](section, heights):
            number = numbers[section.name] = numbers.get(section.name, -1) + 1
            for side in "LR" if views.stereo else "L":
                name = f"{section.name}-{number:03d}{side if views.stereo else ''}"
                left_from_camera = rig.left_from(side)
                lens = rig.lens(side).scaled(scale)
                cameras.append(NamedCamera(pose @ left_from_camera, lens, name, left_from_camera))
    return cameras


def rig_of(views: Views) -> StereoRig:
    """Return the rig selected by `views.lens`; a pair of pinhole cameras is parallel."""
    if isinstance(views.lens, PinholeLens):
        lens = pinhole(views.lens.hfov_deg, views.lens.width_px, views.lens.height_px)
        return StereoRig(lens, lens, Pose(np.eye(3), np.array([views.lens.baseline_m, 0, 0])))
    return read_localised(views.lens.localised).rig if views.lens.localised else stated_rig(views.read_site())


def pinhole(hfov_deg: float, width_px: int, height_px: int) -> Lens:
    """Return a pinhole lens with square pixels and the principal point at the image centre."""
    focal = width_px / 2 / np.tan(np.radians(hfov_deg) / 2)
    return Lens(float(focal), float(focal), width_px / 2, height_px / 2, width=width_px, height=height_px)


def looking_at(position: np.ndarray, target: np.ndarray, roll: float = 0.0) -> Pose:
    """Return `sandbox_from_camera` at a position (3,) with a target (3,) on the optical axis; roll in radians."""
    ahead = np.asarray(target, float) - position
    if not ahead.any():
        raise ConfigError(f"camera at {np.round(position, 3).tolist()} m: position and target are equal")
    level = np.hypot(ahead[0], ahead[1])
    return camera_pose(position, float(np.arctan2(ahead[1], ahead[0])), float(-np.arctan2(ahead[2], level)), roll)


def curve(waypoints: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points (number, 3) evenly spaced along a smooth curve through waypoints (n, 3), and the tangents.

    The curve is a natural cubic spline with centripetal parametrisation, which avoids loops between unevenly spaced
    waypoints (Lee, CAD 21 (1989) 363).
    """
    from scipy.interpolate import CubicSpline

    steps = np.sqrt(np.linalg.norm(np.diff(waypoints, axis=0), axis=1))
    if not steps.all():
        raise ConfigError(f"waypoint {int(np.argmin(steps)) + 2} is equal to the previous waypoint")
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    spline = CubicSpline(knots, waypoints, bc_type="natural")
    fine = np.interp(np.arange((len(waypoints) - 1) * _STEPS + 1) / _STEPS, np.arange(len(waypoints)), knots)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spline(fine), axis=0), axis=1))])
    points = np.interp(np.linspace(0, length[-1], number), length, fine)
    return spline(points), spline(points, 1)


def _point(section: PointCameras, _: Heights) -> Iterator[Pose]:
    yield looking_at(np.array(section.position_m), np.array(section.look_at_m), float(np.radians(section.roll_deg)))


def _orbit(section: OrbitCameras, _: Heights) -> Iterator[Pose]:
    full = np.isclose(abs(section.over_deg), 360)  # the last camera would coincide with the first
    azimuths = np.radians(section.from_deg + np.linspace(0, section.over_deg, section.number, endpoint=not full))
    centre = np.array(section.centre_m)
    for azimuth in azimuths:
        arm = [section.radius_m * np.cos(azimuth), section.radius_m * np.sin(azimuth), section.height_m]
        yield looking_at(centre + arm, centre)


def _path(section: PathCameras, _: Heights) -> Iterator[Pose]:
    points, ahead = curve(np.array(section.waypoints_m, float), section.number)
    for position, direction in zip(points, ahead, strict=True):
        if section.look_at_m is not None:
            yield looking_at(position, np.array(section.look_at_m))
        else:
            yaw = float(np.arctan2(direction[1], direction[0]))
            climb = float(np.arctan2(direction[2], np.hypot(direction[0], direction[1])))
            yield camera_pose(position, yaw, float(np.radians(section.pitch_deg)) - climb)


def _random(section: RandomCameras, heights: Heights) -> Iterator[Pose]:
    random = generator(section.seed, "views", "cameras", section.name)
    placed = 0
    for _ in range(_TRIES):
        points = random.uniform(section.low_m, section.high_m, (section.number, 3))
        targets = random.uniform(section.look_at_low_m, section.look_at_high_m, (section.number, 3))
        clear = points[:, 2] >= heights(points[:, :2]) + section.clearance_m
        for position, target in list(zip(points[clear], targets[clear], strict=True))[: section.number - placed]:
            placed += 1
            yield looking_at(position, target)
        if placed == section.number:
            return
    raise RenderError(
        f"cameras {section.name}: only {placed} of {section.number} positions are {section.clearance_m:g} m above the "
        f"ground; raise high_m"
    )


_POSES: dict[type, Callable[..., Iterator[Pose]]] = {
    PointCameras: _point,
    OrbitCameras: _orbit,
    PathCameras: _path,
    RandomCameras: _random,
}
