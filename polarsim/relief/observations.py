"""Observations of the ground: logarithm of a photo at the cells of a grid, and its prediction by reflectance and slope.

An observation belongs to a quad, the square between the centres of four neighbouring cells, because the slope of the
ground is defined there without a bias towards long waves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.geometry.light_field import log_irradiance, terms
from polarsim.geometry.rays import Caster
from polarsim.relief.heights import PhotoView
from polarsim.relief.multigrid import quad_differences
from polarsim.relief.views import orthophoto, unobstructed
from polarsim.render import brdf_numba
from polarsim.render.parameters import Parameters
from polarsim.rocks.heights import FloorGrid

RESIDUAL_SD = 0.15  # of the logarithm of a photo
DARK = -1.0  # logarithm relative to the given surface below which ground is in shadow: the minimum between both kinds
_CAUCHY = 2.4  # residuals of as many standard deviations have half the weight
_FIELD_ROUNDS, _FIELD_SD, _RIDGE = 8, 0.5, 1e-3  # of the fit of the light field
_FIELD_SAMPLES = 5_000
_RIM_CELLS = 4  # cells next to a wall: a shadow that starts here is the wall's
_PER_SIDE = 3  # samples of the photo along each side of a quad
_STEP = 0.01  # of the slope, for derivatives
_GRAZING = 0.02  # smallest cosine of incidence and emergence that the model predicts


@dataclass(frozen=True)
class Rays:
    """Directions from quads to camera and lamp of a view."""

    to_viewer: np.ndarray  # (n, 3) float32 unit vectors
    to_lamp: np.ndarray  # (n, 3) float32 unit vectors


def quad_points(grid: FloorGrid, heights: np.ndarray) -> np.ndarray:
    """Return the centres (rows - 1, columns - 1, 3) of quads on the ground, sandbox frame, metres."""
    level = (heights[1:, 1:] + heights[1:, :-1] + heights[:-1, 1:] + heights[:-1, :-1]) / 4
    plan = grid.centres()[:-1, :-1] + grid.cell / 2
    return np.concatenate([plan, level[..., None]], axis=-1)


def log_picture(view: PhotoView, points: np.ndarray) -> np.ndarray:
    """Return the logarithm (rows, columns) of the mean of a photo in each quad; NaN where any sample is unknown.

    `points` (rows, columns, 3): centres of quads.
    """
    import cv2

    pixels = view.camera.project(points)
    pixels = np.where(view.camera.inside(pixels)[..., None], pixels, -10.0).astype(np.float32)
    rows, columns = pixels.shape[:2]
    size = (columns * _PER_SIDE, rows * _PER_SIDE)
    u, v = (cv2.resize(pixels[..., axis], size, interpolation=cv2.INTER_LINEAR) for axis in range(2))
    mean = (
        orthophoto(view.picture, np.stack([u, v], axis=-1))
        .reshape(rows, _PER_SIDE, columns, _PER_SIDE)
        .mean(axis=(1, 3))
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mean > 0, np.log(mean), np.nan)


def rays_of(view: PhotoView, points: np.ndarray) -> Rays:
    """Return the directions from points (rows, columns, 3)."""
    return Rays(*(_towards(target, points) for target in (view.camera.centre, view.lamp_m)))


def _towards(target: np.ndarray, points: np.ndarray) -> np.ndarray:
    away = target - points.reshape(-1, 3)
    return (away / np.linalg.norm(away, axis=1, keepdims=True)).astype(np.float32)


def slopes_of(grid: FloorGrid, heights: np.ndarray) -> np.ndarray:
    """Return slopes (rows - 1, columns - 1, 2) along x and y in quads."""
    return np.stack(quad_differences(heights), axis=-1) / grid.cell


def log_model(parameters: Parameters, rays: Rays, slopes: np.ndarray) -> np.ndarray:
    """Return log(f_r cos i) (rows, columns) of ground with slopes (rows, columns, 2).

    Ground that faces away from lamp or camera has the value of grazing rays, continued linearly in the cosine.
    """
    flat = slopes.reshape(-1, 2).astype(np.float32)
    normal = np.column_stack([-flat, np.ones(len(flat), np.float32)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    cos_i = (normal * rays.to_lamp).sum(axis=1)
    short = np.float32(_GRAZING) - np.minimum(cos_i, np.float32(_GRAZING))
    raised = normal + short[:, None] * rays.to_lamp
    raised /= np.linalg.norm(raised, axis=1, keepdims=True)
    cos_e = (raised * rays.to_viewer).sum(axis=1)
    lacking = np.float32(_GRAZING) - np.minimum(cos_e, np.float32(_GRAZING))
    raised += lacking[:, None] * rays.to_viewer
    raised /= np.linalg.norm(raised, axis=1, keepdims=True)
    f_r = brdf_numba.reflectance(parameters, np.ascontiguousarray(raised), rays.to_lamp, rays.to_viewer)
    bounded = np.maximum((raised * rays.to_lamp).sum(axis=1), np.float32(1e-3))
    value = np.log(np.maximum(f_r * bounded, np.float32(1e-9))) - short / np.float32(_GRAZING)
    return value.astype(float).reshape(slopes.shape[:-1])


def log_model_and_derivatives(
    parameters: Parameters, rays: Rays, slopes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `log_model` and its derivatives by the slopes along x and y, each (rows, columns)."""
    values = log_model(parameters, rays, slopes)
    steps = (np.array([_STEP, 0.0]), np.array([0.0, _STEP]))
    along_x, along_y = ((log_model(parameters, rays, slopes + step) - values) / _STEP for step in steps)
    return values, along_x, along_y


