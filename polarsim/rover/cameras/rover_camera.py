"""Images of the rover's cameras: light of Suns and headlights, lens, stars, sensor.

All callers use this module: recorded drives (`suite`), perception (`perception.observation`) and the Gymnasium
environment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.render.gain import gain_of
from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP, Rendering, render_view
from polarsim.render.optics import apply_lens, apply_lens_to_olat_images
from polarsim.render.options import Model, RenderOptions
from polarsim.render.parameters import Material
from polarsim.render.sensor import expose, noise_generator
from polarsim.render.views.stars import Sky, build_sky, star_radiance
from polarsim.rover.cameras.bodywork import Bodywork, body_of, links_at
from polarsim.rover.cameras.lights import headlights, named_sun
from polarsim.rover.cameras.options import ROVER_RENDER, CameraSuiteOptions, ImagingCondition
from polarsim.rover.cameras.render_scene import RenderScene
from polarsim.rover.cameras.tracks import NodeGrid, WheelTracks
from polarsim.rover.drive.control import ReferencePath
from polarsim.rover.drive.state import RoverState
from polarsim.rover.vehicle.mounts import pose_of_quaternion
from polarsim.rover.vehicle.table import WHEELS, LightPart, Vehicle
from polarsim.rover.world.surface import World
from polarsim.run_files.instances import BACKGROUND
from polarsim.run_files.picture_sets import AUTO
from polarsim.site import polar

BRIGHT_STARS = 300.0  # flux of stars in the paper's videos relative to real stars
GROUND_ALBEDO = 0.12  # of lunar soil; albedos of the body are relative to this value
# Factor of the body's albedos: with a Sun at 8 degrees, the irradiance of upright walls is seven times that of the
# ground, and the walls would be saturated at all exposures suited to the ground.
_BODY_DARKER = 0.25
_CLIPPED_PERCENT = 99.0  # percentile of the light that auto exposure maps to the white level
_EXPOSURES_MS = (1.0, 10_000.0)  # limits of auto exposure


class RoverCamera:
    """World, rover and light at a time, and images of them from any camera.

    Call `show` or `show_state` before the first image.
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
            Nodes of the ground whose changes are rendered.
        render
            Options of the run; `ROVER_RENDER` and `models` replace some of them.
        finer
            Cells of the rendered ground per cell of the world's ground.
        """
        self.vehicle, body = vehicle, body_of(vehicle)
        self._sun_elevation_deg = options.sun_elevation_deg
        self.render_options = _resolved(render, models, body)
        intensity = BRIGHT_STARS if options.stars == "bright" else 1.0
        self.sky: Sky | None = None if options.stars == "none" else build_sky(intensity)
        lattice = NodeGrid(world.x0, world.y0, world.cell, world.level)
        tracks = WheelTracks(lattice, followed, finer)
        self.scene = RenderScene(tracks, world, body, skirt_m=render.skirt_m)

    def show(self, level: np.ndarray, links: Mapping[str, Pose]) -> None:
        """Move the ground to levels (rows, columns), m, and the rover's links to their poses in the world."""
        self.links = links
        self.scene.show(level, links)

    def show_state(self, state: RoverState, level: np.ndarray) -> Pose:
        """Move the scene to a state of the physics and return `world_from_base`."""
        base = pose_of_quaternion(state.position, state.rotation)
        positions = np.stack([state.wheel(name) for name in ("x_m", "y_m", "z_m")], axis=1)
        quaternions = np.stack([state.wheel(name) for name in ("qw", "qx", "qy", "qz")], axis=1)
        wheels = {
            code: pose_of_quaternion(position, quaternion)
            for code, position, quaternion in zip(WHEELS, positions, quaternions, strict=True)
        }
        lift, steer = (dict(zip(WHEELS, state.wheel(name), strict=True)) for name in ("lift_m", "steer_rad"))
        self.show(level, links_at(self.vehicle, base, wheels, lift, steer))
        return base

    def render(
        self,
        camera: Camera,
        suns: Mapping[str, Lamp | None],
        lights: Sequence[LightPart],
        *,
        labels: bool,
        threads: int = 1,
    ) -> Rendering:
        """Return radiance by model and Sun (None: night), with the headlights, and ids by Sun if `labels` is true.

        The ids contain shadows of the Sun only; there are none at night.
        """
        options, models, surfaces = self.render_options, self.render_options.reflectance_models, self.scene.surfaces
        lamps = {name: lamp for name, lamp in suns.items() if lamp is not None}
        spots = {f"light {name}": spot for name, spot in headlights(lights, self.links).items()}  # distinct from Suns
        shadows = list(lamps) if labels else None if self.sky is None else []
        olat = render_view(surfaces, camera, lamps | spots, models, shadows, options, threads)
        whole = olat.whole
        light = {}
        for model, name in product(models, suns):
            images = [whole[model, lamp] for lamp in (name, *spots) if (model, lamp) in whole]
            light[model, name] = np.sum(images, axis=0) if images else np.zeros(camera.lens.shape, np.float32)
        radiance = apply_lens_to_olat_images(light, lamps, surfaces, camera, options, threads)
        if self.sky is not None:
            stars = (olat.ids[NO_LAMP] == BACKGROUND) * star_radiance(self.sky, np.eye(3), camera)
            blurred = apply_lens(stars, camera.lens, options)
            radiance = {key: image + blurred for key, image in radiance.items()}
        ids = {name: olat.ids[name if name in lamps else NO_LAMP] for name in (NO_LAMP, *suns)} if labels else {}
        return Rendering(radiance, ids)

    def expose(self, radiance: np.ndarray, model: Model, exposure_ms: float, *name: object) -> np.ndarray:
        """Return the 12-bit image (h, w) uint16 of radiance (h, w); `name` selects the noise."""
        noise = noise_generator(self.render_options, *name)
        return expose(radiance, exposure_ms * self._gain(model), self.render_options, noise)

    def picture(
        self, camera: Camera, light: ImagingCondition, *name: object, threads: int = 1
    ) -> tuple[np.ndarray, float]:
        """Return the 12-bit image (h, w) uint16 in a light, and its exposure, ms."""
        suns = {light.sun: named_sun(light.sun, self._sun_elevation_deg)}
        lights = [self.vehicle.light(name) for name in light.lights]
        rendering = self.render(camera, suns, lights, labels=False, threads=threads)
        radiance, exposure_ms = rendering.olat_images[light.model, light.sun], light.exposure_ms
        if isinstance(exposure_ms, str):
            assert exposure_ms == AUTO
            exposure_ms = auto_exposure_ms(radiance, self._gain(light.model))
        return self.expose(radiance, light.model, exposure_ms, *name), float(exposure_ms)

    def _gain(self, model: Model) -> float:
        # The rover's cameras are no cameras of a site: on every ground they have the sensitivity of NASA's.
        return gain_of(model, self.render_options, polar())


