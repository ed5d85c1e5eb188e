"""Distances from triangles by Open3D, which `casters` does not compute."""

from __future__ import annotations

from typing import Any

import numpy as np


def distance_scene(vertices: np.ndarray, faces: np.ndarray) -> Any:
    """Return Open3D's `RaycastingScene` of faces (f, 3) of vertices (v, 3), on one thread."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, np.float32)),
        o3d.core.Tensor.from_numpy(np.ascontiguousarray(faces, np.uint32)),
    )
    return scene
