"""Observations by the rover's cameras at a time, depending on the mode.

The detector uses the front camera, stereo a pair of smaller cameras on both sides of it, so that both see the ground
ahead of all wheels. Where the plan bends, the pair also looks towards it, since its field of view does not contain the
ground over which the wheels pass in a bend. In mode `truth`, cameras all around the rover observe labels.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import ndimage
from scipy.spatial.transform import Rotation

from polarsim.detect import tone
from polarsim.detect.stereo.match import match_stereo
from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.errors import RoverError
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.render.hits import cast_strip
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions, ImagingCondition
from polarsim.rover.cameras.rover_camera import RoverCamera, near_path
from polarsim.rover.drive.control import ReferencePath
from polarsim.rover.drive.state import RoverState
from polarsim.rover.localisation.localiser import Localiser
from polarsim.rover.perception.detections import FrontCameraDetector
from polarsim.rover.perception.ground_view import HeightFunction, ground_below, plane_under
from polarsim.rover.perception.hazard_grid import HazardGrid, MapUpdate
from polarsim.rover.perception.map_updates import (
    FARTHEST_M,
    bright_pixels,
    update_from_boxes,
    update_from_depth,
    update_from_pixels,
)
from polarsim.rover.perception.options import MODES_WITH_DETECTOR, Mode, OnboardDetector
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import Mount, mount_of
from polarsim.rover.vehicle.table import Vehicle
from polarsim.rover.world.surface import World
from polarsim.run_files.instances import GROUND, ROCK_IDS

_BESIDE_M = 2.0  # distance from the straight line within which changes of the ground are rendered
_MODES_WITH_DEPTH = ("stereo", "both")
_NEAREST_M = 1.5  # minimum depth of stereo
_STEREO_BASE_M = 0.3  # baseline of the stereo pair; the front camera is in the middle
_MIN_PAN_RAD = math.radians(10)  # the pair does not turn to smaller angles
MAX_PAN_RAD = math.radians(35)  # largest angle to which the pair turns, to either side
_STEREO_SCALE = 0.5  # size of the pair's pictures relative to the front camera's pictures
# Cameras of the vehicle that also observe labels, if present: six of VIPER's eight, at a small scale.
_AROUND = ("ncl", "acl", "hfp", "hfs", "hap", "has")
_AROUND_SCALE = 0.125
# Grey values above the black level (of 4,095) below which a pixel is dark: there a missing detection does not mean
# free ground, and stereo has no depth.
_LEAST_GREY = 12.0
# Standard deviation (of 255) and window below which texture is too weak for stereo matching, for example in shadow.
_EVEN, _EVEN_PX = 1.5, 5


@dataclass(frozen=True)
class Observation:
    """Map updates at a time, the true pose of the pair's left camera, and the stereo pair of pictures (h, w) uint8.

    `shown`: the picture of the front camera or of the pair's left camera, (h, w) uint8, and `found`: (n, 5) boxes in it
    above the confidence threshold.
    """

    updates: list[MapUpdate]
    left: Camera
    pair: tuple[np.ndarray, np.ndarray] | None = None
    shown: np.ndarray | None = None
    found: np.ndarray = field(default_factory=lambda: np.zeros((0, 5)))


@dataclass(frozen=True)
class _View:
    """Pictures of the stereo pair: left camera, 12-bit picture (h, w) of it, and both pictures with 8 bits."""

    left: Mount
    taken: np.ndarray
    pair: tuple[np.ndarray, np.ndarray]


class Perception:
    """Cameras and detector of a mode; `seconds` is the CPU time by part."""

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        path: ReferencePath,
        mode: Mode,
        light: ImagingCondition,
        cameras: CameraSuiteOptions,
        seed: int,
        *,
        render: RenderOptions,
        detector: OnboardDetector | None = None,
        localised: bool = False,
        threads: int = 1,
    ) -> None:
        """
        Parameters
        ----------
        cameras
            Scale, stars and Suns of the pictures; confidence and ground of the detector.
        render
            Options of the run. Shot and read noise are always on, since noise limits the range of headlights.
        localised
            Take a stereo pair in all modes, for the pose.
        threads
            Number of threads of the renderer. Does not affect the pictures.
        """
        self.world, self.vehicle, self.mode, self.light = world, vehicle, mode, light
        self.onboard, self.seed, self._threads = cameras.onboard, seed, threads
        self.pairs = localised or mode in _MODES_WITH_DEPTH  # whether the pair takes pictures
        self.mount = mount_of(vehicle.camera(FRONT), cameras.scale)
        small = mount_of(vehicle.camera(FRONT), cameras.scale * _STEREO_SCALE)
        self.left, self.right = (moved_aside(small, side * _STEREO_BASE_M / 2) for side in (-1, 1))
        around = [camera.name for camera in vehicle.cameras if camera.name in _AROUND]
        self._round = [mount_of(vehicle.camera(name), _AROUND_SCALE) for name in (FRONT, *around)]
        noisy = render.model_copy(update={"noise": True})
        near = near_path(world, path, _BESIDE_M)
        self._camera = RoverCamera(world, vehicle, near, cameras, noisy, models=(light.model,))
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._ground_m = ground_below(vehicle)
        self._detector: FrontCameraDetector | None = None
        if mode in MODES_WITH_DETECTOR:
            if detector is None:
                raise RoverError(f"mode {mode}: rover.cameras.onboard.weights is not set")
            self._detector = FrontCameraDetector(detector, self.mount.lens.width, rocks_only=True)
        self.rectification = rectification(small.lens, _STEREO_BASE_M)
        self._count = 0

    def observe(
        self,
        state: RoverState,
        level: np.ndarray,
        grid: HazardGrid,
        localiser: Localiser | None = None,
        pan: float = 0.0,
    ) -> Observation:
        """Observe the rover's state and the ground's levels (rows, columns), m.

        With a localiser, the pictures straight ahead correct its pose, and updates are placed by this pose, not by the
        state. In modes with depth, the pair also looks at the angle `pan`, rad to the left, if it is large enough.
        """
        with self._timed("scene"):
            base = self._camera.show_state(state, level)
        with self._timed("pictures"):
            front = None if self._detector is None else self._picture(self.mount.at(base), "front")
        views = [self._look(base, 0.0)] if self.pairs else []
        if self.mode in _MODES_WITH_DEPTH and abs(pan) >= _MIN_PAN_RAD:
            views.append(self._look(base, min(max(pan, -MAX_PAN_RAD), MAX_PAN_RAD)))
        self._count += 1
        pair = views[0].pair if views else None
        if localiser is not None and pair is not None:
            with self._timed("localisation"):
                localiser.add_pair(*pair)
        believed = base if localiser is None else localiser.pose
        camera, left = self.mount.at(believed), self.left.at(base)
        shown = pair[0] if pair else None
        detections = np.zeros((0, 5))
        if self.mode == "truth":
            return Observation([self._update_from_labels(base, believed, grid)], left, pair, shown)
        updates: list[MapUpdate] = []
        if self._detector is not None:
            assert front is not None
            with self._timed("detector"):
                (shown,), (rows,) = self._detector.detect([front])
            rocks = (rows[:, 5] == BOX_CLASSES.index(ROCK)) & (rows[:, 4] >= self.onboard.confidence)
            detections = np.asarray(rows[rocks, :5], float)
            with self._timed("map"):
                lit, ground = bright_pixels(front, _LEAST_GREY), self._ground(believed, localiser is None)
                updates.append(update_from_boxes(detections[:, :4], detections[:, 4], lit, camera, ground, grid))
            detections[:, :4] *= shown.shape[1] / camera.lens.width
        if self.mode in _MODES_WITH_DEPTH:
            for view in views:
                with self._timed("stereo"):
                    points = self._points(view, view.left.at(believed))
                with self._timed("map"):
                    updates.append(update_from_depth(points, camera, grid))
        return Observation(updates, left, pair, shown, detections)

    def _look(self, base: Pose, pan: float) -> _View:
        """Take the pictures of the pair, turned by an angle, rad to the left."""
        mounts = {"left": self.left, "right": self.right}
        if pan:
            mounts = {f"{name} turned": self._turned(mount, pan) for name, mount in mounts.items()}
        with self._timed("pictures"):
            taken = [self._picture(mount.at(base), name) for name, mount in mounts.items()]
        with self._timed("stereo"):
            left, right = tone.to_8_bits(np.stack(taken))  # by the same curve, since matching compares grey values
        return _View(next(iter(mounts.values())), taken[0], (left, right))

    def _turned(self, mount: Mount, pan: float) -> Mount:
        """Turn a mount about the vertical through the front camera, rad to the left."""
        axis = Pose(np.eye(3), self.mount.base_from_camera.translation)
        turn = Pose(Rotation.from_euler("z", pan).as_matrix(), np.zeros(3))
        return replace(mount, base_from_camera=axis @ turn @ axis.inverse() @ mount.base_from_camera)

    def _ground(self, base: Pose, known: bool) -> HeightFunction:
        """Return the height of the ground; a surveyed ground is raised to the wheels if the pose is not known."""
        if self.onboard.ground != "surveyed":
            return plane_under(base, self._ground_m)
        if known:
            return self.world.height_at
        x, y, z = base.apply(np.array([0.0, 0.0, self._ground_m])).tolist()
        rise = z - float(self.world.height_at(x, y))
        return lambda x, y: self.world.height_at(x, y) + rise

    def _update_from_labels(self, base: Pose, believed: Pose, grid: HazardGrid) -> MapUpdate:
        """Return the update of labels of all cameras, placed by the pose in which the rover believes itself."""
        with self._timed("pictures"):
            observed = [self._visible_points(mount.at(base)) for mount in self._round]
        with self._timed("map"):
            points, rock = (np.concatenate(parts) for parts in zip(*observed, strict=True))
            above, on_rock = np.zeros(len(points)), rock > 0
            above[on_rock] = points[on_rock, 2] - self._ground(base, True)(*points[on_rock, :2].T)
            if believed is not base:
                points = (believed @ base.inverse()).apply(points)
            return update_from_pixels(points, rock, above, self.mount.at(believed), grid)

    def _visible_points(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        """Return points (n, 3) of the world by pixel, and (n,) rock numbers, 0 on the ground; independent of light."""
        surfaces = self._camera.scene.surfaces
        hits = cast_strip(surfaces, camera, slice(0, camera.lens.height), smooth=False)
        ids = surfaces.id_of_face.take(hits.face)
        kept = (ids == GROUND) | (ids >= ROCK_IDS)  # excludes the rover's body
        return hits.point[kept].astype(float), np.maximum(ids[kept] - ROCK_IDS, 0)

    def _picture(self, camera: Camera, which: str) -> np.ndarray:
        """Return the 12-bit picture (h, w)."""
        light = self.light
        name = ("autonomy", self.seed, self._count, which, light.sun, light.exposure_ms)
        return self._camera.picture(camera, light, *name, threads=self._threads)[0]

    def _points(self, view: _View, camera: Camera) -> np.ndarray:
        """Return (n, 3) points of the world by pixel of the left camera; NaN without a depth."""
        depth = match_stereo(*view.pair, self.rectification, _NEAREST_M, 2 * FARTHEST_M)
        depth = np.where(bright_pixels(view.taken, _LEAST_GREY) & has_texture(view.pair[0]), depth, np.nan)
        rays = self.rectification.left_from_rectified.rotate(self.rectification.lens.pixel_directions())
        return camera.world_from_camera.apply((rays * depth[..., None]).reshape(-1, 3))

    @contextmanager
    def _timed(self, part: str) -> Iterator[None]:
        start = time.process_time()
        yield
        self.seconds[part] += time.process_time() - start


def has_texture(grey: np.ndarray) -> np.ndarray:
    """Return (h, w) bool: pixels of a picture (h, w) uint8 with texture around them."""
    values = grey.astype(np.float32)
    mean, square = (ndimage.uniform_filter(image, _EVEN_PX) for image in (values, values**2))
    return np.asarray(square - mean**2 > _EVEN**2)


def moved_aside(mount: Mount, right_m: float) -> Mount:
    """Return the mount of an equal camera at a distance to the right."""
    return replace(mount, base_from_camera=mount.base_from_camera @ Pose(np.eye(3), np.array([right_m, 0.0, 0.0])))


def rectification(lens: Lens, base_m: float) -> Rectification:
    """Return the rectification of two equal lenses side by side."""
    return rectify(StereoRig(lens, lens, Pose(np.eye(3), np.array([base_m, 0.0, 0.0]))), 1.0)
