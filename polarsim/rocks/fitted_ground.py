"""Ground under published rock meshes: a thin plate through the rocks' feet, with slopes up to the angle of repose.

The plate is the deviation from a robust plane or quadric. It minimises three energies: bending, distance from the base
surface, and squared distance from the feet. The gradient is bounded by the alternating direction method of multipliers
(Boyd et al., Foundations and Trends in Machine Learning 3 (2011) 1), which converges without guaranteeing the bound
exactly; a single factor for the entire plate guarantees it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse.linalg import splu

from polarsim.randomness import without_negative_zeros
from polarsim.rocks.heights import FloorGrid

FITTED_GROUND_CELL = 0.01  # cell of a ground that is fitted under published meshes, metres
MAX_SLOPE_DEG = 35.0  # angle of repose of dry sand
# Error for a left-out rock on six published terrains: mean 13.4 mm; 14.4 by inverse distances, 17.3 by the base only.
FOOT_SD = 0.020  # metres: of a rock's foot from the ground
RELIEF_SD = 0.05  # metres: of the ground from the base surface, at a distance from feet
RELIEF_LENGTH = 0.25  # metres over which the ground returns to the base surface
QUADRIC_FROM = 20  # minimum number of rocks for a quadric, by left-out errors of five terrains
TUKEY_SCALE = 0.010  # metres: feet that are several times as far off the base surface have no weight
MIN_SUPPORT = 0.1  # minimum share of the feet, by weight, that support the base surface
ITERATIONS = 30
_PLATE_CELL = 0.04  # metres: cell of the solution, because the plate is smooth over 0.25 m
_STEEPEST = np.tan(np.radians(MAX_SLOPE_DEG)) - 5e-4  # mesh files round heights to 1e-6 m, over cells of 1 cm
_STEEPEST_PLATE = 0.98 * _STEEPEST  # splines between coarse cells are slightly steeper
_PENALTY, _ROUNDS = 20.0, 100  # of the alternating direction method; slopes are then within 0.2 degrees of the bound


def fit_ground(rims: Sequence[np.ndarray], grid: FloorGrid) -> np.ndarray:
    """Return heights (rows, columns) of a ground through the feet of rocks; level z = 0 without rocks.

    Feet on a plane return this plane. Neither the order of rocks and points nor copies of a rock change the result. No
    triangle between neighbouring cells is steeper than `MAX_SLOPE_DEG`.

    `rims`, sequence of (n, 3): points of each rock's foot, metres. All rocks have the same weight, independent of their
    number of points.
    """
    feet = _distinct(rims)
    if not feet:
        return np.zeros(grid.shape)
    points = np.concatenate(feet)
    shares = np.concatenate([np.full(len(foot), 1 / len(foot)) for foot in feet])
    base = _base(points, shares, grid, quadric=len(feet) >= QUADRIC_FROM)
    plate = _plate(points, points[:, 2] - _terms(points) @ base, shares, base, grid)
    level = (_terms(grid.centres().reshape(-1, 2)) @ base).reshape(grid.shape)
    return level + _largest_factor(level, plate, grid.cell) * plate


def _distinct(rims: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return distinct rims with sorted, distinct points, in an order that depends only on their points."""
    distinct = [np.unique(without_negative_zeros(np.asarray(foot, float)).reshape(-1, 3), axis=0) for foot in rims]
    by_content = {foot.tobytes(): foot for foot in distinct if len(foot)}
    return [by_content[content] for content in sorted(by_content)]


def _terms(points: np.ndarray) -> np.ndarray:
    """Return monomials (n, 6) of x and y up to degree 2; the first three define a plane."""
    x, y = points[:, 0], points[:, 1]
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)


def _base(points: np.ndarray, shares: np.ndarray, grid: FloorGrid, *, quadric: bool) -> np.ndarray:
    """Return coefficients (6,) of a robust plane, or quadric, that is nowhere in the grid steeper than allowed."""
    if quadric:
        quadric_fit = _robust_fit(_terms(points), points[:, 2], shares)
        corners = np.array(np.meshgrid(*_sides(grid))).reshape(2, -1).T
        if _gradient(quadric_fit, corners).max() <= _STEEPEST:  # linear over the grid: largest at a corner
            return quadric_fit
    plane = np.zeros(6)
    plane[:3] = _robust_fit(_terms(points)[:, :3], points[:, 2], shares)
    slope = float(np.hypot(*plane[1:3]))
    if slope > _STEEPEST:
        plane[1:3] *= _STEEPEST / slope
        plane[0] = np.average(points[:, 2] - points[:, :2] @ plane[1:3], weights=shares)
    return plane


