"""Lens effects on the OLAT images of a view: blur, halo, vignetting, and veiling glare of lamps.

All effects are linear. Therefore they are applied once per OLAT image and are valid for every photo.
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
from polarsim.render.options import Model, RenderOptions, SensorOptions
from polarsim.render.surfaces import Surfaces

CORE = float(np.radians(1))  # angle below which the veiling glare is constant: the law was measured down to this angle


def apply_lens_to_olat_images(
    olat_images: Mapping[tuple[Model, str], np.ndarray],
    lamps: Mapping[str, Lamp],
    surfaces: Surfaces,
    camera: Camera,
    options: RenderOptions,
    threads: int = 1,
) -> OlatImages:
    """Apply the lens to OLAT images (h, w) by model and lamp: blur, vignetting, and flare of visible lamps.

    OLAT images whose name is not in `lamps` get no flare.
    """
    flares = {}
    if options.lens_flare:
        names = dict.fromkeys(name for _, name in olat_images)
        flares = {name: lens_flare_of(surfaces, camera, lamps[name], options) for name in names if name in lamps}

    def with_flare(olat_image: np.ndarray, lamp: str) -> np.ndarray:
        image = apply_lens(olat_image, camera.lens, options)
        return image + flares[lamp] if lamp in flares else image

    with ThreadPoolExecutor(max(1, threads)) as pool:
        images = pool.map(with_flare, olat_images.values(), (lamp for _, lamp in olat_images))
        return dict(zip(olat_images, images, strict=True))


def apply_lens(image: np.ndarray, lens: Lens, options: SensorOptions) -> np.ndarray:
    """Return a radiance image (h, w) with blur and vignetting; the same image if all lens effects are off."""
    image = spread(image, options)
    return image * vignette(lens) if options.vignetting else image


def spread(image: np.ndarray, options: SensorOptions) -> np.ndarray:
    """Return a float32 image (h, w) with blur, halo and veiling glare; the same image if all three are off.

    The point spread function is the sum of two Gaussians (`blur_px`, `bloom_px`) and a constant. Boundaries are
    mirrored, so that the total light is unchanged and image edges are not darkened. With this boundary condition the
    convolution is a product in the cosine transform.
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
    return np.maximum(fft.idctn(waves, overwrite_x=True), 0)  # rounding may produce small negative values


@lru_cache(maxsize=2)
def vignette(lens: Lens) -> np.ndarray:
    """Return the transmission (h, w) float32 of the lens: the fourth power of the cosine to the optical axis."""
    directions = pixel_directions(lens, slice(None))
    return (1 / (directions**2).sum(axis=-1) ** 2).astype(np.float32)


@cache
def _gaussian(size: int, sd_px: float) -> np.ndarray:
    """Return the transfer function (size,) of a Gaussian blur for the cosine transform.

    The discrete Gaussian (Lindeberg, IEEE Trans. PAMI 12 (1990) 234) has no negative values and the exact variance at
    any width; a sampled Gaussian is inaccurate below one pixel.
    """
    return np.exp(sd_px**2 * (np.cos(np.pi * np.arange(size) / size) - 1)).astype(np.float32)


def lens_flare_of(surfaces: Surfaces, camera: Camera, lamp: Lamp, options: RenderOptions) -> np.ndarray:
    """Return the radiance (h, w) float32 of the veiling glare of a lamp, in the units of OLAT images.

    The radiance is the irradiance of the visible part of the lamp on the lens, times `options.lens_flare`, times
    `scattering`. The core of the glare represents the image of the lamp, which is clipped at most exposures.
    """
    eye, lens = camera.centre[None], camera.lens
    to_lamp, irradiance = lamp.light_at(eye, falloff=options.falloff)
    towards = camera.world_from_camera.rotation.T @ (to_lamp[0] / np.linalg.norm(to_lamp))
    if towards[2] <= 0:  # the lamp is behind the plane of the lens
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
    """Return the radiance per scattered irradiance, 1/sr, at angles (...) from the lamp, radians.

    The radiance is proportional to the inverse square of the angle, as in the Stiles-Holladay law of disability glare
    (CIE 146:2002; Vos, Clin. Exp. Optom. 86 (2003) 363), and constant within `CORE`. This is the Harvey-Shack law of
    polished surfaces with the usual slope of -2. The integral over the half-space in front of the lens is 1.
    """
    return _strength() / (angle**2 + CORE**2)


@cache
def _strength() -> float:
    return float(1 / quad(lambda angle: 2 * np.pi * np.sin(angle) / (angle**2 + CORE**2), 0, np.pi / 2)[0])
