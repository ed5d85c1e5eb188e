"""Scenes of several terrains, with unique rock ids."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from polarsim.errors import RenderError
from polarsim.geometry.poses import Pose
from polarsim.render.options import RenderOptions
from polarsim.render.scene import Scene
from polarsim.render.surfaces import Surfaces
from polarsim.render.views.options import SceneSection, TerrainPart
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS


@dataclass(frozen=True)
class PosedTerrain:
    """A terrain with a pose in a scene."""

    section: TerrainPart
    scene: Scene

    @property
    def scene_from_terrain(self) -> Pose:
        rotvec = np.array([0, 0, np.radians(self.section.heading_deg)])
        return Pose.from_rotvec(rotvec, np.array(self.section.offset_m, float))

    @cached_property
    def surfaces(self) -> Surfaces:
        surfaces, pose = self.scene.surfaces, self.scene_from_terrain
        return replace(surfaces, vertices=pose.apply(surfaces.vertices), normals=pose.rotate(surfaces.normals))


class Ensemble:
    """Terrains of a scene with render options; the meshes are read once for all images."""

    def __init__(self, section: SceneSection, options: RenderOptions) -> None:
        """
        Raises
        ------
        FormatError
            Meshes are missing or broken.
        """
        self.name = section.name
        self.parts = [PosedTerrain(part, Scene(part.meshes, part.terrain, options)) for part in section.terrains]

    @cached_property
    def surfaces(self) -> Surfaces:
        """Surfaces of all terrains, concatenated.

        Raises
        ------
        RenderError
            The scene has more rocks than instance maps have ids.
        """
        parts = [part.surfaces for part in self.parts]
        if len(parts) == 1:
            return parts[0]
        new_ids = {(number, rock): new for new, (number, rock) in self.rocks.items()}
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        return Surfaces(
            np.concatenate([part.vertices for part in parts]),
            np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)]),
            np.concatenate([part.normals for part in parts]),
            np.concatenate([_renumbered(part.id_of_face, number, new_ids) for number, part in enumerate(parts)]),
            parts[0].rays,
            device=parts[0].device,
        )

    @cached_property
    def rocks(self) -> dict[int, tuple[int, int]]:
        """Rock id in the scene -> index of the terrain in the scene, and rock id in the terrain.

        The rock ids of a single terrain are unchanged. Rocks of several terrains are numbered from 1, in the order of
        terrains and ids; instance maps support at most 999.
        """
        rocks = [(number, rock) for number, part in enumerate(self.parts) for rock in _rocks(part.surfaces)]
        if len(self.parts) == 1:
            return {rock: (number, rock) for number, rock in rocks}
        limit = SHADOW_IDS - ROCK_IDS - 1
        if len(rocks) > limit:
            raise RenderError(f"scene {self.name}: {len(rocks)} rocks, instance maps support at most {limit}")
        return dict(enumerate(rocks, 1))

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return the height (n,) of the highest surface at points (n, 2), metres; -inf without surface."""
        top = float(self.surfaces.vertices[:, 2].max()) + 1.0
        origins = np.column_stack([points, np.full(len(points), top)])
        distance, face = self.surfaces.all.nearest(origins, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
        return np.where(face >= 0, top - distance, -np.inf)


def _rocks(surfaces: Surfaces) -> list[int]:
    return [int(number) - ROCK_IDS for number in np.unique(surfaces.id_of_face) if number >= ROCK_IDS]


def _renumbered(id_of_face: np.ndarray, terrain: int, new_ids: dict[tuple[int, int], int]) -> np.ndarray:
    ids = id_of_face.copy()
    for (number, rock), new in new_ids.items():
        if number == terrain:
            ids[id_of_face == ROCK_IDS + rock] = ROCK_IDS + new
    return ids
