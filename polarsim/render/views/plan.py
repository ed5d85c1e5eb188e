"""The grid of novel views: which camera meets which light, state of the rover's light, model and exposure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

from polarsim.errors import ConfigError
from polarsim.render.lamps import ROVER, Lamp
from polarsim.render.options import Model
from polarsim.render.scene import Shot
from polarsim.render.views.cameras import NamedCamera, cameras_of
from polarsim.render.views.lights import Light, lights_of, rover_lamp
from polarsim.render.views.options import Views
from polarsim.render.views.scenes import Ensemble

AUTO = "auto"


@dataclass(frozen=True)
class Picture:
    """One picture of the grid. Those of one scene, camera and light share their labels: its `ground_truth`."""

    number: int  # place in the grid, from 0
    scene: Ensemble
    camera: NamedCamera
    light: Light
    rover: bool
    model: Model
    exposure_ms: float | None  # None: auto

    @property
    def ground_truth(self) -> str:
        """Name of the instance map."""
        return f"{self.scene.name}_{self.camera.name}_{self.light.name}"

    @property
    def name(self) -> str:
        exposure = AUTO if self.exposure_ms is None else f"{self.exposure_ms:04g}"
        light = "on" if self.rover else "off"
        return f"{self.ground_truth}_{light}_{self.model.replace('_', '-')}_{exposure}"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.camera.lens.width, self.camera.lens.height

    def lamps(self, views: Views) -> dict[str, Lamp]:
        """The lamps that are on; the first throws the labelled shadows."""
        rover = {ROVER: rover_lamp(views.rover_light, self.camera)} if self.rover else {}
        return {self.light.name: self.light.lamp, **rover}

    def shot(self, views: Views, exposure_ms: float) -> Shot:
        """What makes the picture, at an exposure."""
        return Shot(self.camera, self.lamps(views), exposure_ms, self.model)

    def columns(self) -> dict[str, Any]:
        """What the index and the COCO file say of it, besides its exposure."""
        return {
            "scene": self.scene.name,
            "camera": self.camera.name,
            "light": self.light.name,
            "rover_light": "on" if self.rover else "off",
            "model": self.model,
        }


def plan(views: Views, scale: float = 1.0) -> list[Picture]:
    """All pictures: by scene, camera, light, rover light, model, exposure.

    Raises
    ------
    ConfigError
        With `zip`, other numbers of cameras than of lights; two exposures that no file name tells apart.
    FormatError
        Meshes are missing or broken.
    """
    lights = lights_of(views)
    exposures = [exposure if isinstance(exposure, float) else None for exposure in views.exposures_ms]
    variants = list(product(views.rover_light.states, views.render.models, exposures))
    pictures: list[Picture] = []
    for section in views.scenes:
        scene = Ensemble(section, views.render)
        cameras = cameras_of(views, scene.heights, scale)
        for camera, light in _pairs(views, cameras, lights):
            for rover, model, exposure in variants:
                pictures.append(Picture(len(pictures), scene, camera, light, rover, model, exposure))
    names: set[str] = set()
    for picture in pictures:
        if picture.name in names:
            raise ConfigError(f"exposures_ms: two pictures would be {picture.name}.png")
        names.add(picture.name)
    return pictures


def _pairs(
    views: Views, cameras: Sequence[NamedCamera], lights: Sequence[Light]
) -> Iterator[tuple[NamedCamera, Light]]:
    if views.combine == "product":
        return product(cameras, lights)
    eyes = 2 if views.stereo else 1
    places = len(cameras) // eyes
    if places != len(lights) and 1 not in (places, len(lights)):
        raise ConfigError(f"combine: zip of {places} cameras with {len(lights)} lights, expected as many, or one")
    number = max(places, len(lights))
    return (
        (cameras[eye + eyes * (place % places)], lights[place % len(lights)])
        for place in range(number)
        for eye in range(eyes)
    )
