"""Ground under published rock meshes: their rims tell its height, a smooth surface joins them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from polarsim.geometry.meshes import Mesh
from polarsim.rocks.heights import FloorGrid

SECTORS = 24
OUTER_SHARE = 0.75  # of the half sides of a rock's cuboid: its foot lies further out
QUADRIC_FROM = 20  # rocks: fewer fit a quadric closer and predict worse (left-out errors of five terrains)
TUKEY_SCALE = 0.010  # metres: rims off by several times this do not count
ITERATIONS = 30
BLEND_RANGE = 0.20  # metres from a rim over which the ground returns to the fitted surface
BLEND_NEIGHBOURS = 24
BLEND_SOFTENING = 0.010  # metres: rim points nearer than this count alike

FITTED_GROUND_CELL = 0.01  # metres: of a ground that is fitted under published meshes


def rim(mesh: Mesh) -> np.ndarray:
    """(n, 3) the lowest vertex of the outer part of a rock in each of 24 sectors; n <= 24.

    A single low vertex is no foot: heights are medians over three neighbouring sectors.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    offset = (mesh.vertices - (low + high) / 2)[:, :2] / np.maximum((high - low)[:2] / 2, 1e-9)
    outer = np.flatnonzero(np.abs(offset).max(axis=1) > OUTER_SHARE)
    sector = ((np.arctan2(offset[outer, 1], offset[outer, 0]) / (2 * np.pi) + 0.5) * SECTORS).astype(int) % SECTORS
    order = outer[np.lexsort((mesh.vertices[outer, 2], sector))]
    first = np.unique(np.sort(sector), return_index=True)[1]
    points = mesh.vertices[order[first]].copy()
    points[:, 2] = np.median([np.roll(points[:, 2], step) for step in (-1, 0, 1)], axis=0)
    return points


def fit_ground(rims: list[np.ndarray], grid: FloorGrid) -> np.ndarray:
    """Heights (rows, columns) of a ground that meets every rim; level z = 0 without rocks.

    A robust plane (a quadric from 20 rocks on) through all rims, every rock counting alike, and around each rock what
    its rim differs from it, fading over 0.2 m.
    """
    if not rims:
        return np.zeros(grid.shape)
    points = np.concatenate(rims)
    shares = np.concatenate([np.full(len(one), 1 / len(one)) for one in rims])
    quadric = len(rims) >= QUADRIC_FROM
    coefficients = _robust_fit(_terms(points, quadric), points[:, 2], shares)
    nodes = grid.centres().reshape(-1, 2)
    base = _terms(nodes, quadric) @ coefficients
    left = points[:, 2] - _terms(points, quadric) @ coefficients
    distance, near = KDTree(points[:, :2]).query(nodes, k=min(BLEND_NEIGHBOURS, len(points)))
    distance, near = np.reshape(distance, (len(nodes), -1)), np.reshape(near, (len(nodes), -1))
    weights = 1 / (distance**2 + BLEND_SOFTENING**2)
    local = (weights * left[near]).sum(axis=1) / weights.sum(axis=1)
    fade = np.exp(-((distance[:, 0] / BLEND_RANGE) ** 2))
    return (base + fade * local).reshape(grid.shape)


def _terms(points: np.ndarray, quadric: bool) -> np.ndarray:
    """(n, 3) or (n, 6) monomials of x and y."""
    x, y = points[:, 0], points[:, 1]
    linear = [np.ones_like(x), x, y]
    return np.stack([*linear, x * x, x * y, y * y] if quadric else linear, axis=1)


def _robust_fit(terms: np.ndarray, heights: np.ndarray, shares: np.ndarray) -> np.ndarray:
    """Least squares reweighted by Tukey's biweight; its scale shrinks from the spread of the first fit."""
    weights = shares
    scale = np.inf
    coefficients = np.zeros(terms.shape[1])
    for _ in range(ITERATIONS):
        root = np.sqrt(weights)[:, None]
        coefficients = np.linalg.lstsq(terms * root, heights * root[:, 0], rcond=None)[0]
        left = heights - terms @ coefficients
        scale = max(TUKEY_SCALE, min(scale * 0.8, 1.4826 * float(np.median(np.abs(left)))))
        weights = shares * np.clip(1 - (left / (4.685 * scale)) ** 2, 0, 1) ** 2
    return coefficients
