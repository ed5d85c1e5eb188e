"""Thin plates through measured cells, which continue slopes into unmeasured cells."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from polarsim.rocks.heights import FloorGrid, filled

CELL_M = 0.04  # cell of the plate, because it is smooth over decimetres
STIFF_M = 0.10  # bending counts more than tension below this length, metres: a plate without tension overshoots
DATA_WEIGHT = 100.0  # weight of a cell with measurements everywhere, relative to tension


def plate_filled(grid: FloorGrid, values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Return values (rows, columns) at known cells, elsewhere a plate under tension through them.

    The plate minimises the squares of its gradient and, times `STIFF_M` squared, of its Laplacian, and of its distance
    from the known cells. Differences at known cells are spread by a membrane.
    """
    if not known.any() or known.all():
        return filled(values, known)
    coarse = FloorGrid(grid.extent, max(CELL_M, grid.cell))
    rows, columns = coarse.shape
    cell = coarse.cell_of(np.concatenate([grid.centres(), np.zeros((*grid.shape, 1))], axis=-1).reshape(-1, 3))
    cell = np.clip(cell, 0, rows * columns - 1)
    flat = known.ravel()
    count = np.bincount(cell[flat], minlength=rows * columns)
    mean = np.bincount(cell[flat], values.ravel()[flat], rows * columns) / np.maximum(count, 1)
    weight = DATA_WEIGHT * count * (grid.cell / coarse.cell) ** 2
    gradient = sparse.vstack(
        [sparse.kron(sparse.eye_array(rows), _steps(columns)), sparse.kron(_steps(rows), sparse.eye_array(columns))]
    )
    laplacian = gradient.T @ gradient
    stiffness = laplacian + (STIFF_M / coarse.cell) ** 2 * (laplacian @ laplacian)
    plate = splu((stiffness + sparse.diags_array(weight)).tocsc()).solve(weight * mean).reshape(rows, columns)
    smooth = coarse.sample(plate, grid.centres().reshape(-1, 2)).reshape(grid.shape)
    return smooth + filled(np.where(known, values - smooth, 0.0), known)


def _steps(count: int) -> sparse.csr_array:
    """Return differences (count - 1, count) of neighbours."""
    return sparse.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(count - 1, count), format="csr")
