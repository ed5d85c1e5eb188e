"""Loops over rays that call Embree, compiled by Numba: a Python call per ray would take longer than the ray.

Rays are cast in packets, because neighbours share most of their path through Embree's tree. `embree_arrays` has the
same functions for installations without Numba.
"""

from __future__ import annotations

import ctypes

import llvmlite.binding as llvm
import numba as nb
import numpy as np

from polarsim.geometry.embree_library import embree
from polarsim.geometry.embree_packet import (
    COHERENT,
    DIRECTION,
    FACE,
    FAR,
    INSTANCE,
    MASK,
    NEAR,
    NORMAL,
    NOTHING,
    ORIGIN,
    ROWS,
    SHAPE,
    WEIGHTS,
)
from polarsim.kernels import njit


def _embree(name: str) -> nb.types.ExternalFunction:
    """Return a query of Embree under a name that compiled and cached loops can resolve."""
    llvm.add_symbol(f"polarsim_{name}", ctypes.cast(getattr(embree(), name), ctypes.c_void_p).value)
    return nb.types.ExternalFunction(f"polarsim_{name}", nb.types.void(*[nb.types.intp] * 4))


_intersect8, _occluded8 = _embree("rtcIntersect8"), _embree("rtcOccluded8")
_intersect16, _occluded16 = _embree("rtcIntersect16"), _embree("rtcOccluded16")


@njit(nogil=True, inline="always")
def _packet(size):  # type: ignore[no-untyped-def]
    """Return buffers of a packet: as floats, as integers, and the mask of valid rays."""
    room = np.zeros(ROWS * size + size, np.float32)
    start = (-(room.ctypes.data // 4)) % size
    rays = room[start : start + ROWS * size].reshape(ROWS, size)
    valid = np.zeros(2 * size, np.int32)
    start = (-(valid.ctypes.data // 4)) % size
    return rays, rays.view(np.uint32), valid[start : start + size]


@njit(nogil=True, inline="always")
def _fill(rays, integers, valid, origins, directions, first, mask):  # type: ignore[no-untyped-def]
    """Copy the rays from index `first` into the packet, and return their number."""
    size = len(valid)
    count = min(size, len(directions) - first)
    each = 1 if len(origins) == len(directions) else 0  # 0: the same origin for all rays
    for k in range(size):
        valid[k] = -1 if k < count else 0
    for k in range(count):
        for axis in range(3):
            rays[ORIGIN + axis, k] = origins[each * (first + k), axis]
            rays[DIRECTION + axis, k] = directions[first + k, axis]
    integers[MASK, :] = mask
    return count


@njit(nogil=True)
def intersect(  # type: ignore[no-untyped-def]
    size, scene, first_face, mask, origins, directions, number, distance, face, weights, normal
):
    """Write the hits to the front of the arrays, in the order of rays, and return their number.

    `size`: rays per packet, 8 or 16. `first_face`: number of the first face of each part of the scene. `mask`: bits of
    the parts that are tested. `origins` (n, 3) or (1, 3), `directions` (n, 3).
    """
    rays, integers, valid = _packet(size)
    arguments = COHERENT.copy()
    stored = 0
    for first in range(0, len(directions), size):
        count = _fill(rays, integers, valid, origins, directions, first, mask)
        rays[FAR, :] = np.inf
        integers[SHAPE, :] = NOTHING
        integers[INSTANCE, :] = NOTHING
        if size == 16:
            _intersect16(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
        else:
            _intersect8(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
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


@njit(nogil=True)
def occluded(size, scene, mask, origins, directions, far, near_metres, hit):  # type: ignore[no-untyped-def]
    """Write whether a triangle is between `near_metres` and `far` (n,) or (1,), in units of the direction's length."""
    rays, integers, valid = _packet(size)
    arguments = COHERENT.copy()
    each = 1 if len(far) == len(directions) else 0
    for first in range(0, len(directions), size):
        count = _fill(rays, integers, valid, origins, directions, first, mask)
        for k in range(count):
            x, y, z = rays[DIRECTION, k], rays[DIRECTION + 1, k], rays[DIRECTION + 2, k]
            rays[NEAR, k] = near_metres / np.sqrt(x * x + y * y + z * z)
            rays[FAR, k] = far[each * (first + k)]
            if rays[NEAR, k] >= rays[FAR, k]:
                valid[k] = 0
        if size == 16:
            _occluded16(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
        else:
            _occluded8(valid.ctypes.data, scene, rays.ctypes.data, arguments.ctypes.data)
        for k in range(count):
            hit[first + k] = valid[k] != 0 and rays[FAR, k] < 0  # Embree marks a hit by a negative distance