def _resolved(render: RenderOptions, models: Sequence[Model], body: Bodywork) -> RenderOptions:
    """Return a run's options with `ROVER_RENDER`, these models and the materials of the rover's body."""
    factor = _BODY_DARKER / GROUND_ALBEDO
    body_materials = {f"body{n}": Material(albedo=max(albedo, 0.01) * factor) for n, albedo in enumerate(body.albedo)}
    materials = {**body_materials, **render.materials}
    return render.model_copy(update={**ROVER_RENDER, "models": tuple(models), "materials": materials})


def auto_exposure_ms(light: np.ndarray, gain: float) -> float:
    """Return the exposure at which the brightest percent of the light (h, w) reaches the white level."""
    bright = float(np.percentile(light, _CLIPPED_PERCENT))
    return float(np.clip((WHITE_LEVEL - BLACK_LEVEL) / max(bright * gain, 1e-9), *_EXPOSURES_MS))


def near_path(world: World, path: ReferencePath, beside_m: float) -> np.ndarray:
    """Return (rows, columns) bool: nodes of the world's ground within `beside_m` of a path."""
    x, y = np.meshgrid(world.x, world.y)
    points = np.stack([x, y], axis=-1)
    near = np.zeros(x.shape, bool)
    for start, end in zip(path.points, path.points[1:], strict=False):
        along = end - start
        share = np.clip((points - start) @ along / (along @ along), 0, 1)
        near |= np.linalg.norm(points - start - share[..., None] * along, axis=-1) < beside_m
    return near
