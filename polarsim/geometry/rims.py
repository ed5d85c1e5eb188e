"""Rim of a rock's mesh: points of its foot, where the rock touches the ground."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.meshes import Mesh

SECTORS = 24
OUTER_SHARE = 0.75  # of the half sides of a rock's cuboid; its foot is farther out


def rim(mesh: Mesh) -> np.ndarray:
    """Return the lowest vertex (n, 3) of the outer part of a rock in each of 24 sectors; n <= 24.

    Single low vertices are outliers: heights are medians over three neighbouring sectors.
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
