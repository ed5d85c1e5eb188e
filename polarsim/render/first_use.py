"""Compilation of the kernels of rendering, which delays the first images of a new installation by six seconds."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import Surfaces
from polarsim.run_files.instances import GROUND, ROCK_IDS

_LENS = Lens(8.0, 8.0, 4.0, 4.0, (-0.1, 0.0, 0.0, 0.0, 0.0), width=8, height=8)


def compile_kernels() -> None:
    """Render a slab above sand with both models; Numba stores the compiled kernels for other processes."""
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    vertices = np.concatenate([np.c_[size * square, np.full(4, height)] for size, height in ((1.0, 0.0), (0.2, 0.2))])
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    surfaces = Surfaces(vertices, faces, normals, np.repeat(np.array([GROUND, ROCK_IDS], np.int32), 2))
    camera = Camera(camera_pose(np.array([-1.0, 0.0, 1.0]), 0.0, np.pi / 4), _LENS)
    lamps = {"30": Lamp(np.array([3.0, 0.0, 1.0]))}
    render_view(surfaces, camera, lamps, ["principled", "hapke"], list(lamps), RenderOptions())
