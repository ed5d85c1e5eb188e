"""Conversion of a linear image to a raw photo: lens effects, glare, shot and read noise, black level, bits."""

from __future__ import annotations

import numpy as np

from polarsim.analog.light import DiscLamp
from polarsim.geometry.camera import Camera
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.site_parts import Images

_BLUR_PX = 0.6  # standard deviation of the point spread function
_VIGNETTING = 0.30  # share of light lost in the corners
_VEIL, _HALO = 0.002, 0.007  # shares of light in the veiling glare (uniform) and in the halo (broad)
# A sensor similar to Sony's IMX249, with a full well of 33,000 electrons. The values differ on purpose from those of
# `polarsim.photo`, so that stages are tested with a sensor that does not match their assumptions.
ELECTRONS_PER_DN = 8.0  # of 12 bits
_READ_NOISE_ELECTRONS = 7.0  # standard deviation
_FULL_WELL_ELECTRONS = 33000.0
_PIXEL_GAIN = 0.006  # standard deviation of the sensitivity of pixels
_ZERO_FROM = 104.0  # exp(-x) of single precision is zero for larger x


def blur_and_vignette(image: np.ndarray) -> np.ndarray:
    """Return the image (h, w) with blur, vignetting, halo and veiling glare."""
    import cv2

    height, width = image.shape
    bright = np.minimum(image, np.percentile(image, 99.9) * 20)
    small = cv2.resize(bright, (width // 16, height // 16), interpolation=cv2.INTER_AREA)
    halo = cv2.resize(cv2.GaussianBlur(small, (0, 0), 9), (width, height), interpolation=cv2.INTER_LINEAR)
    sharp = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
    row = np.arange(height, dtype=np.float32) - height / 2
    column = np.arange(width, dtype=np.float32) - width / 2
    radius2 = (row[:, None] ** 2 + column**2) / (height**2 / 4 + width**2 / 4)
    glare = _VEIL * small.mean() + _HALO * halo
    return (((1 - _HALO) * sharp + glare) * (1 - _VIGNETTING * radius2)).astype(np.float32)


def lamp_glare(lamp: DiscLamp, camera: Camera, brightness: float, rng: np.random.Generator) -> np.ndarray:
    """Return the light (h, w) that a lamp inside or outside the image scatters in the lens, at unit intensity.

    `brightness`: radiance at the centres of the ghosts for a lamp 4 m away.
    """
    lens = camera.lens
    height, width = lens.shape
    position = camera.world_from_camera.inverse().apply(lamp.position)
    distance = float(np.linalg.norm(position))
    off_axis = np.arccos(position[2] / distance)
    out = np.zeros((height, width), np.float32)
    if off_axis > np.radians(105) or distance < 0.3:
        return out
    strength = brightness * (4 / distance) ** 2
    ahead = position / distance
    centre = np.array([width / 2, height / 2])
    aside = ahead[:2] / max(float(np.hypot(*ahead[:2])), 1e-6)
    in_image = False
    if ahead[2] > 0.3:
        spot = lens.project(position[None])[0]
        in_image = bool(np.all((spot > 0) & (spot < [width, height])))
    if in_image:
        _blob(out, spot, lens.fx * lamp.radius / distance, 4000 * strength, 2.0)
        _blob(out, spot, 90, 8 * strength, 0.4)
        _blob(out, spot, 1400, 0.12 * strength, 1.0)
        for share, size in ((-0.35, 18), (-0.62, 30), (0.45, 12), (0.3, 26)):  # ghosts on the line through the centre
            _blob(out, centre + share * (spot - centre) + rng.normal(0, 4, 2), size, 2 * strength, 4.0)
    else:
        corner = centre + aside * min(abs(width / 2 / aside[0]), abs(height / 2 / aside[1]))
        _blob(out, corner, 240, 0.25 * strength * float(np.clip(np.cos(off_axis) + 0.35, 0.05, 1)), 1.0)
    return out


def _blob(out: np.ndarray, centre: np.ndarray, size: float, strength: float, power: float) -> None:
    reach = size * _ZERO_FROM ** (0.5 / power)
    low = np.clip(np.floor(centre - reach), 0, out.shape[::-1]).astype(int)
    high = np.clip(np.ceil(centre + reach), low, out.shape[::-1]).astype(int)
    row = np.arange(low[1], high[1], dtype=np.float32)[:, None] - centre[1]
    column = np.arange(low[0], high[0], dtype=np.float32) - centre[0]
    distance2 = (row**2 + column**2) / np.float32(size**2)
    out[low[1] : high[1], low[0] : high[0]] += np.float32(strength) * np.exp(-(distance2**power))


def expose_raw(
    image: np.ndarray, exposure_ms: float, electrons: float, rng: np.random.Generator, pixel_gain: np.ndarray,
    form: Images,
) -> np.ndarray:  # fmt: skip
    """Return the photo (h, w) uint16 of a linear image; `electrons`: photo-electrons per ms at unit radiance.

    The full well has the value white at any number of bits.
    """
    signal = image * pixel_gain * np.float32(electrons * exposure_ms)
    noise = rng.standard_normal(image.shape, dtype=np.float32)
    noise *= np.sqrt(np.maximum(signal, 0) + np.float32(_READ_NOISE_ELECTRONS**2))
    collected = np.minimum(signal + noise, np.float32(_FULL_WELL_ELECTRONS))
    steps = (WHITE_LEVEL - BLACK_LEVEL) / (form.white_level - form.black)
    values = collected / np.float32(ELECTRONS_PER_DN * steps) + np.float32(form.black)
    return np.clip(np.rint(values), 0, form.white_level).astype(np.uint16)


def fixed_pattern(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """Return random pixel sensitivities (h, w) float32 with mean 1."""
    return 1 + np.float32(_PIXEL_GAIN) * rng.standard_normal(shape, dtype=np.float32)
