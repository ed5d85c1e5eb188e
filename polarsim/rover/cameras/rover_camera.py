"""Pictures of the rover's cameras: light of Suns and headlights, lens, stars, sensor.

All pictures of the rover are made here: those of a recorded drive (`suite`), those by which the rover decides
(`perception.observation`) and those of the Gymnasium environment.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.render.gain import gain_of
from polarsim.render.olat import NO_LAMP, Rendering, render_view
from polarsim.render.optics import imaged, through_lens
from polarsim.render.options import Material, Model, RenderOptions
from polarsim.render.sensor import expose, noise_of
from polarsim.render.views.options import StarField
from polarsim.render.views.stars import Sky, sky_of, star_radiance
from polarsim.rover.cameras.bodywork import Body, body_of, links_at
from polarsim.rover.cameras.lights import Sun, headlights, named_sun
from polarsim.rover.cameras.options import ROVER_RENDER, CameraSuiteOptions, Light
from polarsim.rover.cameras.render_scene import RenderScene, rocks_of
from polarsim.rover.cameras.tracks import Lattice, WheelTracks
from polarsim.rover.drive.control import Path
from polarsim.rover.drive.state import State
from polarsim.rover.vehicle.mounts import pose_of
from polarsim.rover.vehicle.table import WHEELS, LightPart, Vehicle
from polarsim.rover.world.surface import World
from polarsim.run_files.instances import BACKGROUND
from polarsim.run_files.picture_sets import AUTO

BRIGHT_STARS = 300.0  # flux of the stars of the paper's videos over that of real ones
GROUND_ALBEDO = 0.12  # of lunar soil; albedos of the body are relative to it
# Factor of the body's albedos: upright walls receive seven times the ground's light from a Sun at 8 degrees, and
# would be white at all exposures that show the ground.
_BODY_DARKER = 0.25
_CLIPPED_PERCENT = 99.0  # auto exposure puts this percentile of the light at the sensor's white
_EXPOSURES_MS = (1.0, 10_000.0)  # limits of auto exposure


class RoverCamera:
    """World, rover and light of one moment, and pictures of them by any camera.

    Call `show` or `show_state` before the first picture.
    """

    def __init__(
        self,
        world: World,
        vehicle: Vehicle,
        followed: np.ndarray,
        options: CameraSuiteOptions,
        render: RenderOptions,
        *,
        models: Sequence[Model],
        finer: int = 1,
    ) -> None:
        """
        Parameters
        ----------
        followed : (rows, columns) bool
            Nodes of the ground whose changes are drawn.
        render
            The run's options; `ROVER_RENDER` and `models` replace some of them.
        finer
            Cells of the rendered ground along one cell of the world's.

        Raises
        ------
        RoverError
            Too many rocks.
        """
        self.vehicle, body = vehicle, body_of(vehicle)
        self._sun_elevation_deg = options.sun_elevation_deg
        self.render_options = _resolved(render, models, body)
        stars = StarField(intensity=BRIGHT_STARS if options.stars == "bright" else 1.0)
        self.sky: Sky | None = None if options.stars == "none" else sky_of(stars)
        lattice = Lattice(world.x0, world.y0, world.cell, world.level)
        tracks = WheelTracks(lattice, followed, finer)
        self.scene = RenderScene(tracks, rocks_of(world), body, skirt_m=render.skirt_m, around=world.around)

    def show(self, level: np.ndarray, links: Mapping[str, Pose]) -> None:
        """Move the ground to levels (rows, columns), m, and the rover's links to their poses in the world."""
        self.links = links
        self.scene.show(level, links)

    def show_state(self, state: State, level: np.ndarray) -> Pose:
        """Move on to a state of the physics and return `world_from_base`."""
        base = pose_of(state.position, state.rotation)
        positions = np.stack([state.wheel(name) for name in ("x_m", "y_m", "z_m")], axis=1)
        quaternions = np.stack([state.wheel(name) for name in ("qw", "qx", "qy", "qz")], axis=1)
        wheels = {
            code: pose_of(position, quaternion)
            for code, position, quaternion in zip(WHEELS, positions, quaternions, strict=True)
        }
        lift, steer = (dict(zip(WHEELS, state.wheel(name), strict=True)) for name in ("lift_m", "steer_rad"))
        self.show(level, links_at(self.vehicle, base, wheels, lift, steer))
        return base

    def render(
        self,
        camera: Camera,
        suns: Mapping[str, Sun],
        lights: Sequence[LightPart],
        *,
        labels: bool,
        threads: int = 1,
    ) -> Rendering:
        """Return radiance by model and Sun, each with the rover's lights, and ids by Sun where `labels` is true.

        Shadows among the ids are those of the Sun: at night there are none.
        """
        options, models, surfaces = self.render_options, self.render_options.models, self.scene.surfaces
        lamps = {name: sun.lamp for name, sun in suns.items() if sun.lamp is not None}
        own = {f"light {name}": spot for name, spot in headlights(lights, self.links).items()}  # no Sun's name
        shadows = list(lamps) if labels else None if self.sky is None else []
        found = render_view(surfaces, camera, lamps | own, models, shadows, options, threads)
        whole = found.whole
        light = {
            (model, name): _sum([whole[model, lamp] for lamp in (name, *own) if (model, lamp) in whole], camera)
            for model in models
            for name in suns
        }
        radiance = through_lens(light, lamps, surfaces, camera, options, threads)
        if self.sky is not None:
            empty = found.ids[NO_LAMP] == BACKGROUND
            for name, sun in suns.items():
                stars = imaged(empty * star_radiance(self.sky, sun.world_from_celestial, camera), camera.lens, options)
                radiance |= {(model, name): radiance[model, name] + stars for model in models}
        ids = {name: found.ids[name if name in lamps else NO_LAMP] for name in (NO_LAMP, *suns)} if labels else {}
        return Rendering(radiance, ids)

    def expose(self, radiance: np.ndarray, model: Model, exposure_ms: float, *name: object) -> np.ndarray:
        """Return the 12-bit picture (h, w) uint16 of radiance (h, w); its noise is drawn by its `name`."""
        noise = noise_of(self.render_options, *name)
        return expose(radiance, exposure_ms * self._gain(model), self.render_options, noise)

    def picture(self, camera: Camera, light: Light, *name: object, threads: int = 1) -> tuple[np.ndarray, float]:
        """Return the 12-bit picture (h, w) uint16 of the moment in a light, and its exposure, ms.

        Raises
        ------
        ConfigError
            A light that the vehicle does not have.
        """
        sun = named_sun(light.sun, self._sun_elevation_deg)
        lights = [self.vehicle.light(own) for own in light.lights]
        found = self.render(camera, {sun.name: sun}, lights, labels=False, threads=threads)
        radiance, exposure_ms = found.olat_images[light.model, sun.name], light.exposure_ms
        if isinstance(exposure_ms, str):
            assert exposure_ms == AUTO
            exposure_ms = auto_exposure_ms(radiance, self._gain(light.model))
        return self.expose(radiance, light.model, exposure_ms, *name), float(exposure_ms)

    def _gain(self, model: Model) -> float:
        return gain_of(model, self.render_options)


