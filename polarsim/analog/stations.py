"""True tripod poses, lamps and rig of a terrain, and the calibration file with errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.analog.options import AnalogOptions
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import StereoRig, default_rig
from polarsim.photo import SUNS, Terrain, positions
from polarsim.randomness import generator
from polarsim.survey import NOMINAL_YAW_DEG, ROVER_LIGHT_FROM_LEFT, SUN_LAMPS

ROVER = "rover"  # name of the light between the cameras; Sun lamps are named by their azimuth
# Assumed deviations of the sandbox from NASA's survey and calibration; the real deviations are unknown.
_TRIPOD_OFFSET, _YAW_DEG, _ROLL_DEG = 0.1, 2.0, 1.0  # maximum deviation from nominal, metres and degrees
_PITCH_DEG = (22.0, 28.0)  # downward tilt of the rig
_LAMP_OFFSET_MM = (100, 200)  # distance of a lamp from the surveyed position
# Standard deviations of the calibration file.
_FOCAL_ERROR_PX, _PRINCIPAL_ERROR_PX, _K1_ERROR, _BASELINE_ERROR_MM = 1.0, 1.0, 0.002, 0.2
# Tripod positions, metres, from the distances to the edge of the box in the names of NASA's folders.
_TRIPODS = {"A": np.array([3.60, -0.38, 1.55]), "B": np.array([6.10, -0.45, 1.55]), "C": np.array([0.80, -3.65, 1.55])}


@dataclass(frozen=True)
class Stations:
    """True rig, poses and lamps (ground truth), and `calibration`, the published calibration with errors."""

    rig: StereoRig
    calibration: StereoRig
    sandbox_from_left: dict[str, Pose]  # by position
    lamps: dict[str, np.ndarray]  # azimuth, or `rover_A`; (3,) sandbox frame

    def camera(self, position: str, side: str) -> Camera:
        """Return camera L or R in the sandbox frame."""
        return Camera(self.sandbox_from_left[position] @ self.rig.left_from(side), self.rig.lens(side))

    def lamps_at(self, position: str) -> dict[str, np.ndarray]:
        """Return the Sun lamps by azimuth, and `rover`, the rover light of the position."""
        return {**{azimuth: self.lamps[azimuth] for azimuth in SUNS}, ROVER: self.lamps[f"{ROVER}_{position}"]}


def make_stations(terrain: Terrain, options: AnalogOptions) -> Stations:
    """Generate the stations of a terrain."""
    rng = generator(options.seed, "set-up", terrain)
    rig = _true_rig(rng)
    calibration = _calibrated(rig, rng)
    poses = {position: _tripod(terrain, position, rng) for position in positions(terrain)}
    lamps: dict[str, np.ndarray] = {}
    for azimuth in SUNS:
        direction = rng.normal(0, 1, 3) * [1, 1, 0.25]
        distance = rng.uniform(*_LAMP_OFFSET_MM) / 1000
        lamps[azimuth] = SUN_LAMPS[azimuth] + distance * direction / np.linalg.norm(direction)
    for position, pose in poses.items():
        lamps[f"{ROVER}_{position}"] = pose.apply(ROVER_LIGHT_FROM_LEFT + rng.normal(0, 0.005, 3))
    return Stations(rig, calibration, poses, lamps)


def _true_rig(rng: np.random.Generator) -> StereoRig:
    """Return a random rig similar to NASA's rig."""
    stated = default_rig()

    def lens(nominal: Lens) -> Lens:
        k1, k2, p1, p2, k3 = nominal.distortion
        terms = (k1 + rng.normal(0, 0.002), k2 + rng.normal(0, 0.004), p1 + rng.normal(0, 5e-5), p2, k3)
        focal = nominal.fx + rng.normal(0, 4)
        return replace(
            nominal, fx=focal, fy=focal * 0.998, cx=nominal.cx + rng.normal(0, 3), cy=nominal.cy + rng.normal(0, 3),
            distortion=terms,
        )  # fmt: skip

    motion = Pose.from_rotvec(np.radians(rng.normal(0, 0.05, 3)), rng.normal(0, 0.0005, 3))
    return StereoRig(lens(stated.left), lens(stated.right), stated.left_from_right @ motion)


def _calibrated(rig: StereoRig, rng: np.random.Generator) -> StereoRig:
    """Return the rig with calibration errors, rounded as in the calibration file."""

    def lens(true: Lens) -> Lens:
        focal = rng.normal(0, _FOCAL_ERROR_PX)
        cx, cy = rng.normal(0, _PRINCIPAL_ERROR_PX, 2)
        terms = [true.distortion[0] + rng.normal(0, _K1_ERROR), *true.distortion[1:]]
        matrix = replace(true, fx=true.fx + focal, fy=true.fy + focal, cx=true.cx + cx, cy=true.cy + cy).opencv_matrix()
        return Lens.from_opencv(_six_digits(matrix), _six_digits(np.array(terms)))

    right_from_left = rig.left_from_right.inverse()
    moved = right_from_left.translation + rng.normal(0, _BASELINE_ERROR_MM / 1000, 3)
    rotation = Rotation.from_rotvec(np.radians(rng.normal(0, 0.005, 3))).as_matrix() @ right_from_left.rotation
    return StereoRig(lens(rig.left), lens(rig.right), Pose(rotation, _six_digits(moved)).inverse())


def _six_digits(values: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.6g}") for value in np.ravel(values)]).reshape(np.shape(values))


def _tripod(terrain: Terrain, position: str, rng: np.random.Generator) -> Pose:
    reach = _TRIPOD_OFFSET
    if terrain == 13:  # seven nearly equal positions in front of a small box
        centre = np.array([2.0, -0.15, 1.25]) + rng.uniform(-1, 1, 3) * [reach, reach, reach / 2]
        return camera_pose(centre, np.pi + rng.normal(0, 0.01), np.radians(rng.uniform(29, 31)), 0.0)
    centre = _TRIPODS[position] + rng.uniform(-1, 1, 3) * [reach, reach, reach / 2]
    yaw = NOMINAL_YAW_DEG[position] + rng.uniform(-1, 1) * _YAW_DEG
    pitch = rng.uniform(*_PITCH_DEG)
    roll = rng.uniform(-1, 1) * _ROLL_DEG
    return camera_pose(centre, *np.radians([yaw, pitch, roll]))
