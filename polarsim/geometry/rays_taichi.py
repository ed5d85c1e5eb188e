"""`rays.Caster` as Taichi kernels over the tree of `bvh`: float32, on the CPU or on a GPU by CUDA or Vulkan."""
# mypy: ignore-errors
# No `from __future__ import annotations`: Taichi reads the kernels' annotations as objects.

import weakref
from dataclasses import dataclass

import numpy as np

from polarsim.geometry import bvh, taichi_device
from polarsim.geometry.ray_engines import Device
from polarsim.geometry.rays import NO_FACE, START_OFFSET, RayHits
from polarsim.geometry.taichi_device import on_taichi_thread, ti
from polarsim.geometry.taichi_walk import BOXES, FAR, NUMBERS, PAIRS, VALUES, VECTORS, WEIGHTS, walk
from polarsim.geometry.vectors import length

_STRIP = 1 << 20  # rays per transfer to the device: 40 MB each way


@dataclass(frozen=True)
class OnDevice:
    """Tree and triangles on the device, in the order of the kernels' arguments."""

    boxes: ti.Ndarray  # (m, 4) vectors
    children: ti.Ndarray  # (m, 2)
    corners: ti.Ndarray  # (f, 3) vectors, in the tree's order
    face: ti.Ndarray  # (f,) numbers of the triangles
    starts: int  # number of Taichi's starts when they were copied to the device

    @property
    def tree(self) -> tuple[ti.Ndarray, ...]:
        return self.boxes, self.children, self.corners


class TaichiCaster:
    """Triangles that remain on the device between casts; concurrent casts wait for each other."""

    def __init__(
        self, vertices: np.ndarray, faces: np.ndarray, threads: int | None = None, device: Device = "cpu"
    ) -> None:
        """`threads`: of the CPU; None: the current number of Taichi. Results do not depend on their number."""
        self._threads, self._device = threads, device
        taichi_device.start(threads, device)
        faces = np.asarray(faces).reshape(-1, 3)
        self._corners = np.asarray(vertices, np.float32).reshape(-1, 3)[faces]
        self._tree = bvh.build_tree(vertices, faces) if len(faces) else None
        self._laid: OnDevice | None = None

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance = np.full(len(origins), np.inf)
        face = np.full(len(origins), NO_FACE, np.int64)
        for part, (found, slot, _) in self._first(origins, directions):
            hit = np.flatnonzero(slot >= 0)
            distance[part][hit] = found.take(hit)
            face[part][hit] = self._tree.order.take(slot.take(hit))
        return distance, face

    def intersect(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        none = np.zeros(0, np.int64)
        parts = [(none, np.zeros(0, np.float32), none, np.zeros((0, 2), np.float32))]
        for part, (found, slot, weights) in self._first(origins, directions):
            ray = np.flatnonzero(slot >= 0)
            parts.append((ray + part.start, found.take(ray), slot.take(ray), weights.take(ray, axis=0)))
        ray, distance, slot, weights = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        if self._tree is None:
            return RayHits(ray, distance, slot, weights, np.zeros((0, 3), np.float32))
        face = self._tree.order.take(slot).astype(np.int64)
        first, second, third = (self._corners[:, corner].take(face, axis=0) for corner in range(3))
        return RayHits(ray, distance, face, weights, np.cross(second - first, third - first))

    def occluded(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        hit = np.zeros(len(origins), np.int32)
        far = np.broadcast_to(np.asarray(far), len(origins))
        for part in self._strips(len(origins)):
            along = directions[part]
            near = _float32(START_OFFSET / length(along))
            limit = _float32(np.minimum(far[part], FAR))
            rays = _float32(origins[part]), _float32(along), near, limit
            self._call(_occluded, *rays, hit[part])
        return hit > 0

    @on_taichi_thread
    def _call(self, kernel, *arrays: np.ndarray) -> None:
        kernel(*self.on_device().tree, *arrays)

    @on_taichi_thread
    def on_device(self) -> OnDevice:
        """Return tree and triangles, copied at the first call and after each restart of Taichi."""
        taichi_device.start(self._threads, self._device)
        if self._laid is None or self._laid.starts != taichi_device.starts():
            tree = self._tree
            self._laid = OnDevice(
                vectors_to_device(tree.boxes),
                to_device(tree.children),
                vectors_to_device(self._corners.take(tree.order, axis=0)),
                to_device(tree.order),
                taichi_device.starts(),
            )
            weakref.finalize(self, taichi_device.free_later, self._laid).atexit = False
        return self._laid

    @property
    def empty(self) -> bool:
        return self._tree is None

    @property
    def order(self) -> np.ndarray:
        """Return the numbers (f,) of the triangles by their indices in the tree."""
        return self._tree.order

    def _first(self, origins: np.ndarray, directions: np.ndarray):
        """Yield strips of rays with distances, indices in the tree's order (-1: no hit) and weights of the hits."""
        for part in self._strips(len(origins)):
            rays = part.stop - part.start
            distance, slot = np.empty(rays, np.float32), np.empty(rays, np.int32)
            weights = np.empty((rays, 2), np.float32)
            rays = _float32(origins[part]), _float32(directions[part])
            self._call(_nearest, *rays, distance, slot, weights)
            yield part, (distance, slot, weights)

    def _strips(self, rays: int) -> list[slice]:
        if self._tree is None:
            return []
        return [slice(start, min(start + _STRIP, rays)) for start in range(0, rays, _STRIP)]


def to_device(values: np.ndarray) -> ti.Ndarray:
    """Copy numbers, float32 or int32, to an array on the device."""
    values = np.ascontiguousarray(values, np.float32 if values.dtype.kind == "f" else np.int32)
    there = ti.ndarray(ti.f32 if values.dtype == np.float32 else ti.i32, values.shape)
    there.from_numpy(values)
    return there


def vectors_to_device(vectors: np.ndarray) -> ti.Ndarray:
    """Copy vectors (..., k) to an array of float32 vectors on the device."""
    there = ti.Vector.ndarray(vectors.shape[-1], ti.f32, vectors.shape[:-1])
    there.from_numpy(_float32(vectors))
    return there


def _float32(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32)


@ti.kernel
def _nearest(
    boxes: BOXES, children: PAIRS, corners: BOXES, origins: VECTORS, directions: VECTORS,
    distance: VALUES, slot: NUMBERS, weights: WEIGHTS,
):  # fmt: skip
    for n in slot:
        hit = walk(boxes, children, corners, origins[n], directions[n], 0.0, FAR, 0)
        distance[n] = hit.distance
        slot[n] = hit.slot
        weights[n] = hit.weights


@ti.kernel
def _occluded(
    boxes: BOXES, children: PAIRS, corners: BOXES, origins: VECTORS, directions: VECTORS,
    near: VALUES, far: VALUES, hit: NUMBERS,
):  # fmt: skip
    for n in hit:
        hit[n] = walk(boxes, children, corners, origins[n], directions[n], near[n], far[n], 1).slot >= 0
