"""A sandbox of variable resolution and a rig, for benchmarks of the renderer."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.poses import camera_pose
from polarsim.photo import NO_ROCK
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from tests.support.polar_rig import default_rig


def surveyed_rig() -> LocalisedRig:
    """Return an approximate rig at position A."""
    return LocalisedRig(
        default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.radians(178), np.radians(25)), "benchmark"
    )


def grid(height: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a height field (n, n)."""
    n = len(height)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = [[corner, corner + 1, corner + n], [corner + 1, corner + n + 1, corner + n]]
    return np.stack([x, y, height], axis=-1).reshape(-1, 3), np.concatenate([np.stack(f, axis=1) for f in faces])


def made_terrain(cells: int, rocks: int = 40) -> TerrainMesh:
    """Rough ground of 4 m x 4 m, about 2 cells^2 triangles, with domes of 6,962 triangles each; deterministic."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(*2 * [np.linspace(-2, 2, cells)])
    height = sum(
        0.01 / k * np.sin(k * (x * np.cos(a) + y * np.sin(a)) + p)
        for k, a, p in zip(2 ** rng.uniform(1, 8, 30), *rng.uniform(0, 6.28, (2, 30)), strict=True)
    )
    parts = [(NO_ROCK, *grid(height, x, y))]
    for rock, (cx, cy) in enumerate(rng.uniform(-1.7, 1.7, (rocks, 2)), 1):
        u, v = np.meshgrid(*2 * [np.linspace(-1, 1, 60)])
        size = rng.uniform(0.04, 0.15)
        parts.append((rock, *grid(size * (1 - u**4) * (1 - v**4) - 0.02, cx + size * u, cy + size * v)))
    starts = np.cumsum([0, *(len(v) for _, v, _ in parts)])
    vertices = np.concatenate([v for _, v, _ in parts])
    faces = np.concatenate([f + start for (_, _, f), start in zip(parts, starts, strict=False)])
    normals = np.zeros_like(vertices)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    for k in range(3):
        np.add.at(normals, faces[:, k], np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return TerrainMesh(vertices, faces, np.concatenate([np.full(len(f), r) for r, _, f in parts]), normals)
