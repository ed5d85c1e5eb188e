"""Render the images of a recorded drive: radiance by model and Sun, and instance ids."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from polarsim.errors import RoverError
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import Lamp
from polarsim.render.olat import Rendering
from polarsim.render.options import Model, RenderOptions
from polarsim.rover.cameras.bodywork import links_at
from polarsim.rover.cameras.lights import named_sun
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.rover_camera import RoverCamera
from polarsim.rover.cameras.tracks import GrouserMark, Tread, marks_of, stamp_marks
from polarsim.rover.drive.trace import Trace
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.vehicle.table import Vehicle


class CameraSuite:
    """Images of a recorded drive. A frame is a picture time; `show` moves to a frame, in the order of time."""

    def __init__(
        self,
        trace: Trace,
        vehicle: Vehicle,
        options: CameraSuiteOptions,
        render: RenderOptions = RenderOptions(),  # noqa: B008 (frozen)
        *,
        seed: int = 0,
    ) -> None:
        self.trace, self.vehicle, self.options, self.seed, self._render = trace, vehicle, options, seed, render
        self.mounts = {name: mount_of(vehicle.camera(name), options.scale) for name in options.views}
        for name in options.views:
            if vehicle.camera(name).link != "base_link":
                raise RoverError(f"camera {name}: on link {vehicle.camera(name).link}, base_link was expected")
        self.suns: dict[str, Lamp | None] = {name: named_sun(name, options.sun_elevation_deg) for name in options.suns}
        self.lights = [vehicle.light(name) for name in options.lights]
        self._marks = _marks(trace, vehicle)
        self._tread = _tread(vehicle)
        self._frame, self._level = -1, trace.world.level.copy()

    @property
    def frames(self) -> list[int]:
        """Return the indices of the frames to render."""
        return list(range(0, len(self.trace.tracks.time), self.options.every))

    def show(self, frame: int) -> None:
        """Move ground, marks and rover to the same or a later frame; marks cannot be removed."""
        assert frame >= self._frame, "frames are shown in order"
        before = -np.inf if self._frame < 0 else float(self.trace.tracks.time[self._frame])
        for number in range(self._frame + 1, frame + 1):
            self.trace.tracks.apply(number, self._level)
        now = float(self.trace.tracks.time[frame])
        new = [mark for mark in self._marks if before < mark.time_s <= now]
        stamp_marks(self.rover_camera.scene.tracks, new, self._tread)
        self.rover_camera.show(self._level, self.links_at(now))
        self._frame = frame

    def links_at(self, time_s: float) -> dict[str, Pose]:
        """Return the poses of all links."""
        codes = [wheel.code for wheel in self.vehicle.wheels]
        return links_at(
            self.vehicle,
            self.trace.pose_at(time_s),
            {code: self.trace.pose_at(time_s, code) for code in codes},
            {code: self.trace.value_at(time_s, f"{code}_lift_m") for code in codes},
            {code: self.trace.value_at(time_s, f"{code}_steer_rad") for code in codes},
        )

    def camera(self, view: str, frame: int) -> Camera:
        """Return the camera of a view at a frame, in the world frame."""
        return self.mounts[view].at(self.trace.pose_at(float(self.trace.tracks.time[frame])))

    def render(self, view: str, sun_names: Sequence[str], threads: int = 1) -> Rendering:
        """Render a view of the current frame; see `RoverCamera.render`."""
        camera, suns = self.camera(view, self._frame), {name: self.suns[name] for name in sun_names}
        return self.rover_camera.render(camera, suns, self.lights, labels=True, threads=threads)

    def exposed(self, rendering: Rendering, view: str, sun: str, model: Model, exposure_ms: float) -> np.ndarray:
        """Return the 12-bit image (h, w) uint16 of the current frame."""
        name = ("rover", self.seed, self._frame, view, sun, model, exposure_ms)
        return self.rover_camera.expose(rendering.olat_images[model, sun], model, exposure_ms, *name)

    @cached_property
    def rover_camera(self) -> RoverCamera:
        """Return the scene and camera, built on first use."""
        world, options = self.trace.world, self.options
        changed = np.zeros(world.level.shape, bool)
        changed.ravel()[self.trace.tracks.cell] = True
        return RoverCamera(
            world, self.vehicle, changed, options, self._render, models=options.models, finer=options.finer
        )


def _marks(trace: Trace, vehicle: Vehicle) -> list[GrouserMark]:
    """Return the marks of all wheels in the order of time."""
    table = trace.table
    marks = []
    for wheel in vehicle.wheels:
        if wheel.grousers:
            code = wheel.code
            marks += marks_of(
                table["time_s"].to_numpy(),
                table[f"{code}_spin_rad"].to_numpy(),
                table[[f"{code}_{name}" for name in ("x_m", "y_m", "z_m")]].to_numpy(),
                table[[f"{code}_{name}" for name in ("qw", "qx", "qy", "qz")]].to_numpy(),
                table[f"{code}_contact"].isin(["soil", "both"]).to_numpy(),
                wheel.grousers,
            )
    return sorted(marks, key=lambda mark: mark.time_s)


def _tread(vehicle: Vehicle) -> Tread:
    wheel = vehicle.wheels[0]
    return Tread(max(wheel.grousers, 1), wheel.outer_radius_m, wheel.width_m)
