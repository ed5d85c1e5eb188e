"""What the lens does to a view's OLAT images. All of it is linear: done once an OLAT image, it holds for every
photo.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import cache, lru_cache

import numpy as np
from scipy import fft

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.pixel_rays import pixel_directions
from polarsim.render.indirect import OlatImages
from polarsim.render.lamps import Lamp
from polarsim.render.lens_flare import lens_flare_of
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor_options import SensorOptions
from polarsim.render.surfaces import Surfaces


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

    The light of a point goes to three places: `blur_px` about it, `bloom_px` about it, and everywhere. What leaves the
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
