"""`rays.Caster` on Intel's Embree 4 (through embreex): float32 inside, millions of rays a second."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np

from polarsim.errors import PolarsimError
from polarsim.geometry.rays import NO_FACE, START_OFFSET, Met
from polarsim.geometry.vectors import length, moved

_STRIP = 1 << 18  # rays handed to Embree at once, whatever the number of threads: same strips, same bytes
_NO_HIT = 1e36  # embreex's distance of a ray that met nothing


class EmbreeCaster:
    """Triangles in an Embree scene; strips of rays are cast on `threads` threads (Embree releases the GIL)."""

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, threads: int = 1) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise PolarsimError(f"rays: engine 'embree' cannot be loaded ({error}); install embreex") from error
        self._threads = max(1, threads)
        self._empty = len(faces) == 0
        vertices, faces = _used(np.asarray(vertices), np.asarray(faces).reshape(-1, 3))
        self._scene = EmbreeScene(robust=True)  # rays through shared edges must not slip between triangles
        self._mesh = TriangleMesh(
            self._scene,
            np.ascontiguousarray(vertices, np.float32).reshape(-1, 3),
            np.ascontiguousarray(faces, np.int32),
        )
        if not self._empty:  # Embree builds its tree at the first query; threads must not race for it
            self._scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))

    def nearest(self, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance = np.full(len(origins), np.inf)
        face = np.full(len(origins), NO_FACE, np.int64)

        def cast(part: slice) -> None:
            found = self._scene.run(_float32(origins[part]), _float32(directions[part]), output=True)
            hit = np.flatnonzero(found["primID"] >= 0)
            face[part][hit] = found["primID"][hit]
            distance[part][hit] = found["tfar"][hit]

        self._in_strips(cast, len(origins))
        return distance, face

    def meet(self, origins: np.ndarray, directions: np.ndarray) -> Met:
        parts: dict[int, Met] = {}

        def cast(part: slice) -> None:
            found = self._scene.run(_float32(origins[part]), _float32(directions[part]), output=True)
            ray = np.flatnonzero(found["primID"] >= 0)
            weights = np.stack([found["u"].take(ray), found["v"].take(ray)], axis=1)
            distance, face = found["tfar"].take(ray), found["primID"].take(ray).astype(np.int64)
            parts[part.start] = Met(ray + part.start, distance, face, weights, found["Ng"].take(ray, axis=0))

        self._in_strips(cast, len(origins))
        in_order = [parts[start] for start in sorted(parts)] or [_nothing_met()]
        names = [field.name for field in fields(Met)]
        return Met(*(np.concatenate([getattr(part, name) for part in in_order]) for name in names))

    def blocked(self, origins: np.ndarray, directions: np.ndarray, far: np.ndarray | float) -> np.ndarray:
        far = np.broadcast_to(np.asarray(far), len(origins))
        hit = np.zeros(len(origins), bool)

        def cast(part: slice) -> None:
            along = directions[part]
            near = START_OFFSET / length(along)
            starts = moved(origins[part], along, near)  # embreex has no near limit of its own
            lengths = _float32(np.minimum(far[part] - near, _NO_HIT))
            found = self._scene.run(_float32(starts), _float32(along), dists=lengths, query="OCCLUDED")
            hit[part] = (found >= 0) & (lengths > 0)

        self._in_strips(cast, len(origins))
        return hit

    def _in_strips(self, cast, rays: int) -> None:  # type: ignore[no-untyped-def]
        if self._empty:
            return
        strips = [slice(start, start + _STRIP) for start in range(0, rays, _STRIP)]
        if self._threads == 1:
            for strip in strips:
                cast(strip)
            return
        with ThreadPoolExecutor(self._threads) as pool:
            list(pool.map(cast, strips))


def _used(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (v, 3) without those that no face (f, 3) has: embreex copies them number by number, which takes long."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1)[faces]


def _nothing_met() -> Met:
    none = np.zeros(0, np.int64)
    return Met(none, np.zeros(0, np.float32), none, np.zeros((0, 2), np.float32), np.zeros((0, 3), np.float32))


def _float32(values: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(values, np.float32)
