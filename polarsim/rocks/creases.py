"""Separation of touching rocks: a surface is cut along its creases, and pieces are joined while they form one body.

Two bodies that touch meet in a concave crease, and do not fill their common convex hull; the facets of a single rock
meet in shallow or short creases. Pieces are joined pairwise, most certain pairs first (supervoxels joined by convexity:
Stein et al., CVPR 2014; learned agglomeration: Nunez-Iglesias et al., PLoS ONE 8 (2013) e71715).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.spatial import ConvexHull, QhullError

from polarsim.rocks.heights import hull_mask, upward_normals

CURVATURE_SMOOTHING = 0.0075  # metres, sigma of the heights for curvatures
NORMAL_SMOOTHING = 0.005  # metres, sigma of the heights for normals
BORDER_SMOOTHING = 0.0125  # metres, sigma of the weights of normals near a border's cell
CREASE_DEPTH = 15.0  # minimum curvature of a crease above the centres of both pieces, 1 / m
CURVATURES = (-60.0, 120.0)  # 1 / m: curvatures are clipped to this range
SMALLEST = 12  # minimum number of cells of a piece
FOLD = 0.25  # radians: minimum angle of a folded border
PLANES = 400  # of a hull that are evaluated at a time
BODY_BASE = 0.02  # metres below the lowest point to which a body is extended

TERMS = (
    "folded",  # share of the border along which the two pieces meet in a fold
    "hidden",  # share of the border that was not scanned
    "opened",  # mean depth of the surface below the hull of both, minus that below their separate hulls, over height
    "notched",  # mean share of the plan's hull that each fills, minus the share that both fill together
    "area",  # logarithm of the area of the smaller piece, of 25 cm^2
    "ratio",  # logarithm of the ratio of both areas
)
# Coefficients of the log odds of two rocks: a constant, and one per term. Fitted by `benchmarks/touching.py --fit`.
COEFFICIENTS = (-6.2752, 2.6718, 2.9554, 48.7345, 6.1915, 0.8593, 0.9491)


@dataclass(frozen=True)
class Relief:
    """Surface above the ground; arrays are (rows, columns)."""

    above: np.ndarray  # heights above the ground, metres, hidden cells filled
    seen: np.ndarray  # cells with a measured surface
    cell: float  # side of a cell, metres

    @cached_property
    def points(self) -> np.ndarray:
        """Points (rows, columns, 3), metres."""
        rows, columns = np.indices(self.above.shape) * self.cell
        return np.stack([columns, rows, self.above], axis=-1)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normals (rows, columns, 3), upwards."""
        return upward_normals(ndimage.gaussian_filter(self.above, NORMAL_SMOOTHING / self.cell), self.cell)

    @cached_property
    def bend(self) -> np.ndarray:
        """Larger principal curvature of the surface, 1 / m: positive if it is concave in some direction."""

        def slope(*order: int) -> np.ndarray:
            return ndimage.gaussian_filter(self.above, CURVATURE_SMOOTHING / self.cell, order=order) / self.cell ** sum(
                order
            )

        p, q, r, s, t = slope(0, 1), slope(1, 0), slope(0, 2), slope(1, 1), slope(2, 0)
        squared = 1 + p**2 + q**2
        mean = ((1 + q**2) * r - 2 * p * q * s + (1 + p**2) * t) / (2 * squared**1.5)
        gauss = (r * t - s**2) / squared**2
        return np.asarray(np.clip(mean + np.sqrt(np.maximum(mean**2 - gauss, 0)), *CURVATURES))


def cut_along_creases(relief: Relief, labels: np.ndarray) -> np.ndarray:
    """Return numbers (rows, columns) from 1 of the pieces between creases, 0 outside of connected regions `labels`."""
    pieces = basins(relief.bend, labels, CREASE_DEPTH)
    while True:
        sizes = np.bincount(pieces.ravel())
        moved = False
        for number in sorted(np.flatnonzero((sizes > 0) & (sizes < SMALLEST)), key=lambda n: (sizes[n], n)):
            window, small = _window(np.flatnonzero(pieces == number), pieces.shape, 1)
            border = ndimage.binary_dilation(small, np.ones((3, 3), bool)) & ~small & (pieces[window] > 0)
            if small.any() and border.any():
                others, which = np.unique(pieces[window][border], return_inverse=True)
                bend = np.bincount(which, relief.bend[window][border]) / np.bincount(which)
                pieces[window][small] = others[bend.argmin()]
                moved = True
        if not moved:
            return np.unique(np.append(0, pieces), return_inverse=True)[1][1:].reshape(pieces.shape)


