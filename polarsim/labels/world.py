"""Ground and rocks as bodies that rays meet: meshed rocks, and domes that stand in for rocks without a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.formats.scene import TerrainMesh
from polarsim.geometry.rays import Caster, caster
from polarsim.photo import NO_ROCK

HIGH = 10.0  # metres: above everything in the sandbox
LOW_SHARE = 0.35  # of a rock's height: flat rocks are not trimmed away
SAME_PLACE = 1e-3  # metres: a surface this close to a point does not hide it


@dataclass(frozen=True)
class Dome:
    """Upper half of an ellipsoid of revolution on the ground, for a rock that only labels know; metres."""

    foot: np.ndarray  # (3,) centre of its base
    radius: float
    height: float

    def mesh(self, rings: int = 6, segments: int = 24) -> tuple[np.ndarray, np.ndarray]:
        """Vertices (v, 3) and faces (f, 3), outward."""
        elevation = np.linspace(0, np.pi / 2, rings + 1)[:-1]
        around = np.linspace(0, 2 * np.pi, segments, endpoint=False)
        ring = np.stack([np.cos(around), np.sin(around), np.zeros(segments)], axis=-1) * self.radius
        layers = [ring * np.cos(e) + [0, 0, self.height * np.sin(e)] for e in elevation]
        vertices = np.concatenate([*layers, [[0, 0, self.height]]]) + self.foot
        faces = []
        for layer in range(rings - 1):
            a = layer * segments + np.arange(segments)
            b = layer * segments + (np.arange(segments) + 1) % segments
            faces += [np.stack([a, b, b + segments], axis=-1), np.stack([a, b + segments, a + segments], axis=-1)]
        a = (rings - 1) * segments + np.arange(segments)
        b = (rings - 1) * segments + (np.arange(segments) + 1) % segments
        faces.append(np.stack([a, b, np.full(segments, rings * segments)], axis=-1))
        return vertices, np.concatenate(faces)


@dataclass(frozen=True)
class Body:
    """A rock's vertices (n, 3), which of them stand above the ground, and which above its skirt (both (n,) bool)."""

    vertices: np.ndarray
    above: np.ndarray
    trimmed: np.ndarray
    meshed: bool


@dataclass(frozen=True)
class World:
    """What rays meet. Faces of a rock that lie lower than the trim count as ground."""

    bodies: dict[int, Body]
    vertices: np.ndarray  # (v, 3)
    faces: np.ndarray  # (f, 3)
    rock_of_face: np.ndarray  # (f,)
    everything: Caster
    ground: Caster
    rocks: Caster
    rock_of_rocks_face: np.ndarray  # rock of each face of `rocks`
    ground_level: float  # median height of the ground: lamps were surveyed above the sand

    def height_above_ground(self, points: np.ndarray) -> np.ndarray:
        """(n,) height of points (n, 3) above the ground below or over them; above its level outside the mesh."""
        return _height_above(self.ground, self.ground_level, points)

    def ground_distance(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(n,) distance to the ground along directions (n, 3), in their units; to its level beyond the mesh.

        A ray that never comes down gets the farthest finite distance of the others, or inf.
        """
        origins = np.broadcast_to(origin, directions.shape)
        distance = self.ground.nearest(origins, directions)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (self.ground_level - origin[2]) / directions[:, 2]
        level = np.where((directions[:, 2] < 0) & (level > 0), level, np.inf)
        return np.where(np.isfinite(distance), distance, level)

    def hidden(self, eye: np.ndarray, points: np.ndarray, rock: int) -> np.ndarray:
        """(n,) bool: something else than the rock itself stands between the eye and points (n, 3) of it."""
        directions = points - eye
        distance, face = self.everything.nearest(np.broadcast_to(eye, points.shape), directions)
        near = distance < 1 - SAME_PLACE / np.linalg.norm(directions, axis=1)
        other = self.rock_of_face[face] != rock
        # The rock's own front may hide a point from us, but no silhouette: only strangers count.
        return near & other & (self.rock_of_face[face] != NO_ROCK)


def build_world(terrain: TerrainMesh, domes: dict[int, Dome], trim: float) -> World:
    """Put the terrain's meshes and the domes of unmeshed rocks together.

    Parameters
    ----------
    trim : float
        Rock surface lower than this above the ground counts as ground, metres.
    """
    ground_faces = terrain.faces[terrain.rock_of_face == NO_ROCK]
    ground = caster(terrain.vertices, ground_faces)
    ground_level = float(np.median(terrain.vertices[np.unique(ground_faces), 2])) if len(ground_faces) else 0.0
    vertices, faces, rock_of_face = [terrain.vertices], [terrain.faces], [terrain.rock_of_face]
    count = len(terrain.vertices)
    for rock, dome in sorted(domes.items()):
        dome_vertices, dome_faces = dome.mesh()
        vertices.append(dome_vertices)
        faces.append(dome_faces + count)
        rock_of_face.append(np.full(len(dome_faces), rock))
        count += len(dome_vertices)
    all_vertices, all_faces, rocks = np.concatenate(vertices), np.concatenate(faces), np.concatenate(rock_of_face)
    rocks = rocks.copy()
    bodies: dict[int, Body] = {}
    for rock in (int(number) for number in np.unique(rocks) if number != NO_ROCK):
        own = np.flatnonzero(rocks == rock)
        used, corner = np.unique(all_faces[own], return_inverse=True)
        height = _height_above(ground, ground_level, all_vertices[used])
        low = min(trim, LOW_SHARE * float(height.max()))
        bodies[rock] = Body(all_vertices[used], height > 0, height > low, rock not in domes)
        skirt = (height <= low)[corner.reshape(-1, 3)].all(axis=1)
        rocks[own[skirt]] = NO_ROCK
    of_rock = rocks != NO_ROCK
    return World(
        bodies,
        all_vertices,
        all_faces,
        rocks,
        caster(all_vertices, all_faces),
        ground,
        caster(all_vertices, all_faces[of_rock]),
        rocks[of_rock],
        ground_level,
    )


def _height_above(ground: Caster, level: float, points: np.ndarray) -> np.ndarray:
    starts = np.concatenate([points[:, :2], np.full((len(points), 1), HIGH)], axis=1)
    distance = ground.nearest(starts, np.broadcast_to([0.0, 0.0, -1.0], starts.shape))[0]
    return points[:, 2] - np.where(np.isfinite(distance), HIGH - distance, level)
