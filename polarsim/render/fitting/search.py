"""Parameters of a model that photos agree with, whatever the albedo: a search by Nelder and Mead's simplex.

Cells of a few centimetres are seen from several views and under several lamps. With the right parameters one albedo a
cell and one brightness a lamp explain them all; what is left over is what the search makes small.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from pydantic import ValidationError

from polarsim.render.fitting.samples import Darkening, Samples, Setting
from polarsim.render.materials import Reflectance
from polarsim.render.options import Model, Parameters, RenderOptions

CELL = 0.06  # metres
_MOST_SAMPLES = 250_000
_REWEIGHTINGS = 5  # rounds of the robust fit of albedos and lamps
_CLEAR = 0.1  # residual that counts fully, natural logarithm
_MOST = 5.0  # and how many times that counts at most: edges of shadows and other faults
_EVALUATIONS = 45  # a parameter
_ALTERNATIONS = 3  # rounds of fitting the parameters and choosing the darkening
_LEAST = 3  # samples of a cell under a lamp in a view


@dataclass(frozen=True)
class Cells:
    """Samples by cell, lamp and view: one observation each."""

    samples: Samples
    of_sample: np.ndarray  # (n,) observation of each sample
    light: np.ndarray  # (m,) sum of the photos'
    cell: np.ndarray  # (m,)
    lamp: np.ndarray  # (m,)

    def disagreement(self, setting: Setting) -> float:
        """Mean clipped residual of the radiance of a setting, albedos and lamps' brightness taken out."""
        model = np.bincount(self.of_sample, setting.radiance(self.samples), len(self.light))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.log(self.light / model)
        if not np.isfinite(ratio).all():
            return np.inf
        lamps, cells = int(self.lamp.max()) + 1, int(self.cell.max()) + 1
        albedo, weight = np.zeros(cells), np.ones(len(ratio))
        left = ratio
        for _ in range(_REWEIGHTINGS):
            left = ratio - albedo[self.cell]
            whole = np.bincount(self.lamp, weight, lamps)
            gain = np.divide(np.bincount(self.lamp, weight * left, lamps), whole, out=np.zeros(lamps), where=whole > 0)
            left = ratio - gain[self.lamp]
            albedo = np.bincount(self.cell, weight * left, cells) / np.bincount(self.cell, weight, cells)
            left = left - albedo[self.cell]
            weight = 1 / (1 + (left / (_MOST * _CLEAR)) ** 2)
        return float(np.minimum(np.abs(left) / _CLEAR, _MOST).mean())


def cells_of(samples: Samples, rng: np.random.Generator) -> Cells | None:
    """Cells from samples, of many a part; None where there is nothing to compare."""
    if len(samples) > _MOST_SAMPLES:
        samples = samples.part(np.sort(rng.choice(len(samples), _MOST_SAMPLES, replace=False)))
    grid = np.floor(samples.point / CELL).astype(np.int64)
    columns = np.column_stack([grid, samples.lamp, samples.view])
    seen, of_sample, count = np.unique(columns, axis=0, return_inverse=True, return_counts=True)
    enough = count >= _LEAST
    if not enough.any():
        return None
    kept = enough[of_sample.ravel()]
    number = np.cumsum(enough) - 1
    of_sample, samples, seen = number[of_sample.ravel()[kept]], samples.part(kept), seen[enough]
    cell = np.unique(seen[:, :3], axis=0, return_inverse=True)[1].ravel()
    light = np.bincount(of_sample, samples.rate, len(seen))
    return Cells(samples, of_sample, light, cell, seen[:, 3])


def fitted_models(
    cells: Cells, start: Mapping[Model, Parameters], engine: Reflectance, options: RenderOptions
) -> tuple[Darkening, dict[Model, Parameters]]:
    """What the photos agree with: one darkening for all models, and the parameters of each.

    They are found in turn, for the one hangs on the other.
    """
    found = dict(start)
    darkening = best_darkening(cells, found, engine, options)
    for _ in range(_ALTERNATIONS):
        found = {
            model: fitted_parameters(cells, Setting(model, own, darkening, engine, options))
            for model, own in start.items()
        }
        before, darkening = darkening, best_darkening(cells, found, engine, options)
        if darkening == before:
            return darkening, found
    return before, found


def best_darkening(
    cells: Cells, models: Mapping[Model, Parameters], engine: Reflectance, options: RenderOptions
) -> Darkening:
    """That which all models together agree with best."""

    def cost(darkening: Darkening) -> float:
        settings = (Setting(model, own, darkening, engine, options) for model, own in models.items())
        return sum(cells.disagreement(setting) for setting in settings)

    return min((Darkening(*both) for both in itertools.product((False, True), repeat=2)), key=cost)


def fitted_parameters(cells: Cells, setting: Setting) -> Parameters:
    """A setting's parameters, those that its options name fitted; as they are where the search finds none better."""
    from scipy.optimize import minimize

    start, names = setting.parameters, setting.options.fitting.parameters.get(setting.model, ())
    if not names:
        return start

    @cache
    def cost_of(*values: float) -> float:
        own = _with(start, names, np.array(values))
        if own is None:
            return np.inf
        return cells.disagreement(replace(setting, parameters=own))

    def cost(values: np.ndarray) -> float:
        return cost_of(*values.tolist())

    first = np.array([getattr(start, name) for name in names], float)
    corners = [first, *(_stepped(start, names, first, number) for number in range(len(names)))]
    found = minimize(
        cost,
        first,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.array(corners),
            "maxfev": _EVALUATIONS * len(names),
            "xatol": 1e-3,
            "fatol": 1e-4,
        },
    )
    better = _with(start, names, np.array([float(f"{value:.4g}") for value in found.x]))
    return better if better is not None and found.fun < cost(first) else start


def _with(start: Parameters, names: tuple[str, ...], values: np.ndarray) -> Parameters | None:
    """The parameters with some of them replaced; None where these cannot be."""
    try:
        return type(start).model_validate(start.model_dump() | dict(zip(names, values.tolist(), strict=True)))
    except ValidationError:
        return None


def _stepped(start: Parameters, names: tuple[str, ...], first: np.ndarray, number: int) -> np.ndarray:
    """A corner of the first simplex: one parameter a fifth up, or down where it cannot go up."""
    step = np.zeros(len(first))
    step[number] = 0.2 * abs(first[number]) + 0.02
    up = first + step
    return up if _with(start, names, up) is not None else first - step
