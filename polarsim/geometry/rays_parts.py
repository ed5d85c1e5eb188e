"""Triangles in parts of which some move: Embree's tree of a part is built anew where it moved, and one over all parts.

Scenes that change little from picture to picture need not be built again: a rover's ground changes under its wheels.
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.embree_library import ROBUST, attach, attach_scene, check, device, embree, padded, updated
from polarsim.geometry.rays_embree import EmbreeCaster


@dataclass(frozen=True)
class Part:
    """Triangles that move together; `mask`: bits by which casters choose parts."""

    vertices: np.ndarray  # (v, 3)
    faces: np.ndarray  # (f, 3)
    mask: int = 1


class Parts:
    """Parts in an Embree scene, each a scene of its own. Faces are numbered through, in the order of the parts.

    One scene of many shapes would not do: Embree 4.4 builds all its trees anew where one shape moves.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        """
        Raises
        ------
        PolarsimError
            Embree cannot be loaded, or refuses the triangles.
        """
        self.address = _new_scene()
        self._vertices = [padded(part.vertices) for part in parts]
        self._faces = [np.ascontiguousarray(part.faces, np.uint32) for part in parts]
        self._scenes = [_new_scene() for _ in parts]
        self._triangles = [
            attach(scene, vertices, faces, part.mask)
            for scene, vertices, faces, part in zip(self._scenes, self._vertices, self._faces, parts, strict=True)
        ]
        for scene in self._scenes:
            embree().rtcCommitScene(scene)
        self._placed = [
            attach_scene(self.address, scene, part.mask) for scene, part in zip(self._scenes, parts, strict=True)
        ]
        self.first_face = np.cumsum([0, *(len(part.faces) for part in parts)])
        weakref.finalize(self, _release, [*self._triangles, *self._placed], [self.address, *self._scenes])
        self.commit()

    def move(self, part: int, vertices: np.ndarray) -> None:
        """Give a part's vertices new places (v, 3); counts after `commit`."""
        self._vertices[part][:-1] = vertices
        updated(self._triangles[part], vertices=True)
        embree().rtcCommitScene(self._scenes[part])
        updated(self._placed[part], vertices=False)

    def commit(self) -> None:
        """Let what has moved count."""
        embree().rtcCommitScene(self.address)
        check(int(self.first_face[-1]))

    def caster(self, mask: int = 0xFFFFFFFF) -> PartsCaster:
        """Of the parts that share a bit with `mask`; it sees every later `commit`."""
        return PartsCaster(self, mask)


class PartsCaster(EmbreeCaster):
    """Casts at some of the parts, on one thread: its callers share out strips themselves."""

    def __init__(self, parts: Parts, mask: int) -> None:
        self._threads = 1
        self._scene = parts
        self._first_face, self._mask = np.asarray(parts.first_face[:-1], np.int64), np.uint32(mask)


def _new_scene() -> int:
    scene: int = embree().rtcNewScene(device())
    embree().rtcSetSceneFlags(scene, ROBUST)
    return scene


def _release(geometries: Sequence[int], scenes: Sequence[int]) -> None:
    for geometry in geometries:
        embree().rtcReleaseGeometry(geometry)
    for scene in scenes:
        embree().rtcReleaseScene(scene)
