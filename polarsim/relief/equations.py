"""Quadratic energy of a Gauss-Newton step of shape from shading, and its solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.relief.multigrid import Energy, minimise
from polarsim.relief.observations import RESIDUAL_SD, ShadingObservation, cauchy_weight, slopes_of
from polarsim.rocks.heights import FloorGrid

RHO_SD = 0.15  # of the logarithm of the relative albedo
SLOPE_SD = 0.25  # of slopes, relative to the given surface
BEND_SD = 0.3  # of second differences over the cell size
SHADE_SD = 0.1  # of slopes along rays in shadows
# Standard deviation, metres, of the mean that is subtracted from residuals at known heights. Cover photos of terrains 1
# and 3, SSIM at A and C: 0.58 and 0.64 without; 0.60 and 0.65 with 0.07 or 0.15 m.
SLOW_M = 0.1


@dataclass(frozen=True)
class Problem:
    """Given surface and its uncertainty on a grid; arrays are (rows, columns)."""

    grid: FloorGrid
    given: np.ndarray  # metres
    sd: np.ndarray  # metres, finite
    known: np.ndarray  # whether the height was known before
    masked: np.ndarray


def solve_step(problem: Problem, surface: np.ndarray, seen: Sequence[ShadingObservation]) -> np.ndarray:
    """Return the surface (rows, columns) after one Gauss-Newton step from `surface`."""
    grid = problem.grid
    slopes, given = slopes_of(grid, surface), slopes_of(grid, problem.given)
    known = problem.known[1:, 1:]
    shape = known.shape
    total, mean, gradient = np.full(shape, 1 / RHO_SD**2), np.zeros(shape), np.zeros((*shape, 2))
    normal, load = np.zeros((*shape, 3)), np.zeros((*shape, 2))
    for view in seen:
        residual = view.residual - _slow_part(problem, view, known)
        weight = view.lit * cauchy_weight(residual) / RESIDUAL_SD**2
        target = residual + (view.derivatives * slopes).sum(axis=-1)
        total += weight
        mean += weight * target
        gradient += weight[..., None] * view.derivatives
        normal += weight[..., None] * _square(view.derivatives)
        load += (weight * target)[..., None] * view.derivatives
        shade = (view.shaded & ~known) / SHADE_SD**2
        normal += shade[..., None] * _square(view.away)
        load += (shade * view.descent)[..., None] * view.away
    normal -= _square(gradient) / total[..., None]  # rho is eliminated
    load -= gradient * (mean / total)[..., None]
    normal[..., [0, 2]] += 1 / SLOPE_SD**2
    load += given / SLOPE_SD**2
    stiffness = 1 / (BEND_SD * grid.cell) ** 2
    energy = Energy(normal / grid.cell**2, load / grid.cell, 1 / problem.sd**2, problem.given, stiffness)
    return minimise(energy, surface)


def _square(vectors: np.ndarray) -> np.ndarray:
    """Return xx, xy, yy (..., 3) of vectors (..., 2)."""
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([x * x, x * y, y * y], axis=-1)


def _slow_part(problem: Problem, view: ShadingObservation, known: np.ndarray) -> np.ndarray:
    """Return the local mean (rows - 1, columns - 1) of the residuals where heights are known, else 0.

    Errors of light and reflectance imitate slopes. Over long waves, the known heights are more accurate.
    """
    weight, width = view.lit * cauchy_weight(view.residual), SLOW_M / problem.grid.cell
    total, summed = (ndimage.gaussian_filter(values, width) for values in (weight, weight * view.residual))
    return np.where(known, summed / np.maximum(total, 1e-3), 0.0)
