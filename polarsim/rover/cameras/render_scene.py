"""Ray-tracing scene of a drive: static ground and rocks, and the tracks and the rover at a time.

From frame to frame, only the rover and the changed tiles of the tracks are rebuilt.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.interpolate import RectBivariateSpline

from polarsim.errors import RoverError
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster, Intersector
from polarsim.geometry.rays_embree import MovableMesh, MovableScene
from polarsim.render.surfaces import Surfaces, add_skirts
from polarsim.rover.cameras.bodywork import Bodywork, MeshArrays, join_mesh_arrays
from polarsim.rover.cameras.tracks import NodeGrid, WheelTracks, tile_faces
from polarsim.rover.world.surface import World, WorldBackdrop
from polarsim.run_files.instances import BODY, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.run_files.scene import TerrainMesh

_REST, _ROCKS = 1, 2  # mask bits of parts
_FAR_M = 80.0  # extension of the ground at each side of the drive's grid, up to the horizon of a camera at 2 m
_FADE_M = 0.6  # length over which the heights of the rim fade outside the grid
_BLUR = 0.5  # standard deviation of the blur along the rim per distance from it: prevents radial streaks
_GROWTH = 1.35  # ratio of adjacent cell sizes outside the grid


@dataclass(frozen=True)
class MovingSurfaces(Surfaces):
    """Surfaces in parts: faces of ground and body first, faces of rocks last. Arrays change in place."""

    parts: MovableScene = field(kw_only=True)

    @cached_property
    def all(self) -> Intersector:
        return self.parts.caster()

    @cached_property
    def rest(self) -> Caster:
        return self.parts.caster(_REST)


class RenderScene:
    """All visible surfaces of a drive; `show` moves the scene to a time."""

    def __init__(self, tracks: WheelTracks, world: World, body: Bodywork, *, skirt_m: float) -> None:
        """
        Parameters
        ----------
        world
            Rocks, and the ground outside the grid. Rocks there have no labels; they are part of the ground.
        skirt_m
            Length by which the open lower edges of rocks are extended downwards, so that no light passes below.
        """
        self.tracks, self._body = tracks, body
        rocks = rocks_with_skirts(world, skirt_m)
        labelled = SHADOW_IDS - ROCK_IDS - 1  # instance maps have no ids for more rocks
        if rocks.rock_of_face.max(initial=0) > labelled:
            raise RoverError(f"{rocks.rock_of_face.max()} rocks, instance maps have ids for {labelled}")
        if world.around is None:
            still = static_ground(tracks.fine, tracks.covered, _FAR_M)
        else:
            still = join_mesh_arrays([surrounding_ground(tracks, world.around), _scenery(world.around)])
        tiles = [tracks.mesh(number) for number in range(len(tracks.tiles))]
        rest_pose = {link: Pose.identity() for link in body.links}
        parts = [
            still,
            *((vertices, tile_faces(tracks.side), normals) for vertices, normals in tiles),
            (body.posed(rest_pose)[0], body.faces, body.posed(rest_pose)[1]),
            (rocks.vertices, rocks.faces, rocks.normals),
        ]
        ids = [*(np.full(len(faces), GROUND) for _, faces, _ in parts[:-2]), BODY + body.solid_of_face]
        self._first_vertex, self._first_face = (np.cumsum([0, *(len(part[n]) for part in parts)]) for n in (0, 1))
        masks = [_REST] * (len(parts) - 1) + [_ROCKS]
        self._parts = MovableScene([MovableMesh(*part[:2], mask) for part, mask in zip(parts, masks, strict=True)])
        ids_of_faces = np.concatenate([*ids, ROCK_IDS + rocks.rock_of_face]).astype(np.int32)
        self.surfaces = MovingSurfaces(*join_mesh_arrays(parts), ids_of_faces, parts=self._parts)

    def show(self, level: np.ndarray, world_from_link: Mapping[str, Pose]) -> int:
        """Move ground levels (rows, columns) and rover to a time; return the number of rebuilt tiles."""
        changed = self.tracks.show(level)
        for number in changed:
            self._move(1 + number, *self.tracks.mesh(number))
        self._move(1 + len(self.tracks.tiles), *self._body.posed(world_from_link))
        self._parts.commit()
        return len(changed)

    def _move(self, part: int, vertices: np.ndarray, normals: np.ndarray) -> None:
        first, last = self._first_vertex[part : part + 2]
        surfaces = self.surfaces
        surfaces.vertices[first:last], surfaces.normals[first:last] = vertices, normals
        rows = slice(*self._first_face[part : part + 2])
        surfaces.corner_normals[rows] = normals.astype(np.float32)[surfaces.faces[rows] - first]
        self._parts.move(part, vertices)


def static_ground(lattice: NodeGrid, covered: np.ndarray, far_m: float) -> MeshArrays:
    """Return the mesh of the ground without the covered cells (rows - 1, columns - 1), extended by `far_m`.

    Outside the grid, cells grow with distance and the level approaches the median level of the rim.
    """
    steps = _growing(lattice.cell, far_m)
    count = len(steps)
    shape = lattice.level.shape
    y, x = (
        np.concatenate([start - steps[::-1], start + lattice.cell * np.arange(size), end + steps])
        for start, size in ((lattice.y0, shape[0]), (lattice.x0, shape[1]))
        for end in [start + lattice.cell * (size - 1)]
    )
    rim = np.concatenate([lattice.level[0], lattice.level[-1], lattice.level[:, 0], lattice.level[:, -1]])
    centre = np.median(rim)
    beyond = np.concatenate([steps[::-1], np.zeros(1), steps]) if count else np.zeros(1)
    out_y, out_x = (np.concatenate([beyond[:count], np.zeros(size), beyond[len(beyond) - count :]]) for size in shape)
    share = np.exp(-np.maximum(out_y[:, None], out_x[None]) / _FADE_M)
    z = centre + share * (_beyond_rim(lattice.level, steps / lattice.cell) - centre)
    return _mesh(x, y, z, (count, count), lattice, covered)


def surrounding_ground(tracks: WheelTracks, around: WorldBackdrop) -> MeshArrays:
    """Return the mesh of the ground and the surroundings, on a spline through all nodes."""
    coarse, fine = tracks.lattice, tracks.fine
    first = tuple(
        int(np.searchsorted(nodes, start - coarse.cell / 2))
        for nodes, start in ((around.y, coarse.y0), (around.x, coarse.x0))
    )
    level = around.level.astype(float)
    level[tuple(slice(start, start + size) for start, size in zip(first, coarse.level.shape, strict=True))] = (
        coarse.level
    )
    y, x = (
        np.concatenate([nodes[:start], origin + fine.cell * np.arange(count), nodes[start + size :]])
        for nodes, start, origin, size, count in zip(
            (around.y, around.x), first, (coarse.y0, coarse.x0), coarse.level.shape, fine.level.shape, strict=True
        )
    )
    z = RectBivariateSpline(around.y, around.x, level)(y, x)
    z[tuple(slice(start, start + size) for start, size in zip(first, fine.level.shape, strict=True))] = fine.level
    return _mesh(x, y, z, first, fine, tracks.covered)


def _mesh(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, first: tuple[int, ...], lattice: NodeGrid, covered: np.ndarray
) -> MeshArrays:
    """Return the mesh of nodes without the covered cells of a lattice.

    `first`: row and column of the lattice's first node among the nodes.
    """
    along_y, along_x = np.gradient(z, y, x)
    inner = tuple(slice(start, start + size) for start, size in zip(first, lattice.level.shape, strict=True))
    along_y[inner], along_x[inner] = lattice.slopes  # agree with the slopes of the tiles
    normals = np.stack([-along_x, -along_y, np.ones_like(z)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    kept = np.ones((len(y) - 1, len(x) - 1), bool)
    kept[tuple(slice(start, start + size) for start, size in zip(first, covered.shape, strict=True))] = ~covered
    number = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (part[kept] for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = np.stack([*np.meshgrid(x, y), z], axis=-1)
    return points.reshape(-1, 3), faces, normals.reshape(-1, 3)


def _scenery(around: WorldBackdrop) -> MeshArrays:
    vertices, faces = around.vertices.astype(float), around.triangles.astype(int)
    return vertices, faces, Mesh(vertices, faces).normals() if len(faces) else vertices


def rocks_with_skirts(world: World, skirt_m: float) -> TerrainMesh:
    """Return the rocks of a world, numbered from 1, with smooth normals and skirts that reach into the sand."""
    table = world.rocks
    numbers = [n for n, faces in enumerate(table["faces"], 1) if faces]
    meshes = [Mesh(*world.rock_mesh(int(table["rock"].iloc[n - 1]))) for n in numbers]
    if not meshes:
        empty = np.zeros((0, 3))
        return TerrainMesh(empty, empty.astype(int), np.zeros(0, int), empty)
    whole = join_meshes(meshes)
    rocks = TerrainMesh(whole.vertices, whole.faces, np.repeat(numbers, [len(mesh.faces) for mesh in meshes]))
    return add_skirts(rocks, skirt_m) if skirt_m else rocks


def _beyond_rim(level: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Return levels (rows, columns) extended beyond the rim by `cells`; the blur along the rim grows outwards."""
    count = len(cells)
    padded = np.pad(level, count, mode="edge")
    for lines in (padded, padded.T):
        for number, distance in enumerate(cells):
            for line in (count - 1 - number, len(lines) - count + number):
                lines[line] = ndimage.gaussian_filter1d(lines[line], _BLUR * distance, mode="nearest")
    return padded


def _growing(cell: float, far_m: float) -> np.ndarray:
    """Return distances from the rim of the grid, with growing steps."""
    steps: list[float] = []
    while far_m > 0 and (not steps or steps[-1] < far_m):
        steps.append((steps[-1] if steps else 0.0) + cell * _GROWTH ** len(steps))
    return np.array(steps)
