"""True albedo of what the photos show: means over cubes of a centimetre, of every surface and all views."""

from __future__ import annotations

import numpy as np
import pandas as pd

from polarsim.analog.sandbox import HALL_OBJECT
from polarsim.analog.view import GBuffer, strips

CUBE = 0.01  # metres
_REACH = 512  # cubes from the origin, along every axis
_COLUMNS = ("pixels", "albedo", "x", "y", "z")


class AlbedoMap:
    """Collects the albedo of all pixels of sand and rocks."""

    def __init__(self) -> None:
        self._cubes = np.zeros(0, np.int64)
        self._sums = np.zeros((0, len(_COLUMNS)))

    def add(self, view: GBuffer) -> None:
        """Count the pixels of a view."""
        cubes, sums = [self._cubes], [self._sums]
        for rows in strips(len(view.objects)):
            seen = view.objects[rows] != HALL_OBJECT
            places, objects = view.places[rows][seen].astype(float), view.objects[rows][seen]
            cube, of_pixel = np.unique(_cube_of(places, objects), return_inverse=True)
            values = (np.ones(len(places)), view.albedo[rows][seen], *places.T)
            cubes.append(cube)
            sums.append(np.stack([np.bincount(of_pixel, value, len(cube)) for value in values], axis=1))
        self._cubes, number = np.unique(np.concatenate(cubes), return_inverse=True)
        parts = np.concatenate(sums)
        self._sums = np.stack([np.bincount(number, part, len(self._cubes)) for part in parts.T], axis=1)

    def table(self) -> pd.DataFrame:
        """A row a cube: rock (-1: sand), mean place x, y, z of its pixels, their mean albedo, and their number."""
        pixels = self._sums[:, 0]
        means = self._sums[:, 1:] / np.maximum(pixels, 1)[:, None]
        rock = self._cubes // (2 * _REACH) ** 3 - 1
        table = pd.DataFrame({"rock": rock.astype(np.int64)})
        for axis, name in enumerate("xyz"):
            table[name] = np.round(means[:, 1 + axis], 5).astype(np.float32)
        table["albedo"] = means[:, 0].astype(np.float32)
        table["pixels"] = pixels.astype(np.int64)
        return table


def _cube_of(places: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """(n,) one number for object and cube; sand is object -1."""
    cell = np.clip(np.floor(places / CUBE).astype(np.int64) + _REACH, 0, 2 * _REACH - 1)
    number = objects.astype(np.int64) + 1
    for axis in range(3):
        number = number * 2 * _REACH + cell[:, axis]
    return number