def basins(values: np.ndarray, labels: np.ndarray, depth: float) -> np.ndarray:
    """Return numbers (rows, columns) from 1 of the basins of `values` inside `labels`, 0 outside.

    Cells are visited from the lowest to the highest and join adjacent basins. A cell between two basins is the pass
    between them: both are merged if one is less than `depth` deep below the pass (merge tree of a field).
    """
    padded = np.pad(values, 1)  # every cell has neighbours
    cells = np.flatnonzero(np.pad(labels, 1))
    cells = cells[np.argsort(padded.ravel()[cells], kind="stable")]
    levels, width = padded.ravel().tolist(), padded.shape[1]
    steps = [-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1]
    owner: dict[int, int] = {}
    parent: dict[int, int] = {}
    for cell in cells.tolist():
        touched = {_root(parent, owner[cell + step]) for step in steps if cell + step in owner}
        lowest = min(touched, key=lambda c: (levels[c], c), default=cell)
        parent.setdefault(lowest, lowest)
        owner[cell] = lowest
        for basin in touched - {lowest}:
            if levels[cell] - levels[basin] < depth:
                parent[basin] = lowest
    result = np.zeros(padded.size, np.int64)
    roots = [_root(parent, owner[cell]) for cell in cells.tolist()]
    result[cells] = np.unique(roots, return_inverse=True)[1] + 1 if roots else 0
    return result.reshape(padded.shape)[1:-1, 1:-1]


def _root(parent: dict[int, int], basin: int) -> int:
    while parent[basin] != basin:
        basin = parent[basin]
    return basin


def neighbours(parts: np.ndarray) -> set[tuple[int, int]]:
    """Return pairs of adjacent parts, lower number first."""
    sides = [(parts[:, :-1], parts[:, 1:]), (parts[:-1], parts[1:])]
    pairs = np.concatenate(
        [np.stack([a[meet], b[meet]], axis=1) for a, b in sides for meet in [(a != b) & (a * b > 0)]]
    )
    return {(int(low), int(high)) for low, high in np.unique(np.sort(pairs, axis=1), axis=0)}


@dataclass(frozen=True)
class _Body:
    cells: np.ndarray  # (n,) flat
    peak: float  # metres
    hollow: float  # mean depth of the surface below its hull, metres
    solidity: float  # share of the hull of its plan that the body fills


