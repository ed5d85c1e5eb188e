"""`rays.Caster` on Intel's Embree 4: float32, millions of rays per second.

Open3D's `RaycastingScene`, which also uses Embree, casts the camera rays of a 2.4-megapixel view of 940,000 triangles
as fast (0.33 s on one thread), but needs 2.8 times as long for the shadow rays to a lamp (0.43 instead of 0.15 s, five
lamps per view), because rays cannot have a minimum distance and origins must be moved. Its distances differ in the last
bit for 171,125 of 1.8 million rays. It also has no masks and no movable parts. The analog and `scoring.surface` use
Open3D for signed distances and closest points, which this interface does not provide.

Scenes that change little from image to image, such as the ground under a rover's wheels, need not be built again: in a
`MovableScene`, only the trees of moved parts and the tree over all parts are rebuilt.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from types import ModuleType
from typing import Protocol, TypeVar

import numpy as np

from polarsim.geometry.embree_library import (
    ROBUST,
    EmbreeScene,
    attach,
    attach_scene,
    check,
    device,
    embree,
    packet_size,
    padded,
    updated,
)
from polarsim.geometry.rays import NO_FACE, START_OFFSET, RayHits
from polarsim.kernels import NUMBA

T = TypeVar("T")
ALL = np.uint32(0xFFFFFFFF)  # mask of rays that can hit every shape
_STRIP = 1 << 18  # rays per call of Embree: limits the memory; threads share strips


class Castable(Protocol):
    """Object with an Embree scene; `address` is its RTCScene."""

    address: int


class EmbreeCaster:
    """Triangles in an Embree scene; strips of rays are cast on `threads` threads, without Python's lock."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, threads: int = 1) -> None:
        self._threads = max(1, threads)
        self._first_face, self._mask = np.zeros(1, np.int64), ALL
        faces = np.asarray(faces).reshape(-1, 3)
        self._scene: Castable | None = EmbreeScene(np.asarray(vertices).reshape(-1, 3), faces) if len(faces) else None

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = self.intersect(origins, directions)
        distance = np.full(len(origins), np.inf)
        face = np.full(len(origins), NO_FACE, np.int64)
        distance[hits.ray], face[hits.ray] = hits.distance, hits.face
        return distance, face

    def intersect(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        def cast(scene: int, part: slice) -> RayHits:
            count = part.stop - part.start
            rays, faces = np.empty(count, np.int64), np.empty(count, np.int64)
            distance = np.empty(count, np.float32)
            weights, normal = np.empty((count, 2), np.float32), np.empty((count, 3), np.float32)
            lines = _lines(origins, directions, part)
            stored = _loops().intersect(
                packet_size(), scene, self._first_face, self._mask, *lines, rays, distance, faces, weights, normal
            )
            return RayHits(
                rays[:stored] + part.start, distance[:stored], faces[:stored], weights[:stored], normal[:stored]
            )

        parts = self._in_strips(cast, len(origins)) or [_no_hits()]
        if len(parts) == 1:
            return parts[0]
        return RayHits(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(RayHits)))

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        far = np.atleast_1d(far)
        hit = np.zeros(len(origins), bool)

        def cast(scene: int, part: slice) -> None:
            lines, ends = _lines(origins, directions, part), _float32(far[part] if len(far) > 1 else far)
            _loops().occluded(packet_size(), scene, self._mask, *lines, ends, np.float32(START_OFFSET), hit[part])

        self._in_strips(cast, len(origins))
        return hit

    def _in_strips(self, cast: Callable[[int, slice], T], rays: int) -> list[T]:
        """Return the results of `cast` for every strip of rays, in order; nothing without triangles."""
        if self._scene is None:
            return []
        scene = self._scene.address
        strips = [slice(start, min(rays, start + _STRIP)) for start in range(0, rays, _STRIP)]
        if self._threads == 1 or len(strips) == 1:
            return [cast(scene, strip) for strip in strips]
        with ThreadPoolExecutor(self._threads) as pool:
            return list(pool.map(lambda strip: cast(scene, strip), strips))


def _loops() -> ModuleType:
    """Return the loops over rays: compiled, or in NumPy where Numba is not installed."""
    if NUMBA:
        from polarsim.geometry import embree_kernels

        return embree_kernels
    from polarsim.geometry import embree_arrays

    return embree_arrays


def _no_hits() -> RayHits:
    none = np.zeros(0, np.int64)
    return RayHits(none, np.zeros(0, np.float32), none, np.zeros((0, 2), np.float32), np.zeros((0, 3), np.float32))


def _lines(origins: np.ndarray, directions: np.ndarray, part: slice) -> tuple[np.ndarray, np.ndarray]:
    """Return a part's origins and directions, float32; a single origin (1, 3) if all rays share it."""
    same = origins.strides[0] == 0
    return _float32(origins[:1] if same else origins[part]), _float32(directions[part])


def _float32(values: np.ndarray) -> np.ndarray:
    return np.require(values, np.float32, ["C", "A", "W"])  # the compiled loops need writable arrays


@dataclass(frozen=True)
class MovableMesh:
    """Triangles that move together; `mask`: bits by which casters select parts."""

    vertices: np.ndarray  # (v, 3)
    faces: np.ndarray  # (f, 3)
    mask: int = 1


class MovableScene:
    """Parts in an Embree scene, each in a separate scene. Faces are numbered in the order of the parts.

    In a single scene of many shapes, Embree 4.4 would rebuild all trees after one shape has moved.
    """

    def __init__(self, parts: Sequence[MovableMesh]) -> None:
        self.address = _new_scene()
        self._vertices = [padded(part.vertices) for part in parts]
        self._faces = [np.require(part.faces, np.uint32, ["C", "A"]) for part in parts]
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
        """Set a part's vertices (v, 3); effective after `commit`."""
        self._vertices[part][:-1] = vertices
        updated(self._triangles[part], vertices=True)
        embree().rtcCommitScene(self._scenes[part])
        updated(self._placed[part], vertices=False)

    def commit(self) -> None:
        """Rebuild the trees of moved parts."""
        embree().rtcCommitScene(self.address)
        check(int(self.first_face[-1]))

    def caster(self, mask: int = 0xFFFFFFFF) -> PartsCaster:
        """Return a caster of the parts that share a bit with `mask`; later commits affect it."""
        return PartsCaster(self, mask)


class PartsCaster(EmbreeCaster):
    """Caster of a selection of parts, on one thread: its callers distribute strips."""

    def __init__(self, parts: MovableScene, mask: int) -> None:
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
