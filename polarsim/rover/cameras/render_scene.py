"""The scene of a drive, ready for rays: still ground and rocks, and the tracks and the rover as they are at a moment.

Only tiles of the tracks that changed, and the rover, are built anew from moment to moment.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.interpolate import RectBivariateSpline

from polarsim.errors import RoverError
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays import Caster, Surveyor
from polarsim.geometry.rays_embree import MovableMesh, MovableScene
from polarsim.render.surfaces import Surfaces, with_skirts
from polarsim.rover.cameras.bodywork import Body
from polarsim.rover.cameras.tracks import Lattice, WheelTracks, tile_faces
from polarsim.rover.world.surface import Surroundings, World
from polarsim.run_files.instances import BODY, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.run_files.scene import TerrainMesh

_REST, _ROCKS = 1, 2  # bits of parts
_FAR_M = 80.0  # the ground continues this far beyond the drive's grid: the horizon of a camera at 2 m
_FADE_M = 0.6  # over which the rim's heights fade out beyond it
_BLUR = 0.5  # along the rim, over the distance beyond it: else its heights would be seen as rays
_GROWTH = 1.35  # of the far ground's cells, from one to the next
Still = tuple[np.ndarray, np.ndarray, np.ndarray]  # vertices (v, 3), faces (f, 3), unit normals (v, 3) of what stands


@dataclass(frozen=True)
class Rocks:
    """Rocks of a world: vertices (v, 3), faces (f, 3), and by face a number from 1 on; metres."""

    vertices: np.ndarray
    faces: np.ndarray
    number_of_face: np.ndarray


@dataclass(frozen=True)
class MovingSurfaces(Surfaces):
    """Surfaces in parts. The faces of ground and body come first, the rocks' last; arrays change in place."""

    parts: MovableScene | None = None

    @cached_property
    def all(self) -> Surveyor:
        assert self.parts is not None
        return self.parts.caster()

    @cached_property
    def rest(self) -> Caster:
        assert self.parts is not None
        return self.parts.caster(_REST)


class RenderScene:
    """All that is seen on a drive; `show` moves it to a moment."""

    def __init__(
        self,
        tracks: WheelTracks,
        rocks: Rocks,
        body: Body,
        *,
        skirt_m: float,
        around: Surroundings | None = None,
    ) -> None:
        """
        Parameters
        ----------
        skirt_m : float
            Open feet of rocks are drawn out downwards so far: no light beneath them.
        around : Surroundings
            What lies beyond the grid; to labels its rocks are relief of the ground.

        Raises
        ------
        RoverError
            More rocks than instance maps have ids for.
        """
        self.tracks, self._body = tracks, body
        if around is None:
            still = still_ground(tracks.fine, tracks.covered, _FAR_M)
        else:
            still = _joined(surrounding_ground(tracks, around), _scenery(around))
        tiles = [tracks.mesh(number) for number in range(len(tracks.tiles))]
        here = {link: Pose.identity() for link in body.links}
        standing = rocks_with_skirts(rocks, skirt_m)
        faces = [still[1], *(tile_faces(tracks.side) for _ in tiles), body.faces, standing.faces]
        vertices = [still[0], *(tile[0] for tile in tiles), body.posed(here)[0], standing.vertices]
        normals = [still[2], *(tile[1] for tile in tiles), body.posed(here)[1], standing.normals]
        ids = [
            *(np.full(len(own), GROUND) for own in faces[:-2]),
            BODY + body.solid_of_face,
            ROCK_IDS + standing.rock_of_face,
        ]
        if standing.rock_of_face.max(initial=0) >= SHADOW_IDS - ROCK_IDS:
            raise RoverError(
                f"{standing.rock_of_face.max()} rocks, instance maps have ids for {SHADOW_IDS - ROCK_IDS - 1}"
            )
        self._first_vertex = np.cumsum([0, *(len(own) for own in vertices)])
        self._first_face = np.cumsum([0, *(len(own) for own in faces)])
        masks = [_REST] * (len(faces) - 1) + [_ROCKS]
        parts = [(v, f, mask) for v, f, mask in zip(vertices, faces, masks, strict=True)]
        self._parts = MovableScene([MovableMesh(*part) for part in parts])
        self.surfaces = MovingSurfaces(
            np.concatenate(vertices),
            np.concatenate([own + first for own, first in zip(faces, self._first_vertex, strict=False)]),
            np.concatenate(normals),
            np.concatenate(ids).astype(np.int32),
            parts=self._parts,
        )

    def show(self, level: np.ndarray, world_from_link: Mapping[str, Pose]) -> int:
        """Bring ground levels (rows, columns) and rover to a moment; how many tiles were built anew."""
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


