"""What the lens does to a view's OLAT images, veiling glare of lamps in or beside the picture included.

All of it is linear: done once an OLAT image, it holds for every photo.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache

import numpy as np
from scipy import fft
from scipy.integrate import quad

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens, pixel_directions
from polarsim.render.indirect import OlatImages
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import visible_share
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor_options import SensorOptions
from polarsim.render.surfaces import Surfaces

CORE = float(np.radians(1))  # angle within which the veiling glare flattens: the law was measured down to here


def through_lens(
    olat_images: Mapping[tuple[Model, str], np.ndarray],
    lamps: Mapping[str, Lamp],
    surfaces: Surfaces,
    camera: Camera,
    options: RenderOptions,
    threads: int = 1,
) -> OlatImages:
    """OLAT images (h, w) by model and lamp, as radiance that the sensor gets: spread, darkened, with the lamps'
    lens_flare.

    OLAT images of what is no lamp have none.
    """
    flares = {}
    if options.lens_flare:
        names = dict.fromkeys(name for _, name in olat_images)
        flares = {name: lens_flare_of(surfaces, camera, lamps[name], options) for name in names if name in lamps}

    def seen(olat_image: np.ndarray, lamp: str) -> np.ndarray:
        image = imaged(olat_image, camera.lens, options)
        return image + flares[lamp] if lamp in flares else image

    with ThreadPoolExecutor(max(1, threads)) as pool:
        found = pool.map(seen, olat_images.values(), (lamp for _, lamp in olat_images))
        return dict(zip(olat_images, found, strict=True))


def imaged(image: np.ndarray, lens: Lens, options: SensorOptions) -> np.ndarray:
    """(h, w) radiance spread and darkened; without any fault of the lens the image itself."""
    image = spread(image, options)
    return image * vignette(lens) if options.vignetting else image


def spread(image: np.ndarray, options: SensorOptions) -> np.ndarray:
    """(h, w) float32 image blurred, with halo and veiling glare; without any of these the image itself.

    The light of a point goes three ways: `blur_px` about it, `bloom_px` about it, and everywhere. What leaves the
    picture comes back in as if the scene went on mirrored, so that its light stays the same and its rim does not
    darken: then the cosine transform turns all three into one product.
    """
    if not (options.blur_px or options.bloom or options.veiling_glare):
        return image
    height, width = image.shape
    row, column = _gaussian(height, options.blur_px), _gaussian(width, options.blur_px)
    transfer = np.outer((1 - options.bloom - options.veiling_glare) * row, column)
    if options.bloom:
        row, column = _gaussian(height, options.bloom_px), _gaussian(width, options.bloom_px)
        transfer += np.outer(options.bloom * row, column)
    transfer[0, 0] += options.veiling_glare
    waves = fft.dctn(image.astype(np.float32, copy=False))
    waves *= transfer
    return np.maximum(fft.idctn(waves, overwrite_x=True), 0)  # rounding may leave less than no light


@lru_cache(maxsize=2)
def vignette(lens: Lens) -> np.ndarray:
    """(h, w) float32 share of light that reaches a pixel: the fourth power of the cosine to the optical axis."""
    directions = pixel_directions(lens, slice(None))
    return (1 / (directions**2).sum(axis=-1) ** 2).astype(np.float32)


@cache
def _gaussian(size: int, sd_px: float) -> np.ndarray:
    """(size,) what a Gaussian leaves of the waves of a cosine transform.

    The discrete Gaussian (Lindeberg, IEEE Trans. PAMI 12 (1990) 234) has no negative value, and exactly the variance
    that is asked for, at any width; a sampled one is off below a pixel.
    """
    return np.exp(sd_px**2 * (np.cos(np.pi * np.arange(size) / size) - 1)).astype(np.float32)


def lens_flare_of(surfaces: Surfaces, camera: Camera, lamp: Lamp, options: RenderOptions) -> np.ndarray:
    """(h, w) float32 radiance of the veiling glare that a lamp of the scene draws over the picture; 1 as in OLAT
    images.

    The lamp's irradiance on the lens, in so far as nothing hides the lamp, times the share `options.lens_flare`, times
    `scattering`. The lamp's own image is the veiling glare's core, which most exposures clip.
    """
    eye, lens = camera.centre[None], camera.lens
    to_lamp, irradiance = lamp.light_at(eye, falloff=options.falloff)
    towards = camera.world_from_camera.rotation.T @ (to_lamp[0] / np.linalg.norm(to_lamp))
    if towards[2] <= 0:  # it stands beside or behind the lens
        return np.zeros(lens.shape, np.float32)
    rays = eye.astype(np.float32), to_lamp.astype(np.float32)
    share = float(visible_share(surfaces, *rays, lamp.radius_m, options.lamp_samples, np.zeros(1))[0])
    light = irradiance[0] * towards[2] * share
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
