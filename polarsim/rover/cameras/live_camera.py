"""One camera of a rover that drives now: what it sees of the world as it is at this moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from polarsim.detect.tone import to_8_bits
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, USUAL_EXPOSURE_MS, WHITE_LEVEL
from polarsim.render.lamps import Spot
from polarsim.render.options import Model
from polarsim.rover.cameras.bodywork import body_of, links_at
from polarsim.rover.cameras.lights import Sun, headlights, sun_at
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.render_scene import MovingSurfaces, RenderScene, rocks_of
from polarsim.rover.cameras.rover_camera import Imaging
from polarsim.rover.cameras.tracks import Lattice, WheelTracks
from polarsim.rover.drive.control import Path
from polarsim.rover.drive.state import State
from polarsim.rover.vehicle.mounts import FRONT, mount_of, pose_of
from polarsim.rover.vehicle.table import WHEELS, Vehicle
from polarsim.rover.world.surface import World
from polarsim.run_files.picture_sets import AUTO

SUN = "sun"
_CLIPPED_PERCENT = 99.0  # auto exposure puts this percentile of the light at the sensor's white
_EXPOSURES_MS = (1.0, 10_000.0)  # within which it chooses
BESIDE_M = 1.5  # from the path: farther away the ground is drawn as it was before the drive


@dataclass(frozen=True)
class LiveCameraOptions:
    """Which camera, how large its pictures are, and in what light."""

    camera: str = FRONT
    scale: float = 1 / 16
    sun_azimuth_deg: float | None = 225.0  # from east to north; none: night
    sun_elevation_deg: float = 8.0
    model: Model = "hapke"
    exposure_ms: float | Literal["auto"] = USUAL_EXPOSURE_MS
    lights: tuple[str, ...] = ()  # of the vehicle's table, that are on
    # Lens, sensor, reflectance, stars and far ground, as the section `rover.cameras` has them.
    cameras: CameraSuiteOptions = field(default_factory=CameraSuiteOptions)

    def size(self, vehicle: Vehicle) -> tuple[int, int]:
        """Width and height of its pictures, px."""
        lens = mount_of(vehicle.camera(self.camera), self.scale).lens
        return lens.width, lens.height


class LiveScene:
    """The scene of a drive under way; the ground is followed within `beside_m` of a path.

    The ground has the drive's own cells, whatever `cameras.finer`, and no grouser marks: finer ground takes too long
    between two moments.
    """

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        path: Path,
        cameras: CameraSuiteOptions,
        model: Model,
        beside_m: float = BESIDE_M,
    ) -> None:
        self._vehicle, self._model, body = vehicle, model, body_of(vehicle)
        own = cameras.model_copy(update={"models": (model,)})
        self.imaging = Imaging.of(own, body)
        lattice = Lattice(world.x0, world.y0, world.cell, world.level)
        tracks = WheelTracks(lattice, _near(world, path, beside_m), finer=1)
        reach = {"skirt_m": own.render.skirt_m, "far_m": own.far_m}
        self._scene = RenderScene(tracks, rocks_of(world), body, around=world.around, **reach)

    def picture(
        self,
        camera: Camera,
        sun: Sun,
        spots: Mapping[str, Spot],
        exposure_ms: float | str,
        *name: object,
        threads: int = 1,
    ) -> tuple[np.ndarray, float]:
        """Return the 12-bit picture (h, w) uint16 of the moment that is shown, and its exposure, ms.

        Parameters
        ----------
        exposure_ms
            A number, or `auto`.
        name
            Names the picture, and so draws its noise.
        """
        found = self.imaging.render(self.surfaces, camera, {sun.name: sun}, spots, labels=False, threads=threads)
        radiance = found.olat_images[self._model, sun.name]
        if isinstance(exposure_ms, str):
            assert exposure_ms == AUTO
            exposure_ms = auto_exposure_ms(radiance, self.imaging.gain(self._model))
        return self.imaging.expose(radiance, self._model, exposure_ms, *name), float(exposure_ms)

    @property
    def surfaces(self) -> MovingSurfaces:
        return self._scene.surfaces

    def show(self, state: State, level: np.ndarray) -> tuple[Pose, dict[str, Pose]]:
        """Move on to the rover's state and the ground's levels; `world_from_base`, and the poses of all links."""
        base = pose_of(state.position, state.rotation)
        links = self._links(state, base)
        self._scene.show(level, links)
        return base, links

    def _links(self, state: State, base: Pose) -> dict[str, Pose]:
        positions = np.stack([state.wheel(name) for name in ("x_m", "y_m", "z_m")], axis=1)
        quaternions = np.stack([state.wheel(name) for name in ("qw", "qx", "qy", "qz")], axis=1)
        wheels = {
            code: pose_of(position, quaternion)
            for code, position, quaternion in zip(WHEELS, positions, quaternions, strict=True)
        }
        lift = dict(zip(WHEELS, state.wheel("lift_m"), strict=True))
        return links_at(self._vehicle, base, wheels, lift, dict(zip(WHEELS, state.wheel("steer_rad"), strict=True)))


class LiveCamera:
    """A camera; the ground is followed within `BESIDE_M` of a path. `seed` draws the noise of its pictures."""

    def __init__(self, world: World, vehicle: Vehicle, path: Path, options: LiveCameraOptions, seed: int = 0) -> None:
        self._options, self._seed = options, seed
        self._mount = mount_of(vehicle.camera(options.camera), options.scale)
        self._scene = LiveScene(world, vehicle, path, options.cameras, options.model)
        self._sun = sun_at(SUN, options.sun_azimuth_deg, options.sun_elevation_deg)
        self._lights = [vehicle.light(name) for name in options.lights]

    def grey(self, state: State, level: np.ndarray) -> np.ndarray:
        """Return the 12-bit picture (h, w) uint16 of the rover's state and the ground's levels."""
        base, links = self._scene.show(state, level)
        spots, name = headlights(self._lights, links), ("live", self._seed, self._options.camera, state.time)
        return self._scene.picture(self._mount.at(base), self._sun, spots, self._options.exposure_ms, *name)[0]

    def picture(self, state: State, level: np.ndarray) -> np.ndarray:
        """Return `grey` as (h, w, 1) uint8, by the detectors' tone curve `gamma`."""
        return to_8_bits(self.grey(state, level))[..., None]


def auto_exposure_ms(light: np.ndarray, gain: float) -> float:
    """The exposure that puts the brightest percent of the light (h, w) at the sensor's white or above."""
    bright = float(np.percentile(light, _CLIPPED_PERCENT))
    return float(np.clip((WHITE_LEVEL - BLACK_LEVEL) / max(bright * gain, 1e-9), *_EXPOSURES_MS))


def _near(world: World, path: Path, beside_m: float) -> np.ndarray:
    """(rows, columns) bool: nodes within `beside_m` of the path."""
    x, y = np.meshgrid(world.x, world.y)
    points = np.stack([x, y], axis=-1)
    near = np.zeros(x.shape, bool)
    for start, end in zip(path.points, path.points[1:], strict=False):
        along = end - start
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        near |= np.linalg.norm(points - start - share[..., None] * along, axis=-1) < beside_m
    return near