def still_ground(lattice: Lattice, covered: np.ndarray, far_m: float) -> Still:
    """Vertices, faces and normals of the ground without the covered cells (rows - 1, columns - 1), and of what is far.

    Beyond the grid cells grow, and the level goes from that of the rim to the rim's median.
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


def surrounding_ground(tracks: WheelTracks, around: Surroundings) -> Still:
    """The same where something lies around the grid: its ground, on a spline through all nodes."""
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
        np.concatenate([nodes[:start], origin + fine.cell * np.arange(own), nodes[start + size :]])
        for nodes, start, origin, size, own in zip(
            (around.y, around.x), first, (coarse.y0, coarse.x0), coarse.level.shape, fine.level.shape, strict=True
        )
    )
    z = RectBivariateSpline(around.y, around.x, level)(y, x)
    z[tuple(slice(start, start + size) for start, size in zip(first, fine.level.shape, strict=True))] = fine.level
    return _mesh(x, y, z, first, fine, tracks.covered)


def _mesh(
    x: np.ndarray, y: np.ndarray, z: np.ndarray, first: tuple[int, ...], lattice: Lattice, covered: np.ndarray
) -> Still:
    """Of nodes among which those of a lattice begin at row and column `first`, without its covered cells."""
    along_y, along_x = np.gradient(z, y, x)
    inner = tuple(slice(start, start + size) for start, size in zip(first, lattice.level.shape, strict=True))
    along_y[inner], along_x[inner] = lattice.slopes  # what tiles continue
    normals = np.stack([-along_x, -along_y, np.ones_like(z)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    kept = np.ones((len(y) - 1, len(x) - 1), bool)
    kept[tuple(slice(start, start + size) for start, size in zip(first, covered.shape, strict=True))] = ~covered
    number = np.arange(z.size).reshape(z.shape)
    a, b, c, d = (part[kept] for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    points = np.stack([*np.meshgrid(x, y), z], axis=-1)
    return points.reshape(-1, 3), faces, normals.reshape(-1, 3)


def _scenery(around: Surroundings) -> Still:
    vertices, faces = around.vertices.astype(float), around.triangles.astype(int)
    return vertices, faces, Mesh(vertices, faces).normals() if len(faces) else vertices


def _joined(one: Still, two: Still) -> Still:
    return (
        np.concatenate([one[0], two[0]]),
        np.concatenate([one[1], two[1] + len(one[0])]),
        np.concatenate([one[2], two[2]]),
    )


def rocks_of(world: World) -> Rocks:
    """A world's rocks; rock numbers here are indices in its table, from 1 on."""
    number = np.zeros(len(world.triangles), np.int64)
    spans = world.rocks[["first_face", "faces"]].to_numpy(int)
    for label, (first, count) in enumerate(spans, 1):
        number[first : first + count] = label
    return Rocks(world.vertices, world.triangles[number > 0], number[number > 0])


def rocks_with_skirts(rocks: Rocks, skirt_m: float) -> TerrainMesh:
    """Rocks with smooth normals of their own, with skirts that reach into the sand."""
    parts = []
    for number in np.unique(rocks.number_of_face):
        used, faces = np.unique(rocks.faces[rocks.number_of_face == number], return_inverse=True)
        parts.append((int(number), Mesh(rocks.vertices[used].astype(float), faces.reshape(-1, 3))))
    if not parts:
        none = np.zeros((0, 3))
        return TerrainMesh(none, none.astype(int), np.zeros(0, int), none)
    starts = np.cumsum([0, *(len(mesh.vertices) for _, mesh in parts)])
    mesh = TerrainMesh(
        np.concatenate([mesh.vertices for _, mesh in parts]),
        np.concatenate([mesh.faces + start for (_, mesh), start in zip(parts, starts, strict=False)]),
        np.concatenate([np.full(len(mesh.faces), number) for number, mesh in parts]),
    )
    return with_skirts(mesh, skirt_m) if skirt_m else mesh


def _beyond_rim(level: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Level (rows, columns) with the rim's heights so many cells beyond it, the smoother the farther."""
    count = len(cells)
    padded = np.pad(level, count, mode="edge")
    for lines in (padded, padded.T):
        for number, distance in enumerate(cells):
            for line in (count - 1 - number, len(lines) - count + number):
                lines[line] = ndimage.gaussian_filter1d(lines[line], _BLUR * distance, mode="nearest")
    return padded


def _growing(cell: float, far_m: float) -> np.ndarray:
    """Distances from the grid's rim, each step larger than the one before."""
    steps: list[float] = []
    while far_m > 0 and (not steps or steps[-1] < far_m):
        steps.append((steps[-1] if steps else 0.0) + cell * _GROWTH ** len(steps))
    return np.array(steps)
