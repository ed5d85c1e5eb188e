"""Errors of stereo motion on rendered pairs, by Sun, with lights off and on.

`python benchmarks/rover_stereo.py MESHES --terrains 4 1 11 [--seed 7 --rocks 0.006] [--length 14] [--exposure 256]`

The rover follows a winding path without physics: base_link is fixed to the plane through the ground under the wheels.
Pairs are 0.2 m apart. With `--seed` the ground is random relief with craters and rocks, else the terrains. Rows have
drift (share of the path, without motions that were not found), median and maximum errors per motion, the mean squared
normalised error (1 if the covariance is right), motions not found, and CPU time of `StereoMotion` per pair. For wheels,
`--predicted` passes the true motion with errors of 15 % and 0.6 degrees.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.detect import tone
from polarsim.geometry.poses import Pose
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.rover.cameras.bodywork import links_at
from polarsim.rover.cameras.lights import named_sun
from polarsim.rover.cameras.options import CameraSuiteOptions, lights_ahead
from polarsim.rover.cameras.rover_camera import RoverCamera, near_path
from polarsim.rover.drive.job import DriveJob, job_of
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.localisation.stereo_motion import StereoMotion
from polarsim.rover.perception.observation import moved_aside, rectification
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.world.options import DemOptions, WorldOptions

STEP_M, BASELINE_M, SCALE = 0.2, 0.3, 0.25
RADIUS_M, SINKAGE_M = 0.25, 0.016
SUNS, NIGHT = ("1", "2", "3", "4"), "night"


def winding(length: float, amplitude: float = 0.8, wave: float = 14.0) -> np.ndarray:
    """Return points (n, 3) x, y, heading of a path from east to west, `STEP_M` apart."""
    share = np.linspace(0, 1, 4000)
    x = length / 2 - length * share
    y = amplitude * np.sin(2 * np.pi * share * length / wave) * np.minimum(1, 10 * share)
    along = np.concatenate([[0], np.hypot(np.diff(x), np.diff(y)).cumsum()])
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    at = np.arange(0, along[-1], STEP_M)
    return np.column_stack([np.interp(at, along, values) for values in (x, y, heading)])


def on_ground(job: DriveJob, x: float, y: float, heading: float) -> Pose:
    """Return `world_from_base` on the plane through the ground under the wheels."""
    centres = job.vehicle.wheel_centres[:, :2]
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    height = job.world.height_at(*(turn @ centres.T + [[x], [y]])) + RADIUS_M - SINKAGE_M
    ahead, left, middle = np.linalg.lstsq(np.column_stack([centres, np.ones(len(centres))]), height, rcond=None)[0]
    attitude = Rotation.from_euler("ZYX", [heading, -np.arctan(ahead), np.arctan(left)])
    return Pose(attitude.as_matrix(), np.array([x, y, middle]))


def radiances(job: DriveJob, bases: list[Pose]) -> tuple[RoverCamera, list[Pose], list[np.ndarray]]:
    """Return poses of the left camera and radiances (2, 5, h, w) by camera and Sun; the last are of lights only."""
    cameras = CameraSuiteOptions(scale=2 * SCALE, models=("hapke",), finer=1)
    followed = near_path(job.world, job.route, 2.0)
    camera = RoverCamera(
        job.world, job.vehicle, followed, cameras, RenderOptions(noise=True), models=("hapke",), finer=1
    )
    mount = mount_of(job.vehicle.camera(FRONT), SCALE)
    right = moved_aside(mount, BASELINE_M)
    suns = {name: named_sun(name, cameras.sun_elevation_deg) for name in (*SUNS, NIGHT)}
    lights = [job.vehicle.light(name) for name in lights_ahead(job.vehicle)]
    still = {wheel.code: 0.0 for wheel in job.vehicle.wheels}
    poses, found = [], []
    for base in bases:
        wheels = {w.code: base @ Pose(np.eye(3), np.array(w.position_m)) for w in job.vehicle.wheels}
        camera.show(job.world.level, links_at(job.vehicle, base, wheels, still, still))
        left = mount.at(base)
        both = [camera.render(side, suns, lights, labels=False) for side in (left, right.at(base))]
        found.append(np.array([[side.olat_images["hapke", name] for name in suns] for side in both]))
        poses.append(left.world_from_camera)
    return camera, poses, found


def row(pairs: list[np.ndarray], poses: list[Pose], stereo: StereoMotion, predicted: bool) -> str:
    """Return the errors of the motions of pairs as text."""
    rng = np.random.default_rng(0)
    path, lost, spent, chain, true_chain = 0.0, 0, 0.0, Pose.identity(), Pose.identity()
    moved, turned, squares = [], [], []
    for number, (left, right) in enumerate(pairs):
        true = poses[number - 1].inverse() @ poses[number] if number else Pose.identity()
        turn = true.rotation @ Rotation.from_rotvec(rng.normal(0, 0.01, 3)).as_matrix()
        guess = Pose(turn, true.translation * (1 + rng.normal(0, 0.15)))
        began = time.process_time()
        motion = stereo.add(left, right, guess if predicted and number else None)
        spent += time.process_time() - began
        path += float(np.linalg.norm(true.translation))
        lost += motion is None and number > 0
        true_chain, chain = true_chain @ true, chain @ (true if motion is None else motion.before_from_now)
        if motion is not None:
            phi = Rotation.from_matrix(motion.before_from_now.rotation.T @ true.rotation).as_rotvec()
            error = np.concatenate([phi, true.translation - motion.before_from_now.translation])
            turned.append(1e3 * np.linalg.norm(phi))
            moved.append(1e3 * np.linalg.norm(error[3:]))
            squares.append(error @ np.linalg.solve(motion.covariance, error) / 6)
    if not moved:
        return f"no motion found in {len(pairs)} pairs"
    drift = 100 * np.linalg.norm(chain.translation - true_chain.translation) / path
    return (
        f"drift {drift:.2f} % of {path:.1f} m, {np.median(moved):.2f} (max {np.max(moved):.1f}) mm, "
        f"{np.median(turned):.2f} (max {np.max(turned):.1f}) mrad, normalised {np.mean(squares):.2f}, "
        f"not found {lost} of {len(pairs) - 1}, {1e3 * spent / len(pairs):.0f} ms"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[4, 1, 11])
    parser.add_argument("--seed", type=int, help="of random relief")
    parser.add_argument("--rocks", type=float, default=0.006, help="share of random relief covered by rocks")
    parser.add_argument("--length", type=float, default=14.0, help="m")
    parser.add_argument("--exposure", type=float, default=256.0, help="ms")
    parser.add_argument("--predicted", action="store_true")
    asked = parser.parse_args()
    dem = None
    if asked.seed is not None:
        size = max(asked.length + 10, 20)
        dem = DemOptions(size_m=size, drive_m=asked.length, seed=asked.seed, horizon_m=120, rocks=asked.rocks)
    world = WorldOptions(terrains=tuple(asked.terrains), width_m=8, margin_m=5, dem=dem)
    points = winding(asked.length)
    corners = np.unique([*range(0, len(points), 5), len(points) - 1])
    path = tuple((x, y) for x, y, _ in points[corners].tolist())
    job = job_of(meshes=asked.meshes, world=world, soil=SoilOptions(), drive=DriveOptions(path_m=path), seed=0)
    camera, poses, found = radiances(job, [on_ground(job, *point) for point in points.tolist()])
    rig = rectification(mount_of(job.vehicle.camera(FRONT), SCALE).lens, BASELINE_M)
    rectified = [pose @ rig.left_from_rectified for pose in poses]
    for lights in ("off", "on"):
        for sun in range(len(SUNS)):
            pairs = []
            for number, light in enumerate(found):
                side = np.maximum(light[:, sun] - (light[:, -1] if lights == "off" else 0), 0)
                taken = [camera.expose(side[k], "hapke", asked.exposure, number, sun, k, lights) for k in range(2)]
                pairs.append(tone.to_8_bits(np.stack(taken).astype(np.float32)))
            text = row(pairs, rectified, StereoMotion(rig), asked.predicted)
            print(f"Sun {SUNS[sun]}, lights {lights}: {text}", flush=True)


if __name__ == "__main__":
    with reporting():
        main()
