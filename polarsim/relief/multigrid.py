"""Quadratic energy of a height field and its minimum, by conjugate gradients with a multigrid preconditioner.

The energy of heights h (rows, columns) is

    sum over quads of  g . M g / 2 - b . g      g: differences of h along x and y in the quad between four cells
  + sum over cells of  pull (h - target)^2 / 2
  + stiffness / 2 * sum of squared second differences of h (h_xx^2 + 2 h_xy^2 + h_yy^2: a thin plate with free edges)

Long waves converge slowly by conjugate gradients alone: 600 steps are not enough on a grid of 800 x 800 cells. Each
level of the preconditioner has twice the cell size and is smoothed by symmetric Gauss-Seidel sweeps (Briggs, Henson,
McCormick, A Multigrid Tutorial, 2nd edition, SIAM 2000). Sums do not use BLAS, so that the number of threads changes no
bit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from polarsim.kernels import njit

TOLERANCE = 1e-3  # of the norm of the residual, relative to that of the start
MAX_STEPS = 60
_COARSEST = 6  # rows or columns of a level that is solved directly
_SWEEPS = 2  # Gauss-Seidel sweeps before and after the coarse correction
# Offsets (row, column) of the 13 coefficients of a cell; number k and 12 - k are opposite.
_OFFSETS = (
    (-2, 0), (-1, -1), (-1, 0), (-1, 1), (0, -2), (0, -1), (0, 0), (0, 1), (0, 2), (1, -1), (1, 0), (1, 1), (2, 0),
)  # fmt: skip
_NUMBER = np.full((5, 5), -1)
for _index, (_row, _column) in enumerate(_OFFSETS):
    _NUMBER[_row + 2, _column + 2] = _index
_ROW, _COLUMN = (np.array([offset[axis] for offset in _OFFSETS]) for axis in range(2))
_CENTRE = 6


@dataclass(frozen=True)
class Energy:
    """Quadratic energy of heights, in differences between neighbouring cells."""

    curvature: np.ndarray  # (rows - 1, columns - 1, 3) M_xx, M_xy, M_yy of each quad, 1/m^2
    slope: np.ndarray  # (rows - 1, columns - 1, 2) b_x, b_y of each quad, 1/m
    pull: np.ndarray  # (rows, columns) 1/m^2; positive somewhere
    target: np.ndarray  # (rows, columns) metres; ignored without pull
    stiffness: float  # 1/m^2


def quad_differences(heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean differences along x and y (rows - 1, columns - 1) of the four cells around each quad."""
    along_x, along_y = heights[:, 1:] - heights[:, :-1], heights[1:] - heights[:-1]
    return (along_x[1:] + along_x[:-1]) / 2, (along_y[:, 1:] + along_y[:, :-1]) / 2


