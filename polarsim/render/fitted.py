"""Twins from materials that were fitted to photos: options, albedos and lamps as the fit has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from polarsim.errors import FormatError
from polarsim.formats.materials import Fitted, FittedMaterials
from polarsim.photo import SUNS
from polarsim.render.lamps import Lamp
from polarsim.render.options import MODELS, Model, RenderOptions


def with_fit(options: RenderOptions, fitted: FittedMaterials) -> tuple[RenderOptions, Mapping[Model, np.ndarray]]:
    """Options with the fit's parameters, gains and darkening, and albedo factors (v,) by model.

    Materials of single things, where the options have some, stay what they are.

    Raises
    ------
    FormatError
        The fit has parameters that its model does not take.
    """
    changed: dict[str, object] = {"gain": dict(options.gain)}
    if fitted.models:
        changed |= {"falloff": fitted.falloff, "vignetting": fitted.vignetting}
    known = [model for model in MODELS if model in fitted.models]
    for model in known:
        changed[model] = fitted.models[model].parameters
        changed["gain"] = {model: main_gain(fitted.models[model])} | dict(changed["gain"])  # type: ignore[call-overload]
    try:
        options = RenderOptions.model_validate(options.model_dump() | changed)
    except ValueError as error:
        raise FormatError(f"fitted materials: {str(error).splitlines()[0]}") from error
    return options, {model: fitted.models[model].albedo for model in known}


def main_gain(fit: Fitted) -> float:
    """Grey values per ms and unit radiance: the median of the Sun lamps, else of what there is."""
    suns = [gain for name, gain in fit.lamps.items() if name in SUNS]
    return float(np.median(suns or list(fit.lamps.values())))


def as_bright_as_fitted(lamps: Mapping[str, Lamp], fitted: FittedMaterials | None, model: Model) -> Mapping[str, Lamp]:
    """Lamps with intensities over that of the model's gain; those that no photo shows stay as they are."""
    if fitted is None or model not in fitted.models:
        return lamps
    fit = fitted.models[model]
    main = main_gain(fit)
    return {
        name: replace(lamp, intensity=lamp.intensity * float(np.float32(fit.lamps.get(name, main) / main)))
        for name, lamp in lamps.items()
    }
