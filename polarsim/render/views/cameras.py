"""Where novel views are taken from: points, circles, curves, random positions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from polarsim.errors import ConfigError, RenderError
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, looking
from polarsim.geometry.stereo import StereoRig, stated_rig
from polarsim.randomness import generator
from polarsim.render.views.options import OrbitCameras, PathCameras, PinholeLens, PointCameras, RandomCameras, Views
from polarsim.run_files.rigs import read_localised

Heights = Callable[[np.ndarray], np.ndarray]  # of what lies beneath points (n, 2): (n,) metres, -inf over nothing
_TRIES = 1000  # random positions a camera, before the box is given up
_STEPS = 200  # of a curve between two waypoints, on which its length is measured


@dataclass(frozen=True)
class NamedCamera(Camera):
    """One camera of one view."""

    name: str
    left_from_camera: Pose  # identity for all but the right ones of pairs


def cameras_of(views: Views, heights: Heights, scale: float = 1.0) -> list[NamedCamera]:
    """All cameras of a scene in the order of the file, names numbered on within each name.

    Parameters
    ----------
    heights
        What random cameras keep clear of.
    scale
        Size of the pictures over that of the lens.

    Raises
    ------
    RenderError
        No position in the box of random cameras is clear.
    """
    rig = rig_of(views)
    numbers: dict[str, int] = {}
    found = []
    for section in views.cameras:
        for pose in _POSES[type(section)](section, heights):
            number = numbers[section.name] = numbers.get(section.name, -1) + 1
            for side in "LR" if views.stereo else "L":
                name = f"{section.name}-{number:03d}{side if views.stereo else ''}"
                own = rig.left_from(side)
                found.append(NamedCamera(pose @ own, rig.lens(side).scaled(scale), name, own))
    return found


def rig_of(views: Views) -> StereoRig:
    """The lenses that the views name; a pinhole's pair is parallel."""
    if isinstance(views.lens, PinholeLens):
        lens = pinhole(views.lens.hfov_deg, views.lens.width_px, views.lens.height_px)
        return StereoRig(lens, lens, Pose(np.eye(3), np.array([views.lens.baseline_m, 0, 0])))
    return read_localised(views.lens.localised).rig if views.lens.localised else stated_rig()


def pinhole(hfov_deg: float, width_px: int, height_px: int) -> Lens:
    """A lens with square pixels, its axis through the picture's centre."""
    focal = width_px / 2 / np.tan(np.radians(hfov_deg) / 2)
    return Lens(float(focal), float(focal), width_px / 2, height_px / 2, width=width_px, height=height_px)


def looking_at(position: np.ndarray, target: np.ndarray, roll: float = 0.0) -> Pose:
    """`sandbox_from_camera` at a position (3,) with a target (3,) on its axis; roll in radians.

    Raises
    ------
    ConfigError
        Both are the same point.
    """
    ahead = np.asarray(target, float) - position
    if not ahead.any():
        raise ConfigError(f"a camera at {np.round(position, 3).tolist()} m looks at its own position")
    level = np.hypot(ahead[0], ahead[1])
    return looking(position, float(np.arctan2(ahead[1], ahead[0])), float(-np.arctan2(ahead[2], level)), roll)


def curve(waypoints: np.ndarray, number: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (number, 3) evenly spaced along a smooth curve through waypoints (n, 3), and its directions there.

    A natural cubic spline, centripetally parametrised: no loops where waypoints lie unevenly (Lee, CAD 21 (1989) 363).

    Raises
    ------
    ConfigError
        Two neighbouring waypoints are one point.
    """
    from scipy.interpolate import CubicSpline

    steps = np.sqrt(np.linalg.norm(np.diff(waypoints, axis=0), axis=1))
    if not steps.all():
        raise ConfigError(f"waypoint {int(np.argmin(steps)) + 2} lies on the one before it")
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    spline = CubicSpline(knots, waypoints, bc_type="natural")
    fine = np.interp(np.arange((len(waypoints) - 1) * _STEPS + 1) / _STEPS, np.arange(len(waypoints)), knots)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(spline(fine), axis=0), axis=1))])
    points = np.interp(np.linspace(0, length[-1], number), length, fine)
    return spline(points), spline(points, 1)


def _point(section: PointCameras, _: Heights) -> Iterator[Pose]:
    yield looking_at(np.array(section.position_m), np.array(section.look_at_m), float(np.radians(section.roll_deg)))


def _orbit(section: OrbitCameras, _: Heights) -> Iterator[Pose]:
    full = np.isclose(abs(section.over_deg), 360)  # the last camera would stand where the first one does
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
            yield looking(position, yaw, float(np.radians(section.pitch_deg)) - climb)


def _random(section: RandomCameras, heights: Heights) -> Iterator[Pose]:
    random = generator(section.seed, "views", "cameras", section.name)
    found = 0
    for _ in range(_TRIES):
        points = random.uniform(section.low_m, section.high_m, (section.number, 3))
        targets = random.uniform(section.look_at_low_m, section.look_at_high_m, (section.number, 3))
        clear = points[:, 2] >= heights(points[:, :2]) + section.clearance_m
        for position, target in list(zip(points[clear], targets[clear], strict=True))[: section.number - found]:
            found += 1
            yield looking_at(position, target)
        if found == section.number:
            return
    raise RenderError(
        f"cameras {section.name}: {found} of {section.number} positions found that lie {section.clearance_m:g} m above "
        f"the ground; raise high_m"
    )


_POSES: dict[type, Callable[..., Iterator[Pose]]] = {
    PointCameras: _point,
    OrbitCameras: _orbit,
    PathCameras: _path,
    RandomCameras: _random,
}
