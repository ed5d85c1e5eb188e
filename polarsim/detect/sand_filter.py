"""Removal of boxes outside the sand (cards, cloth, lamps) in photos with a known camera pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import obj
from polarsim.geometry import boxes
from polarsim.geometry.camera import Camera
from polarsim.photo import BOX_CLASSES, NO_ROCK, PhotoKey, Terrain
from polarsim.run_files.rigs import LocalisedRig, localised_files, read_all_localised
from polarsim.run_files.scene import mesh_files, terrain_of_folder
from polarsim.run_files.walls import surely_wall
from polarsim.site import Site
from polarsim.site_parts import Sandbox


@dataclass(frozen=True)
class TerrainSand:
    """Camera poses, sand level and sandbox of a terrain."""

    rigs: Mapping[str, LocalisedRig]  # by position
    level_m: float  # height of the sand in the sandbox frame; -0.15 to 0.18 m in published meshes
    sandbox: Sandbox


class SandFilter:
    """Filter of boxes by the sand of the terrains.

    Photos without known terrain or position, and photos with unverified poses (errors of decimetres), keep all boxes.
    """

    def __init__(self, terrains: Mapping[Terrain, TerrainSand], files: Sequence[Path]) -> None:
        self._terrains = terrains
        self.files = tuple(files)  # pose and mesh files of the filter

    @classmethod
    def read(cls, site: Site, cameras: Sequence[str | Path], meshes: Sequence[str | Path]) -> SandFilter:
        """Read the folders of poses and meshes of several terrains, paired by folder name."""
        grounds: dict[str, tuple[Terrain, Path]] = {}
        for folder in map(Path, meshes):
            terrain = terrain_of_folder(folder)
            grounds[folder.name] = terrain, mesh_files(folder, terrain)[NO_ROCK]
        terrains: dict[Terrain, TerrainSand] = {}
        files: list[Path] = []
        for folder in map(Path, cameras):
            if folder.name not in grounds:
                raise DetectError("no mesh folder with the name of this pose folder", path=folder)
            terrain, ground = grounds[folder.name]
            # The median height: craters and heaps cover less than half of the ground.
            level = float(np.median(obj.read_obj(ground).vertices[:, 2]))
            terrains[terrain] = TerrainSand(read_all_localised(folder), level, site.sandbox_of(terrain))
            files += [*localised_files(folder).values(), ground]
        return cls(terrains, files)

    def keep(self, key: str, detections: np.ndarray) -> np.ndarray:
        """Return the boxes (n, 6) of a photo (x0, y0, x1, y1, confidence, class) that are on the sand."""
        photo = PhotoKey.parse(key)
        sand = self._terrains.get(photo.terrain)
        rig = sand.rigs.get(photo.position) if sand else None
        if sand is None or rig is None or rig.unproven or not len(detections):
            return detections
        half, wall = np.array(sand.sandbox.half_width_m), surely_wall(sand.sandbox)
        return detections[boxes_on_sand(detections, rig.camera(photo.camera), sand.level_m, half, wall)]


def boxes_on_sand(detections: np.ndarray, camera: Camera, level_m: float, half: np.ndarray, wall: float) -> np.ndarray:
    """Return a mask (n,) of boxes (n, 6) of a photo with their foot on visible sand.

    The foot is the middle of the lower side for a rock, and the centre of the box for a shadow. For a camera outside
    the sandbox, the near wall hides sand. Because the box of a partly hidden rock ends at the edge of this wall, the
    centre of the box is tested against the wall. In the sandbox frame, `level_m` is the height of the sand, `half` (2,)
    its half widths along X and Y, and `wall` the minimum height of the walls above the sand, m.
    """
    centres = boxes.box_centres(detections[:, :4])
    rocks = detections[:, 5] == BOX_CLASSES.index("rock")
    feet = np.column_stack([centres[:, 0], np.where(rocks, detections[:, 3], centres[:, 1])])
    rays, start = camera.directions(feet), camera.centre
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = (level_m - start[2]) / rays[:, 2]
        points = start[:2] + depths[:, None] * rays[:, :2]
        rays = camera.directions(centres)
        entered = ((np.sign(start[:2]) * half - start[:2]) / rays[:, :2]).T
    outside = np.abs(start[:2]) > half
    entry_heights = start[2] + np.max(entered[outside], axis=0, initial=0) * rays[:, 2]
    inside = (np.abs(points) <= half).all(axis=1)
    # Rays above the horizon have negative depths.
    return np.asarray(inside & (depths > 0) & (entry_heights >= level_m + wall))
