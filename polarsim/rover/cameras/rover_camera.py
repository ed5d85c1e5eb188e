"""One camera's picture of a scene: light of Suns and headlights, lens, stars, sensor.

All pictures of the rover are made here: those of a drive that is over (`suite`), of a drive under way
(`live_camera`), and those that a rover decides by (`autonomy.eyes`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.render.gain import default_gain
from polarsim.render.lamps import Spot
from polarsim.render.olat import NO_LAMP, Rendering, render_view
from polarsim.render.optics import imaged, through_lens
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose, noise_of
from polarsim.render.surfaces import Surfaces
from polarsim.render.views.options import StarField
from polarsim.render.views.stars import Sky, sky_of, star_radiance
from polarsim.rover.cameras.bodywork import Body
from polarsim.rover.cameras.lights import Sun
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.render_scene import options_of
from polarsim.run_files.instances import BACKGROUND

BRIGHT_STARS = 300.0  # flux of the stars of the paper's videos over that of real ones


@dataclass(frozen=True)
class Imaging:
    """The renderer's options, with the materials of the rover's body, and the stars."""

    options: RenderOptions
    sky: Sky | None

    @classmethod
    def of(cls, cameras: CameraSuiteOptions, body: Body) -> Imaging:
        """Return the imaging that the section `rover.cameras` asks for."""
        if cameras.stars == "none":
            return cls(options_of(cameras, body), None)
        stars = StarField(intensity=BRIGHT_STARS if cameras.stars == "bright" else 1.0)
        return cls(options_of(cameras, body), sky_of(stars))

    def render(
        self,
        surfaces: Surfaces,
        camera: Camera,
        suns: Mapping[str, Sun],
        spots: Mapping[str, Spot],
        *,
        labels: bool,
        threads: int = 1,
    ) -> Rendering:
        """Return radiance by model and Sun, each with the headlights, and ids by Sun where `labels` asks for them.

        Shadows among the ids are those that the Sun throws: at night there are none.
        """
        options, models = self.options, self.options.models
        lamps = {name: sun.lamp for name, sun in suns.items() if sun.lamp is not None}
        own = {f"light {name}": spot for name, spot in spots.items()}  # no Sun has such a name
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

    def gain(self, model: Model) -> float:
        """Return the grey values that a unit of radiance makes per ms."""
        return self.options.gain.get(model, default_gain(model, self.options))

    def expose(self, radiance: np.ndarray, model: Model, exposure_ms: float, *picture: object) -> np.ndarray:
        """Return the 12-bit picture (h, w) uint16 of radiance (h, w); `picture` names it, and so draws its noise."""
        noise = noise_of(self.options, *picture)
        return expose(radiance, exposure_ms * self.gain(model), self.options, noise)


def _sum(images: Iterable[np.ndarray], camera: Camera) -> np.ndarray:
    """(h, w) sum of the images; without any there is no light."""
    parts = list(images)
    if not parts:
        return np.zeros(camera.lens.shape, np.float32)
    return np.asarray(np.sum(parts, axis=0)) if len(parts) > 1 else parts[0]
