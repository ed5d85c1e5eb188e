"""Selection of the engine that casts rays at triangles."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.ray_engines import Device, RayEngine
from polarsim.geometry.rays import Intersector, NumpyCaster
from polarsim.geometry.rays_embree import EmbreeCaster


def make_caster(
    vertices: np.ndarray,
    faces: np.ndarray,
    engine: RayEngine = "embree",
    threads: int | None = None,
    device: Device = "cpu",
) -> Intersector:
    """Return an engine for triangles `faces` (f, 3) of `vertices` (v, 3), metres.

    Embree casts float32 rays on `threads` threads (default: 1). Taichi uses the same number on the CPU; its default is
    the number of the current start. Results do not depend on the number. NumPy is the reference; its time is
    proportional to rays times triangles.
    """
    if engine == "numpy":
        return NumpyCaster(vertices, faces)
    if engine == "taichi":
        from polarsim.geometry.rays_taichi import TaichiCaster

        return TaichiCaster(vertices, faces, threads, device)
    return EmbreeCaster(vertices, faces, threads or 1)
