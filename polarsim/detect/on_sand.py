"""Boxes that stand on the sandbox's sand, where the camera's pose is known: others are of cards, cloth and lamps."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats.rigs import LocalisedRig, lift_of, read_all_localised
from polarsim.geometry import boxes
from polarsim.geometry.camera import Camera
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.survey import SANDBOX_HALF_WIDTH

MARGIN_M = 0.05  # boxes and poses err by centimetres where the walls are


class Sand:
    """Where the sand lies in the photos of some terrains.

    Parameters
    ----------
    terrains : mapping of int to mapping of str to LocalisedRig
        The rigs of a terrain's positions. Photos of other terrains and positions keep all their boxes, and so do those
        of rigs that only the survey localises: its poses are up to 0.2 m off.
    """

    def __init__(self, terrains: Mapping[int, Mapping[str, LocalisedRig]]) -> None:
        self._terrains = terrains

    @classmethod
    def read(cls, folders: Iterable[str | Path]) -> Sand:
        """The sand in photos of terrains whose folders of poses, `TerrainTT`, are these.

        Raises
        ------
        PolarsimError
            A folder of another name, or a broken file in it.
        """
        return cls({_terrain_of(Path(folder)): read_all_localised(folder) for folder in folders})

    def keep(self, key: str, found: np.ndarray) -> np.ndarray:
        """Those of the boxes (n, 6) of a photo (x0, y0, x1, y1, confidence, class) that stand on the sand."""
        photo = PhotoKey.parse(key)
        rigs = self._terrains.get(photo.terrain, {})
        rig = rigs.get(photo.position)
        if rig is None or rig.surveyed or not len(found):
            return found
        return found[on_sand(found, rig.camera(photo.camera), lift_of(rigs))]


def on_sand(found: np.ndarray, camera: Camera, level_m: float) -> np.ndarray:
    """(n,) bool: whether the foot of each of the boxes (n, 6) of a photo lies on the sand.

    A rock stands on the middle of its box's lower side, a shadow lies about the centre of its box.

    Parameters
    ----------
    camera : Camera
        Its world is the sandbox.
    level_m : float
        Height of the sand in the sandbox frame, m.
    """
    feet = boxes.centres(found[:, :4])
    rocks = found[:, 5] == BOX_CLASSES.index("rock")
    feet[rocks, 1] = found[rocks, 3]
    rays = camera.directions(feet)
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = (level_m - camera.centre[2]) / rays[:, 2]
        points = camera.centre[:2] + depths[:, None] * rays[:, :2]
    inside = np.abs(points).max(axis=1) <= SANDBOX_HALF_WIDTH + MARGIN_M
    return np.asarray(inside & (depths > 0))  # above the horizon rays meet the sand's plane behind the camera


def _terrain_of(folder: Path) -> int:
    if not (name := re.fullmatch(r"Terrain(\d\d)", folder.name)):
        raise DetectError("not named TerrainTT, as folders of a terrain's poses are", path=folder)
    return int(name[1])
