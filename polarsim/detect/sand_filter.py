"""Boxes that stand on the sandbox's sand, where the camera's pose is known: others are of cards, cloth and lamps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import obj
from polarsim.geometry import boxes
from polarsim.geometry.camera import Camera
from polarsim.photo import BOX_CLASSES, NO_ROCK, PhotoKey
from polarsim.run_files.rigs import LocalisedRig, localised_files, read_all_localised
from polarsim.run_files.scene import mesh_files, terrain_in
from polarsim.survey import SANDBOX_HALF_WIDTH, SURELY_WALL, half_width, wall_height


@dataclass(frozen=True)
class Sandbox:
    """What says where a terrain's sand lies in photos."""

    rigs: Mapping[str, LocalisedRig]  # by position
    level_m: float  # height of the sand in the sandbox frame: frames of published meshes have it at -0.15 to 0.18 m


class Sand:
    """Where the sand lies in the photos of some terrains.

    Photos of other terrains and positions keep all their boxes, and so do those of rigs of unproven pose,
    which may be decimetres off.
    """

    def __init__(self, terrains: Mapping[int, Sandbox], files: Sequence[Path]) -> None:
        self._terrains = terrains
        self.files = tuple(files)  # that say so

    @classmethod
    def read(cls, cameras: Sequence[str | Path], meshes: Sequence[str | Path]) -> Sand:
        """The sand in photos of some terrains, from their folders of poses, and of meshes: two of a name are a pair.

        Raises
        ------
        PolarsimError
            A folder without its other half, without the ground of one terrain, or with a broken file.
        """
        grounds = {Path(folder).name: _ground_in(Path(folder)) for folder in meshes}
        terrains, files = {}, []
        for folder in map(Path, cameras):
            if folder.name not in grounds:
                raise DetectError("poses of a terrain without a folder of meshes that has the same name", path=folder)
            terrain, ground = grounds[folder.name]
            terrains[terrain] = Sandbox(read_all_localised(folder), _level_of(ground))
            files += [*localised_files(folder).values(), ground]
        return cls(terrains, files)

    def keep(self, key: str, found: np.ndarray) -> np.ndarray:
        """Those of the boxes (n, 6) of a photo (x0, y0, x1, y1, confidence, class) that stand on the sand."""
        photo = PhotoKey.parse(key)
        sandbox = self._terrains.get(photo.terrain)
        rig = sandbox.rigs.get(photo.position) if sandbox else None
        if sandbox is None or rig is None or rig.unproven or not len(found):
            return found
        half, wall = half_width(photo.terrain), wall_height(photo.terrain, surely=True)
        return found[on_sand(found, rig.camera(photo.camera), sandbox.level_m, half, wall)]


def on_sand(
    found: np.ndarray, camera: Camera, level_m: float, half: float = SANDBOX_HALF_WIDTH, wall: float = SURELY_WALL
) -> np.ndarray:
    """(n,) bool: whether the foot of each of the boxes (n, 6) of a photo lies on the sand that the camera sees.

    A rock stands on the middle of its box's lower side, a shadow lies about the centre of its box. A camera outside the
    sandbox sees no sand behind the wall before it; the box of a rock that this wall hides in part ends at its edge, so
    that here the centre decides.

    Parameters
    ----------
    camera : Camera
        Its world is the sandbox.
    level_m : float
        Height of the sand in the sandbox frame, m.
    half, wall : float
        Half width of the sand, and how high walls stand above it at least, m.
    """
    centres = boxes.centres(found[:, :4])
    rocks = found[:, 5] == BOX_CLASSES.index("rock")
    feet = np.column_stack([centres[:, 0], np.where(rocks, found[:, 3], centres[:, 1])])
    rays, start = camera.directions(feet), camera.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = (level_m - start[2]) / rays[:, 2]
        points = start[:2] + depths[:, None] * rays[:, :2]
        rays = camera.directions(centres)
        entered = ((np.sign(start[:2]) * half - start[:2]) / rays[:, :2]).T
    outside = np.abs(start[:2]) > half
    entry_heights = start[2] + np.max(entered[outside], axis=0, initial=0) * rays[:, 2]
    inside = np.abs(points).max(axis=1) <= half
    # Above the horizon rays meet the sand's plane behind the camera.
    return np.asarray(inside & (depths > 0) & (entry_heights >= level_m + wall))


def _ground_in(folder: Path) -> tuple[int, Path]:
    """The terrain whose meshes a folder holds, and the file of its ground."""
    terrain = terrain_in(folder)
    return terrain, mesh_files(folder, terrain)[NO_ROCK]


def _level_of(ground: Path) -> float:
    """Height of the sand: the median of the ground's, for craters and heaps are less than half of it."""
    return float(np.median(obj.read(ground).vertices[:, 2]))
