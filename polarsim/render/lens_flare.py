"""Light of lamps in or beside the picture that scatters in the lens: a veiling glare that thins out with the angle."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.integrate import quad

from polarsim.geometry.camera import Camera
from polarsim.geometry.pixel_rays import pixel_directions
from polarsim.render.lamps import Lamp
from polarsim.render.options import RenderOptions
from polarsim.render.penumbra import visible_share
from polarsim.render.surfaces import Surfaces

CORE = float(np.radians(1))  # angle within which the veiling glare flattens: the law was measured down to here


def lens_flare_of(surfaces: Surfaces, camera: Camera, lamp: Lamp, options: RenderOptions) -> np.ndarray:
    """(h, w) float32 radiance of the veiling glare that a lamp of the scene draws over the picture; 1 as in OLAT
    images.

    The lamp's irradiance on the lens, in so far as nothing hides the lamp, times the share `options.lens_flare`, times
    `scattering`. The lamp's own image is the veiling glare's core, which most exposures clip.
    """
    place, lens = camera.centre[None], camera.lens
    to_lamp, irradiance = lamp.light_at(place, falloff=options.falloff)
    towards = camera.world_from_camera.rotation.T @ (to_lamp[0] / np.linalg.norm(to_lamp))
    if towards[2] <= 0:  # it stands beside or behind the lens
        return np.zeros(lens.shape, np.float32)
    light = irradiance[0] * towards[2] * _seen_share(surfaces, place, to_lamp, lamp, options.lamp_samples)
    if not light:
        return np.zeros(lens.shape, np.float32)
    directions = pixel_directions(lens, slice(None))
    cosine = directions @ towards / np.sqrt((directions**2).sum(axis=-1))
    return (options.lens_flare * light * scattering(np.arccos(np.clip(cosine, -1, 1)))).astype(np.float32)


def scattering(angle: np.ndarray) -> np.ndarray:
    """Radiance, 1/sr, per scattered irradiance, at angles (...) from the lamp, radians.

    One over the square of the angle, as in Stiles and Holladay's law of disability glare (CIE 146:2002; Vos, Clin. Exp.
    Optom. 86 (2003) 363), flat within `CORE`: this is Harvey and Shack's law of polished surfaces with its usual slope
    of -2. All of it falls into the half-space before the lens: the integral over that is 1.
    """
    return _strength() / (angle**2 + CORE**2)


@cache
def _strength() -> float:
    return float(1 / quad(lambda angle: 2 * np.pi * np.sin(angle) / (angle**2 + CORE**2), 0, np.pi / 2)[0])


def _seen_share(surfaces: Surfaces, place: np.ndarray, to_lamp: np.ndarray, lamp: Lamp, samples: int) -> float:
    """Share of the lamp that is seen from a place (1, 3)."""
    if not lamp.radius_m:
        return float(not surfaces.all.occluded(place, to_lamp, 1.0)[0])
    place, to_lamp = place.astype(np.float32), to_lamp.astype(np.float32)
    return float(visible_share(surfaces, place, to_lamp, lamp.radius_m, samples, np.zeros(1))[0])