@dataclass(frozen=True)
class ShadingObservation:
    """Quads of a view; arrays are (rows - 1, columns - 1), with a second dimension of 2 for x and y."""

    residual: np.ndarray  # of the logarithm, less the light field; 0 where not lit
    derivatives: np.ndarray  # (..., 2) of the prediction, by the slopes
    lit: np.ndarray  # bool, not at the edge of a shadow
    shaded: np.ndarray  # bool, by relief
    away: np.ndarray  # (..., 2) horizontal unit vectors from the lamp
    descent: np.ndarray  # slope of the ray along `away`, negative
    contrast: np.ndarray  # logarithm less the given surface's prediction and light; NaN where not visible
    hidden_from_lamp: np.ndarray  # bool, by rocks and walls
    by_wall: np.ndarray  # bool, in the shadow of a wall


def observe(
    view: PhotoView,
    grid: FloorGrid,
    given: np.ndarray,
    surface: np.ndarray,
    masked: np.ndarray,
    occluders: Caster,
    parameters: Parameters,
) -> ShadingObservation:
    """Compare a photo with the prediction by a surface (rows, columns).

    `given` (rows, columns): the surface relative to which shadows are dark.
    """
    points, slopes = quad_points(grid, surface), slopes_of(grid, surface)
    rays = rays_of(view, points)
    value, *derivatives = log_model_and_derivatives(parameters, rays, slopes)
    flat = log_model(parameters, rays, slopes_of(grid, given))
    picture = log_picture(view, points)
    free = ~(masked[1:, 1:] | masked[1:, :-1] | masked[:-1, 1:] | masked[:-1, :-1])
    visible = free & np.isfinite(picture) & unobstructed(points, view.camera.centre, occluders)
    hidden = ~unobstructed(points, view.lamp_m, occluders)
    contrast = picture - flat - light_field(points, picture - flat, visible & ~hidden)
    dark = visible & (contrast < DARK)
    by_wall = _connected(visible & (dark | hidden), _rim(masked))
    ground = visible & ~hidden & ~by_wall
    lit = ground & ~ndimage.binary_dilation(dark, np.ones((3, 3), bool))
    residual = picture - value - light_field(points, picture - value, lit)
    away = points[..., :2] - view.lamp_m[:2]
    distance = np.linalg.norm(away, axis=-1)
    return ShadingObservation(
        np.where(lit, residual, 0.0),
        np.stack(derivatives, axis=-1),
        lit,
        ground & dark,
        away / distance[..., None],
        (points[..., 2] - view.lamp_m[2]) / distance,
        np.where(visible, contrast, np.nan),
        hidden,
        by_wall,
    )


def light_field(points: np.ndarray, values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the logarithm (rows, columns) of a light field that fits the chosen values, robust against shadows."""
    if not chosen.any():
        return np.zeros(values.shape)
    at, value = points[chosen], values[chosen]
    step = max(1, len(value) // _FIELD_SAMPLES)
    at, value = at[::step], value[::step]
    design = np.column_stack([np.ones(len(at)), terms(at)])
    fitted = np.full(len(value), np.median(value))
    solution = np.zeros(design.shape[1])
    for _ in range(_FIELD_ROUNDS):
        offset = value - fitted
        weighted = design * np.where(offset < DARK, 0.0, 1 / (1 + (offset / _FIELD_SD) ** 2))[:, None]
        # einsum instead of BLAS, whose results depend on the number of threads
        normal = np.einsum("ni,nj->ij", weighted, design) + _RIDGE * np.eye(len(solution))
        solution = np.linalg.solve(normal, np.einsum("ni,n->i", weighted, value))
        fitted = np.einsum("ni,i->n", design, solution)
    brightness, *coefficients = solution.tolist()
    return brightness + log_irradiance(coefficients, points.reshape(-1, 3)).reshape(values.shape)


def cauchy_weight(residual: np.ndarray) -> np.ndarray:
    """Return weights of residuals, 1 for small ones."""
    return 1 / (1 + (residual / (_CAUCHY * RESIDUAL_SD)) ** 2)


def _rim(masked: np.ndarray) -> np.ndarray:
    """Return quads (rows - 1, columns - 1) next to the walls or the border."""
    labels, _ = ndimage.label(np.pad(masked, 1, constant_values=True))
    rim = (labels == labels[0, 0])[1:-1, 1:-1]
    return np.asarray(ndimage.binary_dilation(rim, iterations=_RIM_CELLS)[1:, 1:])


def _connected(mask: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """Return the connected parts of a mask that contain a seed."""
    labels, count = ndimage.label(mask, np.ones((3, 3)))
    found = np.zeros(count + 1, bool)
    found[labels[seed & mask]] = True
    found[0] = False
    return found[labels]