def minimise(energy: Energy, start: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
    """Return the heights (rows, columns) of minimum energy, from a start (rows, columns)."""
    levels = _levels(energy)
    matrix = levels[0].matrix
    heights = np.array(start, float)
    residual = _load(energy) - _product(matrix, heights)
    norm = _norm(residual)
    if norm == 0:
        return heights
    direction, former = np.zeros_like(heights), 1.0
    for _ in range(MAX_STEPS):
        improved = _cycle(levels, 0, residual)
        now = float((residual * improved).sum())
        direction = improved + (now / former) * direction
        product = _product(matrix, direction)
        step = now / float((direction * product).sum())
        heights += step * direction
        residual -= step * product
        former = now
        if _norm(residual) < tolerance * norm:
            break
    return heights


@dataclass(frozen=True)
class _Level:
    matrix: np.ndarray  # (rows, columns, 13)
    rows_from_coarse: sparse.csr_array | None  # None: the coarsest level
    columns_from_coarse: sparse.csr_array | None
    inverse: np.ndarray | None  # of the coarsest level


def _levels(energy: Energy) -> list[_Level]:
    levels: list[_Level] = []
    curvature, pull, stiffness = energy.curvature, energy.pull, energy.stiffness
    while True:
        matrix = _assemble(np.ascontiguousarray(curvature), np.ascontiguousarray(pull), stiffness, _NUMBER)
        if min(pull.shape) <= _COARSEST:
            return [*levels, _Level(matrix, None, None, np.linalg.inv(_dense(matrix)))]
        by_rows, by_columns = (_interpolation(size) for size in pull.shape)
        levels.append(_Level(matrix, by_rows, by_columns, None))
        curvature, pull = _halved(curvature), by_rows.T @ pull @ by_columns
        stiffness /= 4  # second differences are four times as large, of a quarter of the cells


def _halved(quads: np.ndarray) -> np.ndarray:
    """Return the means of 2 x 2 quads; differences are twice as large, of a quarter of the quads."""
    rows, columns = quads.shape[:2]
    even = np.pad(quads, [(0, rows % 2), (0, columns % 2), (0, 0)])
    return (even[::2, ::2] + even[1::2, ::2] + even[::2, 1::2] + even[1::2, 1::2]) / 4


def _interpolation(size: int) -> sparse.csr_array:
    """Return the matrix (size, coarse) that interpolates from every second cell: cubic, linear near ends."""
    coarse = (size - 1) // 2 + 1 if size % 2 else size // 2 + 1
    rows, columns, values = [], [], []
    for cell in range(size):
        left = cell // 2
        if cell % 2 == 0:
            terms = [(left, 1.0)]
        elif left >= 1 and left + 2 < coarse:
            terms = [(left - 1, -1 / 16), (left, 9 / 16), (left + 1, 9 / 16), (left + 2, -1 / 16)]
        else:
            terms = [(left, 0.5), (left + 1, 0.5)]
        for column, value in terms:
            rows.append(cell)
            columns.append(column)
            values.append(value)
    return sparse.csr_array((values, (rows, columns)), shape=(size, coarse))


def _load(energy: Energy) -> np.ndarray:
    """Return the negative gradient of the energy at heights of zero."""
    load = energy.pull * np.where(energy.pull > 0, energy.target, 0.0)
    half_x, half_y = energy.slope[..., 0] / 2, energy.slope[..., 1] / 2
    load[:-1, :-1] -= half_x + half_y
    load[:-1, 1:] += half_x - half_y
    load[1:, :-1] += half_y - half_x
    load[1:, 1:] += half_x + half_y
    return load


def _cycle(levels: list[_Level], number: int, residual: np.ndarray) -> np.ndarray:
    """Return an approximate correction for a residual: one symmetric V-cycle."""
    level = levels[number]
    if level.inverse is not None:
        return (level.inverse * residual.ravel()).sum(axis=1).reshape(residual.shape)
    correction = np.zeros_like(residual)
    for _ in range(_SWEEPS):
        _sweep(level.matrix, residual, correction, _ROW, _COLUMN, forward=True)
    left = residual - _product(level.matrix, correction)
    by_rows, by_columns = level.rows_from_coarse, level.columns_from_coarse
    assert by_rows is not None
    assert by_columns is not None
    coarse = _cycle(levels, number + 1, by_rows.T @ left @ by_columns)
    correction += by_rows @ coarse @ by_columns.T
    for _ in range(_SWEEPS):
        _sweep(level.matrix, residual, correction, _ROW, _COLUMN, forward=False)
    return correction


def _norm(values: np.ndarray) -> float:
    return float(np.sqrt((values * values).sum()))


def _product(matrix: np.ndarray, values: np.ndarray) -> np.ndarray:
    return _multiply(matrix, values, _ROW, _COLUMN)


def _dense(matrix: np.ndarray) -> np.ndarray:
    rows, columns = matrix.shape[:2]
    unit = np.eye(rows * columns).reshape(-1, rows, columns)
    return np.stack([_product(matrix, one).ravel() for one in unit], axis=1)


@njit(error_model="numpy")
def _assemble(curvature, pull, stiffness, number):  # type: ignore[no-untyped-def]
    """Return the coefficients (rows, columns, 13) of the gradient of the energy."""
    rows, columns = pull.shape
    matrix = np.zeros((rows, columns, 13))
    matrix[:, :, 6] = pull
    signs_x, signs_y = (-0.5, 0.5, -0.5, 0.5), (-0.5, -0.5, 0.5, 0.5)  # of the cells 00, 01, 10, 11 of a quad
    twist = (1.0, -1.0, -1.0, 1.0)
    for row in range(rows - 1):
        for column in range(columns - 1):
            xx, xy, yy = curvature[row, column, 0], curvature[row, column, 1], curvature[row, column, 2]
            for one in range(4):
                for two in range(4):
                    value = xx * signs_x[one] * signs_x[two] + yy * signs_y[one] * signs_y[two]
                    value += xy * (signs_x[one] * signs_y[two] + signs_y[one] * signs_x[two])
                    value += 2 * stiffness * twist[one] * twist[two]
                    down, right = two // 2 - one // 2, two % 2 - one % 2
                    matrix[row + one // 2, column + one % 2, number[down + 2, right + 2]] += value
    bend = (1.0, -2.0, 1.0)
    for row in range(rows):
        for column in range(columns):
            for one in range(3):
                for two in range(3):
                    value = stiffness * bend[one] * bend[two]
                    if column + 2 < columns:
                        matrix[row, column + one, number[2, two - one + 2]] += value
                    if row + 2 < rows:
                        matrix[row + one, column, number[two - one + 2, 2]] += value
    return matrix


@njit(error_model="numpy")
def _multiply(matrix, values, down, right):  # type: ignore[no-untyped-def]
    rows, columns = values.shape
    product = np.zeros_like(values)
    for row in range(rows):
        for column in range(columns):
            total = 0.0
            for k in range(13):
                r, c = row + down[k], column + right[k]
                if 0 <= r < rows and 0 <= c < columns:
                    total += matrix[row, column, k] * values[r, c]
            product[row, column] = total
    return product


@njit(error_model="numpy")
def _sweep(matrix, load, values, down, right, forward):  # type: ignore[no-untyped-def]
    """Solve for each cell in turn, given its neighbours, in ascending or descending order."""
    rows, columns = values.shape
    for number in range(rows * columns):
        cell = number if forward else rows * columns - 1 - number
        row, column = cell // columns, cell % columns
        total = load[row, column]
        for k in range(13):
            if k != 6:
                r, c = row + down[k], column + right[k]
                if 0 <= r < rows and 0 <= c < columns:
                    total -= matrix[row, column, k] * values[r, c]
        values[row, column] = total / matrix[row, column, 6]
