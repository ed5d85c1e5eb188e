"""Any number of rocks from the generator of the analog, without a sandbox."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.analog.rocks import carve, icosphere
from polarsim.formats import obj
from polarsim.formats.files import writing_folder
from polarsim.geometry.meshes import Mesh
from polarsim.randomness import generator

_SIZE_M = (0.06, 0.4)  # longest extent, log-uniform
_DETAIL = 5  # subdivisions: 20,480 triangles per rock


def carve_rocks(*, number: int, terrain: int, seed: int, meshes: Path) -> None:
    """Write a folder of closed rock meshes, metres, centred at the origin; each depends only on seed and number."""
    _, faces = icosphere(_DETAIL)
    with writing_folder(meshes) as folder:
        for rock in range(number):
            random = generator(seed, "analog", "carved", rock)
            size = float(np.exp(random.uniform(*np.log(_SIZE_M))))
            vertices = carve(random, rock, size, _DETAIL).vertices
            obj.write_obj(folder / obj.rock_name(terrain, rock), Mesh(vertices, faces), f"rock{rock}")
