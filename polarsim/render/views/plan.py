"""Grid of novel views: combinations of cameras, lights, rover light, reflectance models and exposures."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import product
from typing import Any

import numpy as np

from polarsim.errors import ConfigError
from polarsim.geometry.poses import Pose
from polarsim.render.lamps import ROVER, SUN_RADIUS_DEG, Lamp
from polarsim.render.options import Model, RenderOptions
from polarsim.render.scene import Scene, Shot
from polarsim.render.surfaces import check_position
from polarsim.render.views.cameras import NamedCamera, cameras_of
from polarsim.render.views.moon import local_from_celestial, sun_over
from polarsim.render.views.options import LunarSuns, NearLamps, SceneSection, Suns, Views
from polarsim.run_files.picture_sets import AUTO, exposure_name
from polarsim.site import Site
from polarsim.site_parts import RigLamp

log = logging.getLogger("polarsim.render")


class NamedScene(Scene):
    """A named terrain."""

    def __init__(self, section: SceneSection, options: RenderOptions, site: Site) -> None:
        super().__init__(section.meshes, section.terrain, options, site)
        self.name = section.name

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the highest surface at points (n, 2), metres; -inf without surface."""
        top = float(self.surfaces.vertices[:, 2].max()) + 1.0
        origins = np.column_stack([points, np.full(len(points), top)])
        distance, face = self.surfaces.all.nearest(origins, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
        return np.where(face >= 0, top - distance, -np.inf)


@dataclass(frozen=True)
class NamedLight:
    """Lamp of an image, with the direction in the sky and the orientation of the stars."""

    name: str
    lamp: Lamp
    azimuth_deg: float  # from +X towards +Y
    elevation_deg: float
    moment_utc: str  # empty if the views file has no time
    sandbox_from_celestial: np.ndarray  # (3, 3) rotation


def lights_of(views: Views) -> list[NamedLight]:
    """Return all lights in the order of the views file, numbered within each name; lunar nights are omitted."""
    numbers: dict[str, int] = {}
    lights = []
    for section in views.lights:
        for lamp, azimuth, elevation, moment, sky in _LAMPS[type(section)](section):
            number = numbers[section.name] = numbers.get(section.name, -1) + 1
            name = f"{section.name}-{number:03d}"
            if name.startswith(f"{ROVER}-"):
                raise ConfigError(f"lights: the name {section.name!r} is reserved for the rover light")
            lights.append(NamedLight(name, lamp, azimuth, elevation, moment, sky))
    if not lights:
        raise ConfigError("lights: the Sun is below the horizon at all times")
    return lights


def rover_lamp(camera: NamedCamera, rig_lamp: RigLamp) -> Lamp:
    """Return the lamp of the rig of a camera; both cameras of a pair share the same light."""
    left_from_sandbox = camera.left_from_camera @ camera.world_from_camera.inverse()
    return Lamp(left_from_sandbox.inverse().apply(np.array(rig_lamp.from_camera_m)), rig_lamp.share)


PlannedLamp = tuple[Lamp, float, float, str, np.ndarray]


def _grid(section: NearLamps | Suns) -> Iterator[PlannedLamp]:
    for azimuth, elevation in product(section.azimuth_deg, section.elevation_deg):
        lamp = Lamp.sun(azimuth, elevation, section.intensity)
        if isinstance(section, NearLamps):
            towards = section.distance_m * lamp.position / np.linalg.norm(lamp.position)
            lamp = Lamp(np.array(section.centre_m) + towards, section.intensity, section.radius_m)
        yield lamp, azimuth, elevation, "", np.eye(3)


def _lunar(section: LunarSuns) -> Iterator[PlannedLamp]:
    site = (section.latitude_deg, section.longitude_deg)
    rotvec = np.array([0, 0, np.radians(section.north_deg - 90)])
    sandbox_from_local = Pose.from_rotvec(rotvec, np.zeros(3)).rotation  # local: x east, y north, z up
    for number in range(section.number):
        moment = section.start_utc + timedelta(hours=number * section.every_h)
        moment_text = moment.strftime("%Y-%m-%dT%H:%M:%SZ")
        compass, elevation = sun_over(*site, moment)
        if elevation < -SUN_RADIUS_DEG:
            log.warning("%s, %s: omitted, the Sun is %.1f deg below the horizon", section.name, moment_text, -elevation)
            continue
        azimuth = (section.north_deg - compass) % 360
        sky = sandbox_from_local @ local_from_celestial(*site, moment)
        yield Lamp.sun(azimuth, elevation, section.intensity), azimuth, elevation, moment_text, sky


_LAMPS: dict[type, Callable[..., Iterator[PlannedLamp]]] = {NearLamps: _grid, Suns: _grid, LunarSuns: _lunar}


@dataclass(frozen=True)
class PlannedImage:
    """An image of the grid. Images with equal scene, camera and light share labels, named by `ground_truth`."""

    number: int  # index in the grid, from 0
    scene: NamedScene
    camera: NamedCamera
    light: NamedLight
    rover: bool
    model: Model
    exposure_ms: float | None  # None: auto

    @property
    def ground_truth(self) -> str:
        """Name of the instance map."""
        return f"{self.scene.name}_{self.camera.name}_{self.light.name}"

    @property
    def name(self) -> str:
        exposure = exposure_name(AUTO if self.exposure_ms is None else self.exposure_ms)
        light = "on" if self.rover else "off"
        return f"{self.ground_truth}_{light}_{self.model.replace('_', '-')}_{exposure}"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.camera.lens.width, self.camera.lens.height

    def lamps(self) -> dict[str, Lamp]:
        """Return the lamps that are on; the first casts the labelled shadows."""
        rig_lamp = self.scene.site.rig_lamp
        own = {ROVER: rover_lamp(self.camera, rig_lamp)} if self.rover and rig_lamp else {}
        return {self.light.name: self.light.lamp, **own}

    def shot(self, exposure_ms: float) -> Shot:
        """Return the shot of the image at an exposure time, ms."""
        return Shot(self.camera, self.lamps(), exposure_ms, self.model)

    def columns(self) -> dict[str, Any]:
        """Return the columns of the image in the index and the COCO file, except the exposure."""
        return {
            "scene": self.scene.name,
            "camera": self.camera.name,
            "light": self.light.name,
            "rover_light": "on" if self.rover else "off",
            "model": self.model,
        }


def plan(views: Views, scale: float = 1.0) -> list[PlannedImage]:
    """Return all images, ordered by scene, camera, light, rover light, model and exposure."""
    lights, site = lights_of(views), views.read_site()
    if True in views.rover_light.states and site.rig_lamp is None:
        raise ConfigError(f"rover_light.states: the site {site.name} has no rig_lamp, expected [false]")
    exposures = [exposure if isinstance(exposure, float) else None for exposure in views.exposures_ms]
    variants = list(product(views.rover_light.states, views.render.reflectance_models, exposures))
    pictures: list[PlannedImage] = []
    for section in views.scenes:
        scene = NamedScene(section, views.render, site)
        cameras = cameras_of(views, scene.heights, scale)
        for camera in cameras:
            check_position(scene.surfaces, camera.centre, f"camera {camera.name}")
        for camera, light, (rover, model, exposure) in product(cameras, lights, variants):
            pictures.append(PlannedImage(len(pictures), scene, camera, light, rover, model, exposure))
    names: set[str] = set()
    for picture in pictures:
        if picture.name in names:
            raise ConfigError(f"two images would have the same file name {picture.name}.png")
        names.add(picture.name)
    return pictures
