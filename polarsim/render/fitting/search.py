"""Fit of model parameters to photos, independent of the albedo, by the Nelder-Mead simplex method.

Cells of a few centimetres are visible in several views and under several lamps. With correct parameters, one albedo
per cell and one brightness per lamp explain all observations. The search minimises the remaining residuals.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import ValidationError

from polarsim.render.fitting.samples import FitSamples, Setting
from polarsim.render.parameters import Parameters

CELL = 0.06  # metres
_MAX_SAMPLES = 250_000
_REWEIGHTINGS = 5  # rounds of the robust fit of albedos and lamps
_SCALE = 0.1  # scale of residuals, natural logarithm
_MAX_RESIDUAL = 5.0  # scaled residuals are clipped here: shadow edges and other outliers
_EVALUATIONS = 45  # maximum number of cost evaluations per parameter
_MIN_SAMPLES = 3  # minimum number of samples per cell, lamp and view


@dataclass(frozen=True)
class Cells:
    """Observations, one per cell, lamp and view, with their samples."""

    samples: FitSamples
    of_sample: np.ndarray  # (n,) observation of each sample
    light: np.ndarray  # (m,) sum of the photo rates
    cell: np.ndarray  # (m,)
    lamp: np.ndarray  # (m,)

    def disagreement(self, setting: Setting) -> float:
        """Return the mean clipped residual of a setting after fitting albedos and lamp brightness."""
        model = np.bincount(self.of_sample, setting.radiance(self.samples), len(self.light))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.log(self.light / model)
        if not np.isfinite(ratio).all():
            return np.inf
        lamps, cells = int(self.lamp.max()) + 1, int(self.cell.max()) + 1
        albedo, weight = np.zeros(cells), np.ones(len(ratio))
        rest = ratio
        for _ in range(_REWEIGHTINGS):
            rest = ratio - albedo[self.cell]
            total = np.bincount(self.lamp, weight, lamps)
            gain = np.divide(np.bincount(self.lamp, weight * rest, lamps), total, out=np.zeros(lamps), where=total > 0)
            rest = ratio - gain[self.lamp]
            albedo = np.bincount(self.cell, weight * rest, cells) / np.bincount(self.cell, weight, cells)
            rest = rest - albedo[self.cell]
            weight = 1 / (1 + (rest / (_MAX_RESIDUAL * _SCALE)) ** 2)
        return float(np.minimum(np.abs(rest) / _SCALE, _MAX_RESIDUAL).mean())


def cells_of(samples: FitSamples, rng: np.random.Generator) -> Cells | None:
    """Group samples by cell, lamp and view, after random subsampling; None if no cell has enough samples."""
    if len(samples) > _MAX_SAMPLES:
        samples = samples.part(np.sort(rng.choice(len(samples), _MAX_SAMPLES, replace=False)))
    grid = np.floor(samples.point / CELL).astype(np.int64)
    columns = np.column_stack([grid, samples.lamp, samples.view])
    groups, of_sample, count = np.unique(columns, axis=0, return_inverse=True, return_counts=True)
    enough = count >= _MIN_SAMPLES
    if not enough.any():
        return None
    kept = enough[of_sample.ravel()]
    number = np.cumsum(enough) - 1
    of_sample, samples, groups = number[of_sample.ravel()[kept]], samples.part(kept), groups[enough]
    cell = np.unique(groups[:, :3], axis=0, return_inverse=True)[1].ravel()
    light = np.bincount(of_sample, samples.rate, len(groups))
    return Cells(samples, of_sample, light, cell, groups[:, 3])


def fitted_parameters(cells: Cells, setting: Setting) -> Parameters:
    """Fit the parameters named in the options of a setting; return the start values if the search has no better."""
    from scipy.optimize import minimize

    start, names = setting.parameters, setting.options.fitting.parameters.get(setting.model, ())
    if not names:
        return start

    def cost(values: np.ndarray) -> float:
        parameters = _with(start, names, values)
        return np.inf if parameters is None else cells.disagreement(replace(setting, parameters=parameters))

    first = np.array([getattr(start, name) for name in names], float)
    corners = np.array([first, *(_stepped(start, names, first, number) for number in range(len(names)))])
    result = minimize(
        cost,
        first,
        method="Nelder-Mead",
        options={"initial_simplex": corners, "maxfev": _EVALUATIONS * len(names), "xatol": 1e-3, "fatol": 1e-4},
    )
    better = _with(start, names, np.array([float(f"{value:.4g}") for value in result.x]))
    return better if better is not None and result.fun < cost(first) else start


def _with(start: Parameters, names: tuple[str, ...], values: np.ndarray) -> Parameters | None:
    """Return the parameters with some values replaced; None if a value is out of range."""
    try:
        return type(start).model_validate(start.model_dump() | dict(zip(names, values.tolist(), strict=True)))
    except ValidationError:
        return None


def _stepped(start: Parameters, names: tuple[str, ...], first: np.ndarray, number: int) -> np.ndarray:
    """Return a corner of the first simplex: one parameter raised by a fifth, or lowered if that is out of range."""
    step = np.zeros(len(first))
    step[number] = 0.2 * abs(first[number]) + 0.02
    up = first + step
    return up if _with(start, names, up) is not None else first - step
