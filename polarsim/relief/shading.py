"""Shape from shading: refine a height map by photos with known cameras and Sun lamps.

The heights h minimise, with n = (-h_x, -h_y, 1) and the reflectance f_r,

    sum over views and quads of w [log I - log f_r(n, l, v) cos i - field - rho]^2 / s_r^2     w: Cauchy weight
  + sum over quads of rho^2 / s_rho^2                                    rho: logarithm of the relative albedo
  + sum over shaded quads of (slope along the ray + its descent)^2 / s_shade^2
  + sum over cells of (h - given)^2 / sd^2  + slopes of h - given and second differences of h, each over its scale

by Gauss-Newton steps from coarse to fine (`relief.equations`, `relief.multigrid`). Shadows are found in the photos, and
those of rocks and walls are left out. Ground between both ends of any other shadow falls as far as the ray that grazes
the shadow's edge: the sum of the third term along the ray is the height constraint of this edge.

A single photo determines slopes towards the lamp only, and a wrong height moves the relief by twice to three times the
error: heights from shading reproduce the photo, but not necessarily a photo from another position.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
from scipy import ndimage

from polarsim.errors import ReconstructionError
from polarsim.geometry.rays import Caster
from polarsim.relief.agreement import verified_views
from polarsim.relief.equations import Problem, solve_step
from polarsim.relief.heights import INFERRED, INVENTED, MEASURED, HeightMap, PhotoView
from polarsim.relief.observations import observe
from polarsim.relief.repose import limit_slopes
from polarsim.render.parameters import Parameters
from polarsim.rocks.heights import FloorGrid

LEVELS = (4, 2, 1)  # cell sizes of the solutions, in cells of the map
CHECKED = 1  # number of the level on which photos are compared with the scene
ROUNDS = (3, 3, 2)  # Gauss-Newton steps per level
ANCHOR_SD = 0.1  # metres: of unknown heights from the given surface
INFERRED_SD = 0.010  # metres: least standard deviation of heights from shading
_SPREAD = 0.1  # metres: radius over which the size of the inferred relief is averaged
log = logging.getLogger("polarsim")


def refine(
    heights: HeightMap,
    views: Sequence[PhotoView],
    masked: np.ndarray,
    occluders: Caster,
    parameters: Parameters,
) -> HeightMap:
    """Return heights that explain the shading of photos; heights with a small standard deviation hardly change.

    Neither the brightness of a photo nor its pixels at masked cells change the result. No triangle without measured
    heights is steeper than the angle of repose.

    Parameters
    ----------
    masked : (rows, columns) bool
        Cells of rocks and walls.
    occluders : Caster
        Rocks and walls, which hide cells and cast shadows.
    parameters : Parameters
        Reflectance of the sand.

    Raises
    ------
    ReconstructionError
        The photos do not show this ground, or nothing shows whether they do.
    """
    if masked.all():
        raise ReconstructionError("all cells are masked, so that no photo shows ground")
    levels = [_at_level(heights, masked, level) for level in LEVELS]
    views = verified_views(levels[CHECKED], views, occluders, parameters)
    deviation = np.zeros(levels[0].grid.shape)
    for number, problem in enumerate(levels):
        if number:
            deviation = _resampled(levels[number - 1].grid, deviation, problem.grid)
        for _ in range(ROUNDS[number]):
            surface = problem.given + deviation
            seen = [observe(view, problem.grid, problem.given, surface, problem.masked, occluders, parameters)
                    for view in views]  # fmt: skip
            deviation = solve_step(problem, surface, seen) - problem.given
    fixed = heights.kind == MEASURED
    refined = limit_slopes(heights.height_m + deviation, heights.grid.cell, fixed)
    return _with_origin(heights, refined, np.logical_or.reduce([view.lit for view in seen]))


def _at_level(heights: HeightMap, masked: np.ndarray, level: int) -> Problem:
    """Return the problem on cells that are `level` times as large."""
    grid = FloorGrid(heights.grid.extent, heights.grid.cell * level)
    known = np.isfinite(heights.sd_m)
    sd = np.where(known, heights.sd_m, ANCHOR_SD)
    return Problem(
        grid,
        given=_resampled(heights.grid, ndimage.gaussian_filter(heights.height_m, (level - 1) / 4), grid),
        sd=_resampled(heights.grid, sd, grid) / level,
        known=_resampled(heights.grid, known.astype(float), grid) > 0.5,
        masked=_resampled(heights.grid, masked.astype(float), grid) > 0.25,
    )


def _resampled(grid: FloorGrid, values: np.ndarray, other: FloorGrid) -> np.ndarray:
    return grid.sample(values, other.centres().reshape(-1, 2)).reshape(other.shape)


def _with_origin(given: HeightMap, refined: np.ndarray, lit: np.ndarray) -> HeightMap:
    """Return a height map with the refined heights; lit (rows - 1, columns - 1): quads with observations.

    Low frequencies of the inferred relief are not reliable: its error is as large as the relief.
    """
    observed = np.zeros(refined.shape, bool)
    for rows in (slice(None, -1), slice(1, None)):
        for columns in (slice(None, -1), slice(1, None)):
            observed[rows, columns] |= lit
    inferred = observed & (given.kind == INVENTED)
    squares = ndimage.gaussian_filter((refined - given.height_m) ** 2, _SPREAD / given.grid.cell)
    size = np.hypot(INFERRED_SD, np.sqrt(squares))
    sd = np.where(inferred, np.minimum(given.sd_m, size), given.sd_m)
    return HeightMap(given.grid, refined, sd, np.where(inferred, INFERRED, given.kind).astype(np.uint8))
