"""Control of the comparison: a ground with invented relief, which resembles no photo."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import obj
from polarsim.formats.files import share_file, writing_folder
from polarsim.geometry.heightfields import rough_waves, sum_noise
from polarsim.geometry.meshes import Mesh
from polarsim.photo import NO_ROCK, Terrain
from polarsim.randomness import generator
from polarsim.run_files.scene import mesh_files
from polarsim.run_files.walls import FILE as WALLS_FILE

RELIEF_SD_M = 0.005  # shades the sand as strongly as in photos, with few cast shadows; at 0.013, shadows cover the sand
_SIZES_M = (0.03, 0.4)  # finest and widest structure: limited by the cells of the ground and by the fitted plane


def invent_relief(*, terrain: Terrain, meshes: Path, control: Path, seed: int) -> None:
    """Write a folder of the meshes of a terrain with random relief added to the ground; rocks are links.

    The relief is about as strong as that of the photos, but unrelated to any photo. A ground that is not a regular grid
    along x and y, as written by polarsim for a release without a published ground, is an error.
    """
    files = mesh_files(meshes, terrain)
    ground = obj.read_obj(files[NO_ROCK])
    random = generator(seed, "covers", "control", terrain)
    try:
        relief = _relief(ground.vertices, random)
    except ValueError as error:
        raise DetectError(f"{error}, expected the vertices of a regular grid", path=files[NO_ROCK]) from error
    heights = ground.vertices + relief[:, None] * np.array([0.0, 0, 1])
    with writing_folder(control) as folder:
        for path in [path for rock, path in files.items() if rock != NO_ROCK] + [meshes / WALLS_FILE]:
            if path.exists():
                share_file(path, folder / path.name)
        obj.write_obj(folder / files[NO_ROCK].name, Mesh(heights, ground.faces), "ground")


def _relief(vertices: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return random heights (v,) at vertices (v, 3) on a regular grid, metres."""
    x, y = (np.unique(vertices[:, axis].round(4), return_inverse=True) for axis in (0, 1))
    cell = float(np.diff(x[0]).mean()) if len(x[0]) > 1 else 0.0
    shape = len(y[0]), len(x[0])
    if not np.allclose([*np.diff(x[0]), *np.diff(y[0])], cell, atol=2e-4) or len(vertices) != shape[0] * shape[1]:
        raise ValueError(f"{len(vertices)} vertices in {shape[0]} rows and {shape[1]} columns")
    field = sum_noise(shape, [(RELIEF_SD_M, rough_waves(shape, *(size / cell for size in _SIZES_M)))], random)
    return np.asarray(field[y[1], x[1]])
