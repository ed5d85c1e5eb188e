"""Loops over rays that call Embree, compiled by Numba: a call from Python for every ray would take longer than the ray.

Rays go in packets, for neighbours share most of their way through Embree's tree. A packet is Embree's RTCRayHit8
(embree4/rtcore_ray.h): 24 rows of eight numbers of four bytes, aligned to 32 bytes.
"""

from __future__ import annotations

import ctypes

import llvmlite.binding as llvm
import numba as nb
import numpy as np

from polarsim.geometry.embree_library import embree
from polarsim.kernels import njit

SIZE = 8  # rays of a packet
ORIGIN, NEAR, DIRECTION, TIME, FAR, MASK, NUMBER, FLAGS = 0, 3, 4, 7, 8, 9, 10, 11  # rows of a packet
NORMAL, WEIGHTS, FACE, SHAPE, INSTANCE, ROWS = 12, 15, 17, 18, 19, 24
NOTHING = np.uint32(0xFFFFFFFF)  # RTC_INVALID_GEOMETRY_ID
# RTCIntersectArguments: rays near each other, all features, no context, no filter, no function of ours.
COHERENT = np.array([1 << 16, 0xFFFFFFFF, 0, 0, 0, 0, 0, 0], np.uint32)


def _embree(name: str) -> nb.types.ExternalFunction:
    """A query of Embree by a name that compiled and cached loops find it by."""
    llvm.add_symbol(f"polarsim_{name}", ctypes.cast(getattr(embree(), name), ctypes.c_void_p).value)
    return nb.types.ExternalFunction(f"polarsim_{name}", nb.types.void(*[nb.types.intp] * 4))


_intersect, _occluded = _embree("rtcIntersect8"), _embree("rtcOccluded8")
_RAYS = "float32[:, ::1]"


@njit(nogil=True, inline="always")
def _packet():  # type: ignore[no-untyped-def]
    """Room for a packet, as floats and as integers, and for which of its rays count."""
    room = np.zeros(ROWS * SIZE + SIZE, np.float32)
    start = (-(room.ctypes.data // 4)) % SIZE
    rays = room[start : start + ROWS * SIZE].reshape(ROWS, SIZE)
    valid = np.zeros(2 * SIZE, np.int32)
    start = (-(valid.ctypes.data // 4)) % SIZE
    return rays, rays.view(np.uint32), valid[start : start + SIZE]


@njit(nogil=True, inline="always")
def _fill(rays, integers, valid, origins, directions, first, mask):  # type: ignore[no-untyped-def]
    """Put the rays from number `first` on into the packet; how many these are."""
    count = min(SIZE, len(origins) - first)
    for k in range(SIZE):
        valid[k] = -1 if k < count else 0
    for axis in range(3):
        for k in range(count):
            rays[ORIGIN + axis, k] = origins[first + k, axis]
            rays[DIRECTION + axis, k] = directions[first + k, axis]
    integers[MASK, :] = mask
    return count


@njit(
    f"int64(intp, int64[::1], uint32, {_RAYS}, {_RAYS}, int64[::1], float32[::1], int64[::1], {_RAYS}, {_RAYS})",
    nogil=True,
)
def intersect(  # type: ignore[no-untyped-def]
    scene, first_face, mask, origins, directions, number, distance, face, weights, normal
):
    """Write what rays meet to the front of the arrays, in the order of rays; how many do.

    `first_face`: number of the first face of each of the scene's parts. `mask`: bits of the parts that count.
    """
    rays, integers, valid = _packet()
    arguments = COHERENT.copy()
    stored = 0
    for first in range(0, len(origins), SIZE):
        count = _fill(rays, integers, valid, origins, directions, first, mask)
        rays[FAR, :] = np.inf
        integers[SHAPE, :] = NOTHING
        integers[INSTANCE, :] = NOTHING
        _intersect(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
        for k in range(count):
            if integers[SHAPE, k] == NOTHING:
                continue
            number[stored], distance[stored] = first + k, rays[FAR, k]
            part = integers[INSTANCE, k] if integers[INSTANCE, k] != NOTHING else integers[SHAPE, k]
            face[stored] = first_face[part] + integers[FACE, k]
            weights[stored, 0], weights[stored, 1] = rays[WEIGHTS, k], rays[WEIGHTS + 1, k]
            for axis in range(3):
                normal[stored, axis] = rays[NORMAL + axis, k]
            stored += 1
    return stored


@njit(f"void(intp, uint32, {_RAYS}, {_RAYS}, float32[::1], float32, boolean[::1])", nogil=True)
def occluded(scene, mask, origins, directions, far, near_metres, hit):  # type: ignore[no-untyped-def]
    """Whether a triangle lies between `near_metres` and `far` (n,), in units of the direction's length."""
    rays, integers, valid = _packet()
    arguments = COHERENT.copy()
    for first in range(0, len(origins), SIZE):
        count = _fill(rays, integers, valid, origins, directions, first, mask)
        for k in range(count):
            x, y, z = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
            rays[NEAR, k] = near_metres / np.sqrt(x * x + y * y + z * z)
            rays[FAR, k] = far[first + k]
            if rays[NEAR, k] >= rays[FAR, k]:
                valid[k] = 0
        _occluded(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
        for k in range(count):
            hit[first + k] = valid[k] != 0 and rays[FAR, k] < 0  # Embree's mark of a ray that met something
