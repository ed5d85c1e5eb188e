"""What the rover's front camera, and a second one beside it, show it at a moment, as its mode takes it."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TypeVar

import numpy as np

from polarsim.detect import detectors, tone
from polarsim.detect.options import PicturesOptions, StereoOptions
from polarsim.detect.predict import detect, sizes_of
from polarsim.detect.sizes import ClassSizes
from polarsim.detect.stereo.match import match
from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.errors import RoverError, about
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BOX_CLASSES, ROCK
from polarsim.render.gain import default_gain
from polarsim.render.ground_truth import boxes_of
from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP, render_view
from polarsim.render.sensor import expose, noise_of
from polarsim.rover.autonomy.hazard_grid import HazardGrid, Look
from polarsim.rover.autonomy.looks import SURE, look_of_boxes, look_of_depth
from polarsim.rover.autonomy.options import AUTO, AutonomyOptions, Mode
from polarsim.rover.cameras.lights import headlights
from polarsim.rover.cameras.live_camera import LiveScene, auto_exposure_ms, light_of
from polarsim.rover.cameras.options import NIGHT, SUN_AZIMUTHS_DEG, OnboardOptions
from polarsim.rover.drive.control import Path
from polarsim.rover.drive.state import State
from polarsim.rover.onboard.ground_view import plane_under
from polarsim.rover.vehicle.mounts import FRONT, mount_of
from polarsim.rover.vehicle.table import Vehicle
from polarsim.rover.world.surface import World

SUN = "sun"
T = TypeVar("T")
_BESIDE_M = 2.0  # of the straight line: there the ground's change is followed
_NEAREST_M = 1.5  # depth that stereo looks for


@dataclass(frozen=True)
class Light:
    """Under which Sun, with which exposure."""

    sun: str
    exposure_ms: float | str


@dataclass(frozen=True)
class Glance:
    """One moment: looks for the map, and the pair of pictures (h, w) uint8 where two were taken."""

    looks: list[Look]
    camera: Camera
    pair: tuple[np.ndarray, np.ndarray] | None = None


class Eyes:
    """The cameras of a mode; `seconds` counts CPU by part."""

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        path: Path,
        mode: Mode,
        light: Light,
        options: AutonomyOptions,
        onboard: OnboardOptions,
        seed: int,
    ) -> None:
        """
        Raises
        ------
        PolarsimError
            An unknown light, no detector where the mode has one.
        """
        self.world, self.vehicle, self.mode, self.light = world, vehicle, mode, light
        self.options, self.onboard, self.seed = options, onboard, seed
        self.mount = mount_of(vehicle.camera(FRONT), options.scale)
        self._scene = LiveScene(world, vehicle, path, options.model, _BESIDE_M)
        self._suns = (
            {} if light.sun == NIGHT else {SUN: Lamp.sun(SUN_AZIMUTHS_DEG[light.sun], options.sun_elevation_deg)}
        )
        self._lights = [vehicle.light(name) for name in options.lights]
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._ground_m = float(np.mean([wheel.position_m[2] - wheel.radius_m for wheel in vehicle.wheels]))
        self._detector = self._read_detector() if self._detects else None
        self.rectification = rectification(self.mount.lens.scaled(options.stereo_scale), options.stereo_base_m)
        self._glances = 0

    @property
    def _detects(self) -> bool:
        return self.mode in ("detector", "both")

    @property
    def pairs(self) -> bool:
        """Whether both cameras take pictures."""
        return self.mode in ("stereo", "both")

    def look(self, state: State, level: np.ndarray, grid: HazardGrid) -> Glance:
        """Take pictures of the ground as it is now and make of them what the mode makes."""
        base, links = self._timed("scene", lambda: self._scene.show(state, level))
        camera = self.mount.at(base)
        ground = self.world.height_at if self.onboard.ground == "surveyed" else plane_under(base, self._ground_m)
        if self.mode == "truth":
            boxes = self._timed("pictures", lambda: self._labels(camera))
            look = self._timed("map", lambda: look_of_boxes(boxes, np.full(len(boxes), SURE), camera, ground, grid))
            return Glance([look], camera)
        lamps = self._suns | {f"light {name}": spot for name, spot in headlights(self._lights, links).items()}
        cameras = [camera, right_of(camera, self.options.stereo_base_m)][: 2 if self.pairs else 1]
        taken = self._timed("pictures", lambda: [self._picture(one, lamps, k) for k, one in enumerate(cameras)])
        self._glances += 1
        looks, pair = [], None
        if self._detects:
            found = self._timed("detector", lambda: self._found(*taken[0]))
            sure = found[:, 4] >= grid.options.confidence
            looks.append(
                self._timed("map", lambda: look_of_boxes(found[sure, :4], found[sure, 4], camera, ground, grid))
            )
        if self.pairs:
            pair = self._timed("stereo", lambda: self._pair(taken))
            points = self._timed("stereo", lambda: self._points(pair, camera))
            looks.append(self._timed("map", lambda: look_of_depth(points, camera, grid)))
        return Glance(looks, camera, pair)

    def _labels(self, camera: Camera) -> np.ndarray:
        """(n, 4) boxes of the rocks that the renderer sees: no light is needed for that."""
        found = render_view(self._scene.surfaces, camera, {}, (), [], self._scene.render, 1)
        boxes = [box for kind, _, box in boxes_of(found.ids[NO_LAMP], self._scene.render) if kind == ROCK]
        return np.array(boxes, float).reshape(-1, 4)

    def _picture(self, camera: Camera, lamps: dict[str, Lamp], which: int) -> tuple[np.ndarray, float]:
        """(h, w) 12-bit grey values, and their exposure, ms."""
        model, render = self.options.model, self._scene.render
        light = light_of(self._scene.surfaces, camera, lamps, model, render)
        gain = render.gain.get(model, default_gain(model, render))
        exposure = self.light.exposure_ms
        if not isinstance(exposure, int | float):
            assert exposure == AUTO
            exposure = auto_exposure_ms(light, gain)
        name = ("autonomy", self.seed, self._glances, which, self.light.sun, self.light.exposure_ms)
        return expose(light, exposure * gain, render, noise_of(render, *name)), float(exposure)

    def _found(self, grey: np.ndarray, exposure_ms: float) -> np.ndarray:
        """(n, 5) boxes of rocks and their confidences."""
        assert self._detector is not None
        loaded, sizes = self._detector
        small = tone.shrink(grey, min(max(sizes.widths), max(grey.shape)))
        eight = tone.to_8_bits(small, self.onboard.pictures, exposure_ms)
        full = grey.shape[1], grey.shape[0]
        (rows,) = detect(loaded, [eight], sizes, self.onboard.prediction.nms_iou, full)
        return np.asarray(rows[rows[:, 5] == BOX_CLASSES.index(ROCK), :5], float)

    def _pair(self, taken: list[tuple[np.ndarray, float]]) -> tuple[np.ndarray, np.ndarray]:
        size = max(self.rectification.lens.width, self.rectification.lens.height)
        curve = PicturesOptions(tone="gamma")
        left, right = (tone.to_8_bits(tone.shrink(grey, size), curve) for grey, _ in taken)
        return left, right

    def _points(self, pair: tuple[np.ndarray, np.ndarray] | None, camera: Camera) -> np.ndarray:
        assert pair is not None
        options = StereoOptions(nearest_m=_NEAREST_M, farthest_m=2 * self.options.map.farthest_m)
        depth = match(*pair, self.rectification, options)
        left = self.rectification.left_from_rectified.rotate(self.rectification.lens.pixel_directions())
        points = left * depth[..., None]
        return camera.world_from_camera.apply(points.reshape(-1, 3))

    def _read_detector(self) -> tuple[detectors.LoadedDetector, ClassSizes]:
        weights = self.onboard.weights_file
        if weights is None:
            raise RoverError(f"mode {self.mode}: rover.cameras.onboard.weights names no detector")
        detector = detectors.read_detector(weights)
        with about(weights):
            loaded = detectors.load_detector(detector, FilePath.cwd(), self.onboard.prediction, 1)
        return loaded, sizes_of(detector, self.onboard.prediction)

    def _timed(self, part: str, work: Callable[[], T]) -> T:
        begun = time.process_time()
        found = work()
        self.seconds[part] += time.process_time() - begun
        return found


def right_of(camera: Camera, base_m: float) -> Camera:
    """The second camera of the pair."""
    return Camera(camera.world_from_camera @ Pose(np.eye(3), np.array([base_m, 0.0, 0.0])), camera.lens)


def rectification(lens: Lens, base_m: float) -> Rectification:
    """Of two equal lenses side by side."""
    return rectify(StereoRig(lens, lens, Pose(np.eye(3), np.array([base_m, 0.0, 0.0]))), 1.0)
