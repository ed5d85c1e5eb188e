"""True tripod poses, lamps and rig of a terrain, and the calibration file with errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.analog.options import AnalogOptions
from polarsim.formats.calibrations import stated_rig
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import Terrain, photo_scale
from polarsim.randomness import generator
from polarsim.site import Site
from polarsim.site_parts import FAR_M, SunLamp

ROVER = "rover"  # name of the light between the cameras; Sun lamps are named by their azimuth
# Assumed deviations of the sandbox from survey and calibration; the real deviations of NASA's sandbox are unknown.
_TRIPOD_OFFSET, _YAW_DEG, _ROLL_DEG = 0.1, 2.0, 1.0  # maximum deviation from nominal, metres and degrees
_PITCH_DEG = 3.0  # maximum deviation of the downward tilt of the rig
_LAMP_OFFSET_MM = (100, 200)  # distance of a lamp from the surveyed position, for a lamp at ...
_LAMP_DISTANCE = 4.0  # ... about this distance, metres; directional lamps have the same angular error
# A rig without a stated position: distance from the side +x of the sand, y and height, metres.
_UNSURVEYED, _UNSURVEYED_PITCH_DEG = (1.5, -0.15, 1.25), (29.0, 31.0)
_FIELD_OF_VIEW_DEG = 50.0  # horizontal, of a rig without a stated field of view
_DISTORTION = (-0.11, 0.17, 2e-4, -1e-3, 0.0)  # of a made rig: similar to NASA's lenses
# Standard deviations of the calibration file.
_FOCAL_ERROR_PX, _PRINCIPAL_ERROR_PX, _K1_ERROR, _BASELINE_ERROR_MM = 1.0, 1.0, 0.002, 0.2


@dataclass(frozen=True)
class Stations:
    """True rig, poses and lamps (ground truth), and `calibration`, the published calibration with errors."""

    rig: StereoRig
    calibration: StereoRig
    sandbox_from_left: dict[str, Pose]  # by position
    lamps: dict[str, np.ndarray]  # azimuth, or `rover_A`; (3,) sandbox frame
    suns: tuple[str, ...]  # azimuths

    def camera(self, position: str, side: str) -> Camera:
        """Return camera L or R in the sandbox frame."""
        return Camera(self.sandbox_from_left[position] @ self.rig.left_from(side), self.rig.lens(side))

    def lamps_at(self, position: str) -> dict[str, np.ndarray]:
        """Return the Sun lamps by azimuth, and `rover`, the lamp of the rig at the position, if the rig has one."""
        rover = self.lamps.get(f"{ROVER}_{position}")
        suns = {azimuth: self.lamps[azimuth] for azimuth in self.suns}
        return suns if rover is None else {**suns, ROVER: rover}


def make_stations(site: Site, terrain: Terrain, options: AnalogOptions) -> Stations:
    """Generate the stations of a terrain."""
    rng = generator(options.seed, "set-up", terrain)
    rig = _true_rig(site, rng)
    calibration = _calibrated(rig, rng)
    poses = {position: _tripod(site, terrain, position, rng) for position in site.positions_of(terrain)}
    lamps: dict[str, np.ndarray] = {}
    for azimuth, lamp in site.lamps.items():
        direction = rng.normal(0, 1, 3) * [1, 1, 0.25]
        distance = rng.uniform(*_LAMP_OFFSET_MM) / 1000 * _error_scale(lamp)
        lamps[azimuth] = np.array(lamp.point) + distance * direction / np.linalg.norm(direction)
    if site.rig_lamp:
        from_camera = np.array(site.rig_lamp.from_camera_m)
        for position, pose in poses.items():
            lamps[f"{ROVER}_{position}"] = pose.apply(from_camera + rng.normal(0, 0.005, 3))
    return Stations(rig, calibration, poses, lamps, site.suns)


def _error_scale(lamp: SunLamp) -> float:
    return FAR_M / _LAMP_DISTANCE if lamp.kind == "directional" else 1.0


def _stated_rig(site: Site) -> StereoRig:
    """Return the rig of a site; without calibration parallel cameras with the stated field of view and baseline."""
    if site.cameras.calibration is not None:
        return stated_rig(site)
    width, height = site.images.size
    focal = width / 2 / np.tan(np.radians(site.cameras.field_of_view_deg or _FIELD_OF_VIEW_DEG) / 2)
    lens = Lens(focal, focal, width / 2, height / 2, _DISTORTION, width=width, height=height)
    if site.cameras.baseline_m is None or not site.cameras.stereo:
        return StereoRig.single(lens)
    return StereoRig(lens, lens, Pose(np.eye(3), np.array([np.mean(site.cameras.baseline_m), 0.0, 0.0])))


def _true_rig(site: Site, rng: np.random.Generator) -> StereoRig:
    """Return a random rig similar to the rig of the site."""
    stated = _stated_rig(site)

    def lens(nominal: Lens) -> Lens:
        k1, k2, p1, p2, k3 = nominal.distortion
        terms = (k1 + rng.normal(0, 0.002), k2 + rng.normal(0, 0.004), p1 + rng.normal(0, 5e-5), p2, k3)
        scale = photo_scale(nominal.width)
        focal = nominal.fx + rng.normal(0, 4 * scale)
        cx, cy = nominal.cx + rng.normal(0, 3 * scale), nominal.cy + rng.normal(0, 3 * scale)
        return replace(nominal, fx=focal, fy=focal * 0.998, cx=cx, cy=cy, distortion=terms)

    motion = Pose.from_rotvec(np.radians(rng.normal(0, 0.05, 3)), rng.normal(0, 0.0005, 3))
    if not stated.is_stereo:
        return StereoRig.single(lens(stated.left))
    return StereoRig(lens(stated.left), lens(stated.right), stated.left_from_right @ motion)


def _calibrated(rig: StereoRig, rng: np.random.Generator) -> StereoRig:
    """Return the rig with calibration errors, rounded as in the calibration file."""

    def lens(true: Lens) -> Lens:
        scale = photo_scale(true.width)
        focal = rng.normal(0, _FOCAL_ERROR_PX * scale)
        cx, cy = rng.normal(0, _PRINCIPAL_ERROR_PX * scale, 2)
        terms = [true.distortion[0] + rng.normal(0, _K1_ERROR), *true.distortion[1:]]
        matrix = replace(true, fx=true.fx + focal, fy=true.fy + focal, cx=true.cx + cx, cy=true.cy + cy).opencv_matrix()
        return Lens.from_opencv(_six_digits(matrix), _six_digits(np.array(terms)), (true.width, true.height))

    if not rig.is_stereo:
        return StereoRig.single(lens(rig.left))
    right_from_left = rig.left_from_right.inverse()
    moved = right_from_left.translation + rng.normal(0, _BASELINE_ERROR_MM / 1000, 3)
    rotation = Rotation.from_rotvec(np.radians(rng.normal(0, 0.005, 3))).as_matrix() @ right_from_left.rotation
    return StereoRig(lens(rig.left), lens(rig.right), Pose(rotation, _six_digits(moved)).inverse())


def _six_digits(values: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.6g}") for value in np.ravel(values)]).reshape(np.shape(values))


def _tripod(site: Site, terrain: Terrain, position: str, rng: np.random.Generator) -> Pose:
    reach = _TRIPOD_OFFSET
    stated = site.tripods_of(terrain).get(position)
    if stated is None:
        away, y, height = _UNSURVEYED
        centre = np.array([site.sandbox_of(terrain).half_width_m[0] + away, y, height])
        centre += rng.uniform(-1, 1, 3) * [reach, reach, reach / 2]
        return camera_pose(centre, np.pi + rng.normal(0, 0.01), np.radians(rng.uniform(*_UNSURVEYED_PITCH_DEG)), 0.0)
    centre = np.array(site.analog.tripods_m.get(position, stated.camera_m))
    centre += rng.uniform(-1, 1, 3) * [reach, reach, reach / 2]
    yaw = stated.yaw_deg + rng.uniform(-1, 1) * _YAW_DEG
    pitch = rng.uniform(stated.pitch_deg - _PITCH_DEG, stated.pitch_deg + _PITCH_DEG)
    roll = rng.uniform(-1, 1) * _ROLL_DEG
    return camera_pose(centre, *np.radians([yaw, pitch, roll]))