def _sides(grid: FloorGrid) -> tuple[tuple[float, float], tuple[float, float]]:
    rows, columns = grid.shape
    x0, y0 = grid.extent.x0, grid.extent.y0
    return (x0, x0 + columns * grid.cell), (y0, y0 + rows * grid.cell)


def _gradient(base: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return tangents (n,) of the slope of a base surface at points (n, 2)."""
    x, y = points.T
    return np.hypot(base[1] + 2 * base[3] * x + base[4] * y, base[2] + base[4] * x + 2 * base[5] * y)


def _robust_fit(terms: np.ndarray, heights: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Fit by least squares, reweighted by Tukey's biweight; its scale shrinks from the spread of the first fit.

    If the feet agree on no surface, return the last fit with enough support.
    """
    weights = shares
    scale = np.inf
    coefficients = np.zeros(terms.shape[1])
    for _ in range(ITERATIONS):
        if weights.sum() < MIN_SUPPORT * shares.sum():
            break
        root = np.sqrt(weights)[:, None]
        coefficients = np.linalg.lstsq(terms * root, heights * root[:, 0], rcond=None)[0]
        residuals = heights - terms @ coefficients
        scale = max(TUKEY_SCALE, min(scale * 0.8, 1.4826 * float(np.median(np.abs(residuals)))))
        weights = shares * np.clip(1 - (residuals / (4.685 * scale)) ** 2, 0, 1) ** 2
    return coefficients


def _plate(
    points: np.ndarray, above_base: np.ndarray, shares: np.ndarray, base: np.ndarray, grid: FloorGrid
) -> np.ndarray:
    """Return the deviation (rows, columns) from the base surface; its slope may exceed the bound slightly.

    `above_base` (n,): heights of the feet above the base surface, metres.
    `shares` (n,): weights of the feet, 1 in sum for each rock.
    """
    coarse = FloorGrid(grid.extent, max(grid.cell, _PLATE_CELL))
    inside = coarse.cell_of(points) >= 0
    at_feet = _interpolation(coarse, points[inside])
    weighted = at_feet.T.multiply(shares[inside] / FOOT_SD**2).tocsr()
    stiffness = (weighted @ at_feet + _stiffness(coarse)).tocsc()
    load = weighted @ above_base[inside]
    plate = splu(stiffness).solve(load)
    gradients = _gradients(coarse)
    x, y = coarse.centres().reshape(-1, 2).T
    level = gradients @ (_terms(np.column_stack([x, y])) @ base)
    if _slopes(gradients @ plate + level).max() > _STEEPEST_PLATE:
        plate = _bounded(stiffness, load, plate, gradients, level)
    x, y = np.moveaxis(grid.centres(), -1, 0)
    at = [(y - grid.extent.y0) / coarse.cell - 0.5, (x - grid.extent.x0) / coarse.cell - 0.5]
    return np.asarray(ndimage.map_coordinates(plate.reshape(coarse.shape), at, order=3, mode="nearest"))


def _interpolation(grid: FloorGrid, points: np.ndarray) -> sparse.csr_array:
    """Return weights (n, cells) of the four cells around each point (n, 3): bilinear, the border's value outside."""
    rows, columns = grid.shape
    column = np.clip((points[:, 0] - grid.extent.x0) / grid.cell - 0.5, 0, columns - 1)
    row = np.clip((points[:, 1] - grid.extent.y0) / grid.cell - 0.5, 0, rows - 1)
    left, low = np.minimum(column.astype(int), columns - 2), np.minimum(row.astype(int), rows - 2)
    across, up = column - left, row - low
    weights = [(1 - across) * (1 - up), across * (1 - up), (1 - across) * up, across * up]
    cells = [(low + step_up) * columns + left + step for step_up in (0, 1) for step in (0, 1)]
    number = np.tile(np.arange(len(points)), 4)
    shape = (len(points), rows * columns)
    return sparse.csr_array((np.concatenate(weights), (number, np.concatenate(cells))), shape=shape)


def _differences(count: int, *coefficients: float) -> sparse.csr_array:
    order = len(coefficients) - 1
    return sparse.diags_array(coefficients, offsets=range(order + 1), shape=(count - order, count), format="csr")


def _stiffness(grid: FloorGrid) -> sparse.csr_array:
    """Return the Hessian (cells, cells) of the energy of a thin plate on an elastic foundation.

    The scale makes `RELIEF_SD` the standard deviation of the infinite plate: its deflection under a unit load is
    1 / (8 sqrt(k D)) (Timoshenko and Woinowsky-Krieger, Theory of Plates and Shells, 1959, section 57).
    """
    rows, columns = grid.shape
    one_row, one_column = sparse.eye_array(rows), sparse.eye_array(columns)
    across = sparse.kron(one_row, _differences(columns, 1.0, -2.0, 1.0))
    up = sparse.kron(_differences(rows, 1.0, -2.0, 1.0), one_column)
    twist = sparse.kron(_differences(rows, -1.0, 1.0), _differences(columns, -1.0, 1.0))
    bending = (across.T @ across + up.T @ up + 2 * (twist.T @ twist)) / grid.cell**4
    energy = RELIEF_LENGTH**4 * bending + sparse.eye_array(rows * columns)
    return (energy * (grid.cell / RELIEF_SD) ** 2 / (8 * RELIEF_LENGTH**2)).tocsr()


def _gradients(grid: FloorGrid) -> sparse.csr_array:
    """Return an operator (4 n, cells): slopes along x and y at lower left corners of n squares, then upper right."""
    rows, columns = grid.shape
    along_x, along_y = _differences(columns, -1.0, 1.0) / grid.cell, _differences(rows, -1.0, 1.0) / grid.cell
    lower, upper = sparse.eye_array(rows, format="csr")[:-1], sparse.eye_array(rows, format="csr")[1:]
    left, right = sparse.eye_array(columns, format="csr")[:-1], sparse.eye_array(columns, format="csr")[1:]
    parts = [(lower, along_x), (along_y, left), (upper, along_x), (along_y, right)]
    return sparse.csr_array(sparse.vstack([sparse.kron(*pair, format="csr") for pair in parts]))


def _slopes(gradients: np.ndarray) -> np.ndarray:
    """Return tangents (2, 1, n) of slopes from gradients in the order of `_gradients`."""
    pairs = gradients.reshape(2, 2, -1)
    return np.hypot(pairs[:, :1], pairs[:, 1:])


def _bounded(
    stiffness: sparse.csc_array, load: np.ndarray, plate: np.ndarray, gradients: sparse.csr_array, level: np.ndarray
) -> np.ndarray:
    """Return the plate of minimum energy with bounded gradients, including those of the base surface (`level`)."""
    solved = splu((stiffness + _PENALTY * (gradients.T @ gradients)).tocsc())
    multiplier = np.zeros(len(level))
    for _ in range(_ROUNDS):
        wanted = gradients @ plate + multiplier + level
        excess = np.maximum(_slopes(wanted) / _STEEPEST_PLATE, 1)
        allowed = (wanted.reshape(2, 2, -1) / excess).ravel() - level
        multiplier = wanted - level - allowed
        plate = solved.solve(load + _PENALTY * (gradients.T @ (allowed - multiplier)))
    return plate


def _largest_factor(level: np.ndarray, plate: np.ndarray, cell: float) -> float:
    """Return the largest factor, up to 1, of a plate (rows, columns) on a base surface that bounds all slopes.

    The slope of a triangle of neighbouring cells is a difference along x and a difference along y at a corner of a
    square. Therefore all four corners of each square are checked; the base surface without plate is within the bound.
    """
    factor = 1.0
    (x0, y0), (x1, y1) = (
        (np.diff(heights, axis=1) / cell, np.diff(heights, axis=0) / cell) for heights in (level, plate)
    )
    for lower in (slice(None, -1), slice(1, None)):
        for left in (slice(None, -1), slice(1, None)):
            first, second = (x0[lower], y0[:, left]), (x1[lower], y1[:, left])
            square = second[0] ** 2 + second[1] ** 2
            across = first[0] * second[0] + first[1] * second[1]
            room = np.maximum(_STEEPEST**2 - first[0] ** 2 - first[1] ** 2, 0)
            steep = square + 2 * across > room  # for factor 1
            if steep.any():
                square, across, room = square[steep], across[steep], room[steep]
                factor = min(factor, float(((np.sqrt(across**2 + square * room) - across) / square).min()))
    return factor
