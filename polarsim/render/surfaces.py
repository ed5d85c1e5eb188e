"""Surfaces of a terrain for ray casting: ground, rocks and the walls of the sandbox.

Scanned rocks have no underside, and their meshes end some millimetres above or below the ground mesh. Therefore the
open lower edges of rock meshes are extended downwards, so that no light passes beneath a rock.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial

import numpy as np

from polarsim.errors import RenderError
from polarsim.geometry.casters import make_caster
from polarsim.geometry.ray_engines import Device, RayEngine
from polarsim.geometry.rays import Caster, Intersector
from polarsim.geometry.topology import open_edges
from polarsim.photo import NO_ROCK
from polarsim.render.options import Model, RenderOptions
from polarsim.run_files.instances import BACKGROUND, GROUND, ROCK_IDS
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import WALL_FOOT_M, Walls

_LOWER_PART = 0.5  # share of the height of a rock: open edges above it are holes in the back, not the base
FARTHEST_M = 1000.0  # maximum distance of a camera or near lamp: float32 loses millimetres at larger distances
_WELD_DISTANCE = 1e-6  # metres: vertices closer than this are merged, so that seams are not treated as open edges


@dataclass(frozen=True)
class Surfaces:
    """Triangles with ids: BACKGROUND (walls), GROUND, or ROCK_IDS + rock."""

    vertices: np.ndarray  # (v, 3) sandbox frame, metres
    faces: np.ndarray  # (f, 3)
    normals: np.ndarray  # (v, 3) unit, for smooth shading
    id_of_face: np.ndarray  # (f,) int32
    rays: RayEngine = "embree"
    albedo: Mapping[Model, np.ndarray] = field(default_factory=dict)  # (v,) float32 factors of the reflectance
    device: Device = "cpu"
    walls: Walls | None = None  # walls among the triangles

    @cached_property
    def all(self) -> Intersector:
        return make_caster(self.vertices, self.faces, self.rays, device=self.device)

    def prepare(self, *, shadows: bool, threads: int = 1) -> None:
        """Build the ray structures before threads need them; `shadows`: also build the structures for shadow ids."""
        names = ("all", "corner_normals", *(("rest", "rocks") if shadows else ()))
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(partial(getattr, self), names))

    def sharing_rays(self, other: Surfaces) -> Surfaces:
        """Return the surfaces with the ray structures of other surfaces, which must have the same triangles."""
        shared = replace(self)
        own = {item.name for item in fields(self)}
        shared.__dict__.update({name: value for name, value in other.__dict__.items() if name not in own})
        return shared

    @cached_property
    def ids(self) -> np.ndarray:
        """Sorted unique ids (k,) of the faces."""
        return np.unique(self.id_of_face)

    @cached_property
    def rocks(self) -> Caster:
        """Ray caster of the rocks only; `rock_faces` contains the numbers of the faces."""
        return make_caster(self.vertices, self.faces[self.rock_faces], self.rays, device=self.device)

    @cached_property
    def rest(self) -> Caster:
        """Ray caster of ground and walls only; `rest_faces` contains the numbers of the faces."""
        return make_caster(self.vertices, self.faces[self.rest_faces], self.rays, device=self.device)

    @cached_property
    def rest_faces(self) -> np.ndarray:
        """Numbers (r,) of the faces of ground and walls."""
        return np.flatnonzero(self.id_of_face < ROCK_IDS)

    @cached_property
    def rock_faces(self) -> np.ndarray:
        """Numbers (r,) of the faces of rocks."""
        return np.flatnonzero(self.id_of_face >= ROCK_IDS)

    @cached_property
    def rock_corners(self) -> dict[int, np.ndarray]:
        """Corners (8, 3) of the axis-aligned box of each rock."""
        if not len(self.rock_faces):
            return {}
        order = self.rock_faces[np.argsort(self.id_of_face[self.rock_faces], kind="stable")]
        numbers, first = np.unique(self.id_of_face[order], return_index=True)
        points = self.vertices.take(self.faces.take(order, axis=0).ravel(), axis=0)
        ends = np.stack([extreme.reduceat(points, 3 * first) for extreme in (np.minimum, np.maximum)], axis=2)
        return {
            int(number) - ROCK_IDS: np.stack(np.meshgrid(*limits), axis=-1).reshape(-1, 3)
            for number, limits in zip(numbers, ends, strict=True)
        }

    @cached_property
    def corner_normals(self) -> np.ndarray:
        """Vertex normals (f, 3, 3) float32 by face, corner and axis."""
        normals = self.normals.astype(np.float32)
        return np.stack([normals.take(self.faces[:, corner], axis=0) for corner in range(3)], axis=1)


def check_position(surfaces: Surfaces, position: np.ndarray, what: str) -> None:
    """Raise `RenderError` if a position (3,) is below the ground or farther away than `FARTHEST_M`.

    `what`: name of the object in the error message, for example "the camera".
    """
    at = ", ".join(f"{value:g}" for value in position)
    if (range_m := float(np.linalg.norm(position))) > FARTHEST_M:
        raise RenderError(f"{what} at ({at}) m is {range_m:.3g} m away, expected at most {FARTHEST_M:g} m")
    distance, face = surfaces.all.nearest(np.array([position], float), np.array([[0.0, 0.0, 1.0]]))
    beneath = face[0] >= 0 and surfaces.id_of_face[face[0]] == GROUND
    if beneath or position[2] < surfaces.vertices[:, 2].min():
        how = f"{distance[0]:.3g} m below the ground" if beneath else "below all ground"
        raise RenderError(f"{what} at ({at}) m is {how}; +Z is up")


def build_surfaces(
    mesh: TerrainMesh, options: RenderOptions, albedo: Mapping[Model, np.ndarray] | None = None
) -> Surfaces:
    """Build the surfaces of a terrain: rocks with skirts that extend into the sand, and walls if `walls` is set.

    `albedo`: reflectance factors (v,) of the mesh vertices, by model.
    """
    original, mesh = mesh, add_skirts(mesh, options.skirt_m) if options.skirt_m else mesh
    id_of_face = np.where(mesh.rock_of_face == NO_ROCK, GROUND, ROCK_IDS + mesh.rock_of_face).astype(np.int32)
    vertices, faces, normals = mesh.vertices, mesh.faces, mesh.normals
    walls = mesh.walls if options.walls else None
    if walls is not None:
        wall_vertices, wall_faces, wall_normals = walls.mesh(mesh.sand_level - WALL_FOOT_M)
        faces = np.concatenate([faces, wall_faces + len(vertices)])
        vertices, normals = np.concatenate([vertices, wall_vertices]), np.concatenate([normals, wall_normals])
        id_of_face = np.concatenate([id_of_face, np.full(len(wall_faces), BACKGROUND, np.int32)])
    albedo = {model: _extended(factors, original, mesh, len(vertices)) for model, factors in (albedo or {}).items()}
    return Surfaces(vertices, faces, normals, id_of_face, options.rays, albedo, options.device, walls)


def _extended(factors: np.ndarray, original: TerrainMesh, mesh: TerrainMesh, count: int) -> np.ndarray:
    """Extend the factors of the original vertices to all vertices (count,): skirts get the rock's mean, walls 1."""
    extended = np.ones(count, np.float32)
    extended[: len(factors)] = factors
    if mesh is original:
        return extended
    for rock in mesh.rocks:
        used = np.unique(mesh.faces[mesh.rock_of_face == rock])
        scanned = used < len(original.vertices)
        extended[used[~scanned]] = factors[used[scanned]].mean()
    return extended


