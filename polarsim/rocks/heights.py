"""Heights on a regular grid of the sandbox's floor: gridding of points, filling, smoothing, and interpolation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from polarsim.rocks.scans import Extent

LAYERED = 0.010  # metres of standard deviation above which a cell has several surfaces; a slope of 80 degrees has 8 mm
STRAY_POINTS, STRAY_SHARE = 2, 0.2  # minimum number and share of a cell's points that form an upper surface
_SPLITS = 4  # maximum number of times that a cell's points are split
_RELAXATIONS = 60  # steps of Jacobi's method per pyramid level, starting from the coarser level


@dataclass(frozen=True)
class FloorGrid:
    """Square cells over an extent; arrays on it are (rows along y, columns along x)."""

    extent: Extent
    cell: float  # metres

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns; the last cells may extend beyond the extent."""
        height, width = self.extent.y1 - self.extent.y0, self.extent.x1 - self.extent.x0
        return int(np.ceil(height / self.cell - 1e-9)), int(np.ceil(width / self.cell - 1e-9))

    def centres(self) -> np.ndarray:
        """Return x and y (rows, columns, 2) of the cells' centres."""
        rows, columns = self.shape
        x = self.extent.x0 + (np.arange(columns) + 0.5) * self.cell
        y = self.extent.y0 + (np.arange(rows) + 0.5) * self.cell
        return np.stack(np.meshgrid(x, y), axis=-1)

    def cell_of(self, points: np.ndarray) -> np.ndarray:
        """Return flat cell numbers (n,) of points (n, 2 or 3); -1 outside."""
        rows, columns = self.shape
        column = np.floor((points[:, 0] - self.extent.x0) / self.cell).astype(np.int64)
        row = np.floor((points[:, 1] - self.extent.y0) / self.cell).astype(np.int64)
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(inside, row * columns + column, -1)

    def sample(self, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Interpolate values (rows, columns) at points (n, 2 or 3), bilinear; the border's value outside."""
        column = (points[:, 0] - self.extent.x0) / self.cell - 0.5
        row = (points[:, 1] - self.extent.y0) / self.cell - 0.5
        return ndimage.map_coordinates(values, [row, column], order=1, mode="nearest")


def mean_heights(grid: FloorGrid, points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return weighted mean height and sum of weights of points (n, 3) in every cell; NaN and 0 in empty cells."""
    cells = grid.cell_of(points)
    inside = cells >= 0
    size = grid.shape[0] * grid.shape[1]
    total = np.bincount(cells[inside], weights[inside], size)
    summed = np.bincount(cells[inside], weights[inside] * points[inside, 2], size)
    mean = np.divide(summed, total, out=np.full(size, np.nan), where=total > 0)
    return mean.reshape(grid.shape), total.reshape(grid.shape)


def top_heights(grid: FloorGrid, points: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return `mean_heights` of the upper surface in cells with several surfaces.

    A scan shows the top of an overhang, another scan the surface below; their mean is not a surface. Points of such
    cells are split at their mean height, and the upper points are kept, unless they are few and therefore stray.
    """
    cells, size = grid.cell_of(points), grid.shape[0] * grid.shape[1]
    rows = np.flatnonzero(cells >= 0)
    for _ in range(_SPLITS):
        cell, heights = cells[rows], points[rows, 2]
        count = np.maximum(np.bincount(cell, minlength=size), 1)
        offset = heights - (np.bincount(cell, heights, size) / count)[cell]
        layered = np.bincount(cell, offset**2, size) > count * LAYERED**2
        upper = np.bincount(cell, offset > 0, size)
        stray = (upper < STRAY_POINTS) | (upper < STRAY_SHARE * count)
        keep = ~layered[cell] | ((offset > 0) != stray[cell])
        if keep.all():
            break
        rows = rows[keep]
    return mean_heights(grid, points[rows], weights[rows])


def smoothed(values: np.ndarray, weights: np.ndarray, sigma_cells: float) -> np.ndarray:
    """Smooth by normalised convolution with a Gaussian: values without weight are ignored; NaN far from all values."""
    known = np.where(weights > 0, np.nan_to_num(values), 0.0)
    total = ndimage.gaussian_filter(weights.astype(float), sigma_cells, mode="nearest", truncate=3)
    summed = ndimage.gaussian_filter(known * weights, sigma_cells, mode="nearest", truncate=3)
    return np.divide(summed, total, out=np.full(values.shape, np.nan), where=total > 1e-9 * weights.max(initial=1e-300))


def filled(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fill holes by a membrane: known values are kept, the rest is the solution of Laplace's equation between them.

    The solution is computed from coarse to fine, so that large holes are smooth; borders without values are level.
    """
    if not known.any():
        return np.zeros_like(values)
    if known.all():
        return values.copy()
    start = _from_coarser(values, known) if min(values.shape) > 2 else np.full(values.shape, values[known].mean())
    height = np.where(known, values, start).ravel()
    cell = np.arange(values.size).reshape(values.shape)
    padded = np.pad(cell, 1, mode="edge")
    hole, above, below, left, right = (
        numbers[~known] for numbers in (cell, padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:])
    )
    for _ in range(_RELAXATIONS):
        height[hole] = (height[above] + height[below] + height[left] + height[right]) / 4
    return height.reshape(values.shape)


def _from_coarser(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Solve the problem on cells of twice the size, and interpolate to these cells."""
    rows, columns = values.shape
    even = [(0, rows % 2), (0, columns % 2)]
    counts = np.pad(known.astype(float), even)
    sums = np.pad(np.where(known, values, 0.0), even)
    blocks = (counts.shape[0] // 2, 2, counts.shape[1] // 2, 2)
    count, total = counts.reshape(blocks).sum(axis=(1, 3)), sums.reshape(blocks).sum(axis=(1, 3))
    coarse = filled(np.divide(total, count, out=np.zeros_like(total), where=count > 0), count > 0)
    row, column = (np.arange(rows) - 0.5) / 2, (np.arange(columns) - 0.5) / 2
    return ndimage.map_coordinates(coarse, np.meshgrid(row, column, indexing="ij"), order=1, mode="nearest")


def upward_normals(heights: np.ndarray, cell: float) -> np.ndarray:
    """Return unit normals (rows, columns, 3) of a height field with square cells, metres."""
    along_y, along_x = np.gradient(heights, cell)
    normals = np.stack([-along_x, -along_y, np.ones_like(along_x)], axis=-1)
    return normals / np.linalg.norm(normals, axis=-1, keepdims=True)


def hull_mask(mask: np.ndarray) -> np.ndarray:
    """Return a mask of the cells of a window inside the convex hull of the marked cells."""
    points = np.argwhere(mask)
    try:
        hull = ConvexHull(points)
    except QhullError:  # cells on one line
        return mask
    cells = np.indices(mask.shape).reshape(2, -1)
    inside = np.all(hull.equations[:, :2] @ cells + hull.equations[:, 2:] <= 1e-9, axis=0)
    return np.reshape(inside, mask.shape)
