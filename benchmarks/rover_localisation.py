"""Error of the rover's estimated pose on a straight drive, by wheels and IMU and with stereo under several Suns.

`python benchmarks/rover_localisation.py MESHES OUT.csv [--metres 62] [--seeds 1] [--suns 1 2 3 4] [--scale 0.5]`

The rover follows a straight line over a random relief with craters by its true pose, so that all estimates are of the
same drive. Each second all Suns take the stereo pair that an autonomous drive takes. OUT.csv contains the errors of
each second. Printed is a row per seed and source: way, errors at the end along the path, to the left and upwards,
heading error, normalised squared error (6 if the covariance is right), motions that were not found or rejected, and the
largest share of the error in the way from 5 m on. Rocks, if any, have the shapes of the meshes of `--terrain`; the
ground of the pictures has no ruts.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.detect import tone
from polarsim.formats import tables
from polarsim.geometry.poses import Pose
from polarsim.render.hits import one_blas_thread
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.rover.cameras.lights import named_sun
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.rover_camera import RoverCamera
from polarsim.rover.drive.job import DriveJob, job_of
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.drive.ride import CONTROL_HZ, RunningDrive
from polarsim.rover.drive.state import RoverState
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.localisation.stereo_motion import StereoMotion
from polarsim.rover.perception.observation import moved_aside, rectification
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.world.options import DemOptions, WorldOptions
from polarsim.schemas.rover import ODOMETRY

CONFIG = Path(__file__).parents[1] / "config"
BASE_M, EXPOSURE_MS, PAIRS_HZ = 0.3, 256.0, 1.0  # as in autonomous drives
LEAST_M = 5.0


class Estimates:
    """Localisers of all sources and their errors each second, for a `RunningDrive` that steers by the true pose."""

    def __init__(self, job: DriveJob, suns: list[str], scale: float) -> None:
        self._mount = mount_of(job.vehicle.camera(FRONT), 0.5 * scale)  # stereo matches pictures of half the size
        rig = rectification(self._mount.lens, BASE_M)
        options = CameraSuiteOptions(scale=scale)
        self._suns = {sun: named_sun(sun, options.sun_elevation_deg) for sun in suns}
        still = np.zeros(job.world.level.shape, bool)  # without ruts
        self._camera = RoverCamera(
            job.world, job.vehicle, still, options, RenderOptions(noise=True), models=options.models[:1]
        )
        self._model, self._job, self._count = options.models[0], job, 0
        gravity = job.soil_options.gravity_m_s2
        camera = self._mount.base_from_camera @ rig.left_from_rectified
        self.localisers = {ODOMETRY: Localiser(job.vehicle, job.seed, gravity)} | {
            sun: Localiser(job.vehicle, job.seed, gravity, stereo=StereoMotion(rig), base_from_camera=camera)
            for sun in suns
        }
        self.way, self.plane_pose = 0.0, (0.0, 0.0, 0.0)
        self.rows: list[tuple[object, ...]] = []
        self._last: np.ndarray | None = None

    def read(self, state: RoverState) -> None:
        for localiser in self.localisers.values():
            localiser.read(state)
        self.plane_pose = (float(state.position[0]), float(state.position[1]), state.heading)
        if self._count % round(CONTROL_HZ / PAIRS_HZ) == 0:
            self._each_second(state)
        self._count += 1

    def log(self) -> None:
        pass  # `rows` are stored each second

    def _each_second(self, state: RoverState) -> None:
        base = self._camera.show_state(state, self._job.world.level)
        pairs = self._pairs(base) if self._suns else {}
        self.way += 0.0 if self._last is None else float(np.linalg.norm(state.position - self._last))
        self._last = state.position
        for source, localiser in self.localisers.items():
            if source in pairs:
                localiser.add_pair(*pairs[source])
            self.rows.append((self._job.seed, source, state.time, self.way, *errors(localiser, base)))

    def _pairs(self, base: Pose) -> dict[str, np.ndarray]:
        """Return the 8-bit stereo pair (2, h, w) of each Sun."""
        pair = (mount.at(base) for mount in (self._mount, moved_aside(self._mount, BASE_M)))
        views = [self._camera.render(camera, self._suns, [], labels=False) for camera in pair]
        name = ("localisation", self._job.seed, self._count)
        return {
            sun: tone.to_8_bits(
                np.stack(
                    [
                        self._camera.expose(
                            view.olat_images[self._model, sun], self._model, EXPOSURE_MS, *name, sun, which
                        )
                        for which, view in enumerate(views)
                    ]
                )
            )
            for sun in self._suns
        }


ERRORS = ("along_m", "left_m", "up_m", "heading_deg", "normalised", "lost", "rejected")


def errors(localiser: Localiser, true: Pose) -> tuple[float, ...]:
    """Return `ERRORS` of the estimate now."""
    estimate = localiser.pose
    offset = true.rotation.T @ (estimate.translation - true.translation)
    turned = Rotation.from_matrix(estimate.rotation @ true.rotation.T).as_rotvec()
    known = localiser.filter.normalised_error(true)
    return (*offset.tolist(), math.degrees(turned[2]), known, float(localiser.lost), float(localiser.filter.rejected))


def drive(job: DriveJob, suns: list[str], scale: float) -> pd.DataFrame:
    """Return the errors of all sources by second: seed, source, time_s, way_m, `ERRORS`."""
    estimates = Estimates(job, suns, scale)
    ride = RunningDrive(job, estimator=estimates)
    with one_blas_thread():
        while ride.ended is None:
            ride.run_for(10.0)
            print(f"seed {job.seed}: {estimates.way:.1f} m", flush=True)
    return pd.DataFrame(estimates.rows, columns=["seed", "source", "time_s", "way_m", *ERRORS])


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return a row per seed and source: errors at the end, and the error as a share of the way."""
    distance = np.linalg.norm(rows[["along_m", "left_m", "up_m"]], axis=1)
    shares = rows.assign(error_m=distance, share_percent=100 * distance / rows["way_m"].clip(lower=LEAST_M))
    grouped = shares.groupby(["seed", "source"], sort=False)
    last = grouped.last().assign(largest_percent=grouped["share_percent"].max())
    return last.reset_index()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--metres", type=float, default=62.0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--suns", nargs="*", default=["1", "2", "3", "4"])
    parser.add_argument("--scale", type=float, default=0.5, help="of the front camera, as rover.cameras.scale")
    parser.add_argument("--terrain", type=int, default=11, help="shapes of rocks")
    parser.add_argument("--rocks", type=float, default=0.0, help="share of the ground covered by rocks")
    asked = parser.parse_args()
    found = []
    for seed in range(asked.seeds):
        dem = DemOptions(size_m=asked.metres + 20, horizon_m=60.0, drive_m=asked.metres, rocks=asked.rocks, seed=seed)
        world = WorldOptions(terrains=(asked.terrain,), width_m=5.0, margin_m=2.0, dem=dem)
        soil = SoilOptions(table=CONFIG / "soils.csv", step_s=0.002)
        line = DriveOptions(vehicle=CONFIG / "viper.yaml", picture_hz=1.0)
        job = job_of(meshes=asked.meshes, world=world, soil=soil, drive=line, seed=seed)
        found.append(drive(job, asked.suns, asked.scale))
        tables.write_csv(asked.out, pd.concat(found, ignore_index=True))
    print(summary(pd.concat(found, ignore_index=True)).round(3).to_string())


if __name__ == "__main__":
    with reporting():
        main()