def box_mesh(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (24, 3), faces (12, 3) and normals (24, 3) of an upright box; sides share no vertex: sharp edges."""
    vertices, normals = [], []
    for axis in range(3):
        for side, sign in ((low, -1.0), (high, 1.0)):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            corners = np.empty((4, 3))
            corners[:, axis] = side[axis]
            corners[:, u] = np.array([low[u], high[u], high[u], low[u]])
            corners[:, v] = np.array([low[v], low[v], high[v], high[v]])
            vertices.append(corners if sign > 0 else corners[::-1])
            normals.append(np.tile(sign * np.eye(3)[axis], (4, 1)))
    quads = np.arange(24).reshape(6, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return np.concatenate(vertices), faces, np.concatenate(normals)


def add_skirts(mesh: TerrainMesh, depth: float) -> TerrainMesh:
    """Return the terrain with a vertical skirt of `depth` metres under the low open edges of each rock."""
    vertices, faces, normals, rocks = [mesh.vertices], [mesh.faces], [mesh.normals], [mesh.rock_of_face]
    count = len(mesh.vertices)
    for rock in mesh.rocks:
        rim = low_open_edges(mesh.vertices, mesh.faces.take(np.flatnonzero(mesh.rock_of_face == rock), axis=0))
        if not len(rim):
            continue
        skirt, skirt_faces, skirt_normals = skirt_strips(mesh.vertices[rim[:, 0]], mesh.vertices[rim[:, 1]], depth)
        vertices.append(skirt)
        faces.append(skirt_faces + count)
        normals.append(skirt_normals)
        rocks.append(np.full(len(skirt_faces), rock))
        count += len(skirt)
    joined = [np.concatenate(parts) for parts in (vertices, faces, rocks, normals)]
    return TerrainMesh(joined[0], joined[1], joined[2], joined[3], mesh.walls)


def low_open_edges(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the vertex numbers (e, 2) of the open edges in the lower part of a rock with faces (f, 3).

    An open edge belongs to one face only; the direction of the edge is that of the face.
    """
    edges = open_edges(faces)
    if not len(edges):
        return edges
    used, corners = np.unique(edges, return_inverse=True)
    positions = np.round(vertices[used] / _WELD_DISTANCE)
    start, end = np.unique(positions, axis=0, return_inverse=True)[1].ravel()[corners].reshape(-1, 2).T
    pair = np.minimum(start, end) * len(used) + np.maximum(start, end)
    _, first, times = np.unique(pair, return_index=True, return_counts=True)
    rim = edges[np.sort(first[times == 1])]
    height = vertices[:, 2].take(faces)
    limit = height.min() + _LOWER_PART * np.ptp(height)
    return rim[(vertices[rim, 2] < limit).all(axis=1)]


def skirt_strips(start: np.ndarray, end: np.ndarray, depth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices (4 e, 3), faces (2 e, 3) and normals (4 e, 3) of vertical strips under edges (e).

    The edges run from `start` (e, 3) to `end` (e, 3). The strips face the same side as the faces above the edges.
    """
    down = np.array([0, 0, depth])
    vertices = np.stack([start, end, end - down, start - down], axis=1)
    quads = np.arange(4 * len(start)).reshape(-1, 4)
    faces = np.concatenate([quads[:, [1, 0, 3]], quads[:, [1, 3, 2]]])
    along = end - start
    outward = np.stack([along[:, 1], -along[:, 0], np.zeros(len(along))], axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    outward = np.divide(outward, length, out=np.zeros_like(outward), where=length > 0)
    return vertices.reshape(-1, 3), faces, np.repeat(outward, 4, axis=0)