def _resolved(render: RenderOptions, models: Sequence[Model], body: Body) -> RenderOptions:
    """Return a run's options with `ROVER_RENDER`, these models and the materials of the rover's body."""
    factor = _BODY_DARKER / GROUND_ALBEDO
    own = {f"body{n}": Material(albedo=max(albedo, 0.01) * factor) for n, albedo in enumerate(body.albedo)}
    return render.model_copy(update={**ROVER_RENDER, "models": tuple(models), "materials": {**own, **render.materials}})


def auto_exposure_ms(light: np.ndarray, gain: float) -> float:
    """Return the exposure that puts the brightest percent of the light (h, w) at the sensor's white or above."""
    bright = float(np.percentile(light, _CLIPPED_PERCENT))
    return float(np.clip((WHITE_LEVEL - BLACK_LEVEL) / max(bright * gain, 1e-9), *_EXPOSURES_MS))


def near_path(world: World, path: Path, beside_m: float) -> np.ndarray:
    """Return (rows, columns) bool: nodes of the world's ground within `beside_m` of a path."""
    x, y = np.meshgrid(world.x, world.y)
    points = np.stack([x, y], axis=-1)
    near = np.zeros(x.shape, bool)
    for start, end in zip(path.points, path.points[1:], strict=False):
        along = end - start
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        near |= np.linalg.norm(points - start - share[..., None] * along, axis=-1) < beside_m
    return near


def _sum(images: Iterable[np.ndarray], camera: Camera) -> np.ndarray:
    """Return the sum of images (h, w); without any there is no light."""
    parts = list(images)
    if not parts:
        return np.zeros(camera.lens.shape, np.float32)
    return np.asarray(np.sum(parts, axis=0)) if len(parts) > 1 else parts[0]
