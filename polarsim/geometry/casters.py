"""The engine that casts rays at a set of triangles, chosen by name."""

from __future__ import annotations

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.geometry.rays import Device, NumpyCaster, RayEngine, Surveyor
from polarsim.geometry.rays_embree import EmbreeCaster


def caster(
    vertices: np.ndarray,
    faces: np.ndarray,
    engine: RayEngine = "embree",
    threads: int | None = None,
    device: Device = "cpu",
) -> Surveyor:
    """An engine for triangles `faces` (f, 3) of `vertices` (v, 3), metres.

    Embree casts float32 rays on `threads` threads, None: one. So does Taichi on its device, None: on as many as it runs
    with. Results do not depend on the number. NumPy needs time in proportion to rays times
    triangles and is there to define the result.

    Raises
    ------
    PolarsimError
        The engine cannot be loaded, or the device is not there.
    """
    if engine == "numpy":
        return NumpyCaster(vertices, faces)
    if engine == "taichi":
        try:
            from polarsim.geometry.rays_taichi import TaichiCaster
        except ImportError as error:
            raise PolarsimError(f"rays: engine 'taichi' cannot be loaded ({error}); install taichi") from error
        return TaichiCaster(vertices, faces, threads, device)
    return EmbreeCaster(vertices, faces, threads or 1)
