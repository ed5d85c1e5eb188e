"""The loops of `embree_kernels` without Numba: packets are filled with NumPy and cast one at a time by ctypes.

Results are equal to the last bit. Calls keep Python's lock, because a packet takes a few microseconds and threads would
wait for each other.
"""

from __future__ import annotations

import ctypes
from functools import cache

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

_QUERY = ctypes.PYFUNCTYPE(None, *[ctypes.c_void_p] * 4)


@cache
def _query(name: str) -> object:
    return _QUERY((name, embree()))


class _Packets:
    """Rays in packets, `rays` (packets, ROWS, size), and the mask of valid rays (packets, size)."""

    def __init__(self, size: int, origins: np.ndarray, directions: np.ndarray, mask: np.uint32) -> None:
        self.count, packets = len(directions), -(-len(directions) // size)
        self.rays = _aligned((packets, ROWS, size), np.float32)
        self.integers = self.rays.view(np.uint32)
        self.valid = _aligned((packets, size), np.int32)
        self.valid.reshape(-1)[: self.count] = -1
        for axis in range(3):
            self.write(ORIGIN + axis, origins[:, axis])
            self.write(DIRECTION + axis, directions[:, axis])
        self.integers[:, MASK] = mask

    def write(self, row: int, values: np.ndarray) -> None:
        """Write a row of all packets; values (n,) or (1,)."""
        padded = np.zeros(self.valid.size, np.float32)
        padded[: self.count] = values
        self.rays[:, row] = padded.reshape(self.valid.shape)

    def read(self, row: int, *, integers: bool = False) -> np.ndarray:
        """Return a row of all packets (n,)."""
        return (self.integers if integers else self.rays)[:, row].reshape(-1)[: self.count]

    def cast(self, query: str, scene: int) -> None:
        call, arguments = _query(f"{query}{self.valid.shape[1]}"), COHERENT.copy()
        valid, rays = self.valid.ctypes.data, self.rays.ctypes.data
        valid_step, rays_step = self.valid.strides[0], self.rays.strides[0]
        for packet in range(len(self.valid)):
            call(valid + packet * valid_step, scene, rays + packet * rays_step, arguments.ctypes.data)  # type: ignore[operator]


def _aligned(shape: tuple[int, ...], kind: type) -> np.ndarray:
    """Return zeros of four bytes each, aligned to the row of a packet."""
    row = 4 * shape[-1]
    room = np.zeros(4 * int(np.prod(shape)) + row, np.uint8)
    start = -room.ctypes.data % row
    return room[start : start + 4 * int(np.prod(shape))].view(kind).reshape(shape)


def intersect(
    size: int,
    scene: int,
    first_face: np.ndarray,
    mask: np.uint32,
    origins: np.ndarray,
    directions: np.ndarray,
    number: np.ndarray,
    distance: np.ndarray,
    face: np.ndarray,
    weights: np.ndarray,
    normal: np.ndarray,
) -> int:
    """Write the hits to the front of the arrays, as `embree_kernels.intersect`."""
    packets = _Packets(size, origins, directions, mask)
    packets.rays[:, FAR] = np.inf
    packets.integers[:, SHAPE] = NOTHING
    packets.integers[:, INSTANCE] = NOTHING
    packets.cast("rtcIntersect", scene)
    shape, instance = packets.read(SHAPE, integers=True), packets.read(INSTANCE, integers=True)
    hit = np.flatnonzero(shape != NOTHING)
    stored = slice(0, len(hit))
    number[stored], distance[stored] = hit, packets.read(FAR)[hit]
    part = np.where(instance != NOTHING, instance, shape)[hit]
    face[stored] = first_face[part] + packets.read(FACE, integers=True)[hit]
    for out, first in ((weights, WEIGHTS), (normal, NORMAL)):
        for axis in range(out.shape[1]):
            out[stored, axis] = packets.read(first + axis)[hit]
    return len(hit)


def occluded(
    size: int,
    scene: int,
    mask: np.uint32,
    origins: np.ndarray,
    directions: np.ndarray,
    far: np.ndarray,
    near_metres: np.float32,
    hit: np.ndarray,
) -> None:
    """Write whether a triangle occludes each ray, as `embree_kernels.occluded`."""
    packets = _Packets(size, origins, directions, mask)
    x, y, z = directions.T
    packets.write(NEAR, near_metres / np.sqrt(x * x + y * y + z * z))
    packets.write(FAR, far)
    packets.valid[packets.rays[:, NEAR] >= packets.rays[:, FAR]] = 0
    packets.cast("rtcOccluded", scene)
    hit[:] = (packets.valid.reshape(-1)[: packets.count] != 0) & (packets.read(FAR) < 0)
