"""Gain, DN per ms per unit radiance: calibrated on photos if available, else from the usual exposure of the site.

If materials were fitted to photos, the fit provides gains, lamp brightness and model parameters.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import png
from polarsim.photo import BLACK_LEVEL, CENTRE_DN, PhotoKey
from polarsim.render import brdf
from polarsim.render.lamps import ROVER, Lamp, first_lamp, first_tripod
from polarsim.render.options import MODELS, Model, RenderOptions
from polarsim.run_files.materials import FittedMaterial, FittedMaterials
from polarsim.run_files.pictures import pictures_at
from polarsim.site import Site

log = logging.getLogger("polarsim.render")

_USABLE = (40, 3500)  # DN above black that are not biased by noise or clipping
_LIT = 0.25  # share of the median radiance: darker pixels are in shadow or penumbra
_FRAME = (0.1, 0.7, 0.1, 0.9)  # top, bottom, left, right: excludes the rim of the sandbox, as recommended by NASA
_MAX_PHOTOS = 6  # maximum photos of a calibration, more than the number of azimuths
_STEP = 3  # every third row and column is sufficient for a median


def default_gain(model: Model, options: RenderOptions, site: Site) -> float:
    """Return the gain, DN per ms per unit radiance, at which the usual exposure of a site is right.

    Level ground at the centre then has `CENTRE_DN` under the first lamp, seen from the first surveyed position.
    """
    to_lamp, irradiance = first_lamp(site).light_at(np.zeros((1, 3)), falloff=options.falloff)
    to_lamp = to_lamp / np.linalg.norm(to_lamp)
    camera = np.array(first_tripod(site).camera_m)
    to_viewer = camera[None] / np.linalg.norm(camera)
    value = brdf.reflectance(options.parameters(model), np.array([[0.0, 0.0, 1.0]]), to_lamp, to_viewer)
    radiance = float(value[0] * irradiance[0] * to_lamp[0, 2])
    per_ms = CENTRE_DN / site.usual_exposure_ms
    return per_ms / radiance if radiance > 0 else per_ms


def gain_of(model: Model, options: RenderOptions, site: Site) -> float:
    """Return the gain of the options, else the default gain: DN per ms per unit radiance."""
    return options.gain.get(model) or default_gain(model, options, site)


def lit_pixels(radiance: np.ndarray) -> np.ndarray:
    """Return which pixels (...) are lit: at least a quarter of the median of all positive radiances."""
    positive = radiance[radiance > 0]
    return radiance > _LIT * np.median(positive) if len(positive) else np.zeros(radiance.shape, bool)


def gain_ratios(photo: np.ndarray, radiance: np.ndarray, exposure_ms: float) -> np.ndarray:
    """Return the ratios (n,) of photo and radiance, DN per ms per unit radiance, at lit, unsaturated pixels.

    `photo` (h, w) uint16 has 12-bit DN, `radiance` (h, w) is rendered for the same view under the same lamp. Pixels
    near the rim of the sandbox are excluded.
    """
    height, width = photo.shape
    top, bottom, left, right = np.round(np.array(_FRAME) * [height, height, width, width]).astype(int)
    part = (slice(top, bottom, _STEP), slice(left, right, _STEP))
    grey, light = photo[part].astype(float) - BLACK_LEVEL, radiance[part].astype(float)
    usable = (grey > _USABLE[0]) & (grey < _USABLE[1]) & lit_pixels(light)
    return grey[usable] / (exposure_ms * light[usable])


def calibration_photos(index: Path | None, keys: Iterable[PhotoKey], site: Site) -> dict[PhotoKey, Path]:
    """Select the photos for gain calibration: one view, Sun lamp only, one exposure per azimuth.

    The view is the first one that has such photos; the exposure is the closest to the usual exposure of the site.
    Without an index the result is empty.
    """
    if index is None:
        return {}
    paths = pictures_at(index)
    chosen: dict[PhotoKey, Path] = {}
    usual = site.usual_exposure_ms
    for key in sorted(keys, key=lambda key: (key.view, site.azimuths.index(key.azimuth), key)):
        path = paths.get(key)
        if key.light == "on" or not key.has_sun or path is None or not path.is_file():
            continue
        if chosen and next(iter(chosen)).view != key.view:
            break
        rival = next((other for other in chosen if other.azimuth == key.azimuth), None)
        if rival is None and len(chosen) < _MAX_PHOTOS:
            chosen[key] = path
        elif rival is not None and key.stops_from(usual) < rival.stops_from(usual):
            del chosen[rival]
            chosen[key] = path
    return chosen


def calibrate(
    photos: Mapping[PhotoKey, Path], olat_images: Mapping[tuple[Model, str], np.ndarray], model: Model
) -> float | None:
    """Return the median gain over photos of the view of the OLAT images; None if no photo has usable pixels."""
    ratios = [np.zeros(0)]
    for key, path in photos.items():
        radiance = olat_images[model, key.azimuth]
        try:
            photo = png.read_photo(path, (radiance.shape[1], radiance.shape[0]))
        except PolarsimError as error:
            log.warning("%s; not used for calibration", error)
            continue
        ratios.append(gain_ratios(photo, radiance, key.exposure_ms))
    pooled = np.concatenate(ratios)
    return float(f"{np.median(pooled):.6g}") if len(pooled) else None


def with_fit(options: RenderOptions, fitted: FittedMaterials) -> tuple[RenderOptions, Mapping[Model, np.ndarray]]:
    """Return the options with the fitted parameters and gains, and the albedo factors (v,) by model.

    Materials of single objects in the options are unchanged.
    """
    changed: dict[str, object] = {"gain": dict(options.gain)}
    fitted_models = [model for model in MODELS if model in fitted.models]
    for model in fitted_models:
        changed["gain"] = {model: main_gain(fitted.models[model])} | dict(changed["gain"])  # type: ignore[call-overload]
    try:
        options = RenderOptions.model_validate(options.model_dump() | changed)
        options = options.with_default(**{model: fitted.models[model].parameters for model in fitted_models})
    except ValueError as error:
        raise FormatError(f"fitted materials: {str(error).splitlines()[0]}") from error
    return options, {model: fitted.models[model].albedo for model in fitted_models}


def main_gain(fit: FittedMaterial) -> float:
    """Return the median gain of the Sun lamps, or of all lamps if no Sun lamp was fitted."""
    suns = [gain for name, gain in fit.lamps.items() if name != ROVER]
    return float(np.median(suns or list(fit.lamps.values())))


def with_fitted_intensities(
    lamps: Mapping[str, Lamp], fitted: FittedMaterials | None, model: Model
) -> Mapping[str, Lamp]:
    """Return the lamps with fitted intensities, relative to the gain of the model.

    Lamps without photos are unchanged.
    """
    if fitted is None or model not in fitted.models:
        return lamps
    fit = fitted.models[model]
    main = main_gain(fit)
    return {
        name: replace(lamp, intensity=lamp.intensity * float(np.float32(fit.lamps.get(name, main) / main)))
        for name, lamp in lamps.items()
    }