class Joining:
    """Agglomeration of pieces into bodies, pair by pair."""

    def __init__(self, relief: Relief, pieces: np.ndarray):
        self.relief, self.parts = relief, pieces.copy()
        order = np.argsort(pieces.ravel(), kind="stable")
        numbers, starts = np.unique(pieces.ravel()[order], return_index=True)
        self.bodies = {
            int(number): self._body(cells)
            for number, cells in zip(numbers, np.split(order, starts[1:]), strict=True)
            if number > 0
        }
        self._joint: dict[tuple[int, int], _Body] = {}  # body of each pair after joining
        self.pairs = {pair: self._terms(*pair) for pair in sorted(neighbours(pieces))}

    def join(self, first: int, second: int) -> None:
        """Join two neighbours under the lower number."""
        first, second = min(first, second), max(first, second)
        del self.bodies[second]
        self.bodies[first] = self._joint[first, second]
        self.parts.ravel()[self.bodies[first].cells] = first
        about = {number for pair in self.pairs if {first, second} & set(pair) for number in pair} - {first, second}
        self.pairs = {pair: terms for pair, terms in self.pairs.items() if not {first, second} & set(pair)}
        self._joint = {pair: self._joint[pair] for pair in self.pairs}
        self.pairs |= {(min(first, n), max(first, n)): self._terms(first, n) for n in sorted(about)}

    def join_below(self, chance: float, of_two: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Join the most certain pair while a pair's chance of being two rocks is below `chance`; return the parts."""
        while self.pairs:
            chances = of_two(np.array(list(self.pairs.values())))
            if chances.min() >= chance:
                break
            self.join(*list(self.pairs)[int(chances.argmin())])
        return self.parts.copy()

    def _body(self, cells: np.ndarray) -> _Body:
        plan = _window(cells, self.parts.shape, 0)[1]
        return _Body(
            cells,
            peak=float(self.relief.above.ravel()[cells].max()),
            hollow=float(depths_below_hull(self.relief.points.reshape(-1, 3)[cells]).mean()),
            solidity=float(plan.sum() / hull_mask(plan).sum()),
        )

    def _terms(self, first: int, second: int) -> np.ndarray:
        """Return (len(TERMS),) features that indicate whether two neighbours are two rocks."""
        large, small = sorted((first, second), key=lambda number: (-len(self.bodies[number].cells), number))
        bodies = [self.bodies[large], self.bodies[small]]
        window, of_small = _window(bodies[1].cells, self.parts.shape, 5)
        of_large = self.parts[window] == large
        border = (ndimage.binary_dilation(of_large) & of_small) | (ndimage.binary_dilation(of_small) & of_large)
        pair = min(first, second), max(first, second)
        both = self._joint[pair] = self._body(np.concatenate([self.bodies[number].cells for number in pair]))
        sizes = [len(body.cells) for body in bodies]
        hollow = np.average([body.hollow for body in bodies], weights=sizes)
        solidity = np.average([body.solidity for body in bodies], weights=sizes)
        return np.array(
            [
                (self._fold(window, of_large, of_small, border) > FOLD).mean(),
                (~self.relief.seen[window][border]).mean(),
                (both.hollow - hollow) / both.peak,
                solidity - both.solidity,
                np.log(sizes[1] * self.relief.cell**2 / 0.0025),
                np.log(sizes[0] / sizes[1]),
            ]
        )

    def _fold(
        self, window: tuple[slice, slice], first: np.ndarray, second: np.ndarray, border: np.ndarray
    ) -> np.ndarray:
        """Return angles (n,) between the normals of two parts near each border cell; negative for a convex edge."""
        normals, points = self.relief.normals[window], self.relief.points[window]
        sides = []
        for mask in (first, second):
            weights = mask / normals[..., 2]
            values = np.concatenate([normals, points, np.ones((*mask.shape, 1))], axis=-1) * weights[..., None]
            sigma = BORDER_SMOOTHING / self.relief.cell
            sides.append(ndimage.gaussian_filter(values, (sigma, sigma, 0), truncate=2, mode="constant")[border])
        (a, b), (p, q) = (
            [side[:, :3] / np.linalg.norm(side[:, :3], axis=1, keepdims=True) for side in sides],
            [side[:, 3:6] / side[:, 6:] for side in sides],
        )
        angle = np.arccos(np.clip((a * b).sum(axis=1), -1, 1))
        return np.where(((a - b) * (p - q)).sum(axis=1) < 0, angle, -angle)


def chance_of_two(terms: np.ndarray, coefficients: tuple[float, ...] = COEFFICIENTS) -> np.ndarray:
    """Return the chances (n,) that neighbours with terms (n, len(TERMS)) are two rocks."""
    return np.asarray(1 / (1 + np.exp(-(coefficients[0] + terms @ np.array(coefficients[1:])))))


def depths_below_hull(points: np.ndarray) -> np.ndarray:
    """Return depths (n,) of points (n, 3) of a surface below the convex hull of the body under it, metres."""
    base = points.copy()
    base[:, 2] = points[:, 2].min() - BODY_BASE
    try:
        planes = ConvexHull(np.concatenate([points, base])).equations
    except QhullError:  # cells on one line
        return np.zeros(len(points))
    planes = np.unique(np.round(planes[planes[:, 2] > 1e-3], 9), axis=0)
    top = np.full(len(points), np.inf)
    for block in (planes[start : start + PLANES] for start in range(0, len(planes), PLANES)):
        heights = -(points[:, :2] @ block[:, :2].T + block[:, 3]) / block[:, 2]
        top = np.minimum(top, heights.min(axis=1))
    return np.maximum(top - points[:, 2], 0)


def _window(cells: np.ndarray, shape: tuple[int, ...], margin: int) -> tuple[tuple[slice, slice], np.ndarray]:
    """Return the window of a grid around flat cells (n,), clipped at the border, and the mask of the cells in it."""
    rows, columns = np.unravel_index(cells, shape)
    top, left = max(0, rows.min() - margin), max(0, columns.min() - margin)
    window = slice(top, min(shape[0], rows.max() + margin + 1)), slice(left, min(shape[1], columns.max() + margin + 1))
    mask = np.zeros((window[0].stop - top, window[1].stop - left), bool)
    mask[rows - top, columns - left] = True
    return window, mask
