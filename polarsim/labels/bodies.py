"""Ray casters of ground and rocks. Domes replace rocks without a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from polarsim.geometry.casters import make_caster
from polarsim.geometry.outlines import TRIM, TRIM_SHARE
from polarsim.geometry.rays import Caster, CompositeScene
from polarsim.photo import NO_ROCK, NO_SUN, Azimuth, Light
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.walls import WALL_FOOT_M, Walls
from polarsim.site_parts import RigLamp

HIGH = 10.0  # metres: above all objects in the sandbox
CONTACT = 1e-3  # metres: maximum depth below the ground at which a vertex belongs to the visible foot of a rock
SPHERE_MARGIN = 1e-3  # metres: margin of bounding spheres, larger than the error of single-precision rays


@dataclass(frozen=True)
class Dome:
    """Upper half of an ellipsoid of revolution on the ground, used for a rock without a mesh; metres."""

    foot: np.ndarray  # (3,) centre of the base
    radius: float
    height: float

    def mesh(self, rings: int = 6, segments: int = 24) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices (v, 3) and faces (f, 3), oriented outwards."""
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
class RockBody:
    """Vertices (n, 3) of a rock; masks (n,) of those above the ground (`above`) and above the skirt (`trimmed`)."""

    vertices: np.ndarray
    above: np.ndarray
    trimmed: np.ndarray
    meshed: bool

    @cached_property
    def centre(self) -> np.ndarray:
        """(3,) mean of the vertices."""
        return np.asarray(self.vertices.mean(axis=0))

    @cached_property
    def radius(self) -> float:
        """Radius of the bounding sphere around the centre, metres."""
        return float(np.sqrt(((self.vertices - self.centre) ** 2).sum(axis=1).max()))


@dataclass(frozen=True)
class TerrainCasters:
    """Ray casters of a terrain. Faces of a rock below the trim height count as ground."""

    bodies: dict[int, RockBody]
    rock_of_face: np.ndarray  # (f,) rock of each face of `everything`
    ground: Caster
    standing: Caster  # all faces except `ground`
    ground_faces: int  # number of faces of `ground`
    rocks: Caster  # faces of `standing` that count as rock
    rock_of_rocks_face: np.ndarray  # rock of each face of `rocks`, then `NO_ROCK` for index -1 (no hit)
    ground_level: float  # median height of the ground
    sandbox: Walls | None  # walls around the ground
    walls: Caster | None  # the same walls
    suns: Mapping[str, np.ndarray]  # azimuth -> (3,) position of the Sun lamp
    rig_lamp: RigLamp | None  # lamp that moves with the rig

    @property
    def everything(self) -> CompositeScene:
        """Caster of ground and rocks."""
        return CompositeScene(self.ground, self.standing, self.ground_faces)

    def ground_distance(self, origin: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the distance (n,) to the ground along directions (n, 3), in units of their length.

        Outside the mesh, the ground is the plane at `ground_level`. The distance of rays above the horizon is inf.
        """
        origins = np.broadcast_to(origin, directions.shape)
        distance = self.ground.nearest(origins, directions)[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (self.ground_level - origin[2]) / directions[:, 2]
        level = np.where((directions[:, 2] < 0) & (level > 0), level, np.inf)
        return np.where(np.isfinite(distance), distance, level)

    def hidden(self, eye: np.ndarray, points: np.ndarray, rock: int) -> np.ndarray:
        """Return whether a wall or a different rock occludes points (n, 3) of a rock.

        Self-occlusion is ignored because self-occluded points are inside the outline of the rock.
        """
        directions = points - eye
        hidden = self._passes_another(eye, directions, rock)
        passing = np.flatnonzero(hidden)
        distance, face = self.rocks.nearest(np.broadcast_to(eye, (len(passing), 3)), directions[passing])
        hit_rock = self.rock_of_rocks_face[face]
        hidden[passing] = (distance < 1) & (hit_rock != rock) & (hit_rock != NO_ROCK)
        if self.walls is None:
            return hidden
        return hidden | self.walls.occluded(np.broadcast_to(eye, points.shape), directions, 1.0)

    def _passes_another(self, eye: np.ndarray, directions: np.ndarray, rock: int) -> np.ndarray:
        """Return whether directions (n, 3) meet the bounding sphere of a different rock.

        Few rocks overlap in an image, and this test is faster than rays.
        """
        passes = np.zeros(len(directions), bool)
        if not len(directions):
            return passes
        squared = np.einsum("nk,nk->n", directions, directions)
        middle = directions.mean(axis=0)
        cone = _half_angle(middle, float(np.sqrt(((directions - middle) ** 2).sum(axis=1).max())))
        for other, body in self.bodies.items():
            towards, radius = body.centre - eye, body.radius + SPHERE_MARGIN
            if other != rock and _angle(middle, towards) <= cone + _half_angle(towards, radius):
                # The line misses the sphere if |d x c|^2 = |d|^2 |c|^2 - (d . c)^2 > |d|^2 r^2.
                passes |= (directions @ towards) ** 2 >= squared * (towards @ towards - radius**2)
        return passes


def active_lamp(world: TerrainCasters, localised: LocalisedRig, light: Light, azimuth: Azimuth) -> np.ndarray | None:
    """Return the position (3,) of the brightest lamp, sandbox frame; None without any lamp."""
    if azimuth != NO_SUN:
        return world.suns[azimuth]
    return localised.rover_light(world.rig_lamp) if light == "on" and world.rig_lamp else None


def _angle(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two directions (3,), radians."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def _half_angle(towards: np.ndarray, radius: float) -> float:
    """Return the half angle of the cone around a sphere at `towards` (3,), radians; pi if the origin is inside."""
    distance = float(np.linalg.norm(towards))
    return float(np.arcsin(radius / distance)) if radius < distance else np.pi


def build_worlds(
    terrain: TerrainMesh,
    localised: Mapping[str, LocalisedRig],
    suns: Mapping[str, np.ndarray],
    rig_lamp: RigLamp | None,
) -> tuple[TerrainCasters, TerrainCasters]:
    """Return the world of the terrain, and a world without rocks for positions with unverified poses.

    If all poses are verified, both results are the same world.
    """

    def built(terrain: TerrainMesh) -> TerrainCasters:
        return build_world(terrain, TRIM, suns, rig_lamp)

    world = built(terrain)
    return world, built(terrain.ground()) if any(rig.unproven for rig in localised.values()) else world


def build_world(
    terrain: TerrainMesh, trim: float, suns: Mapping[str, np.ndarray], rig_lamp: RigLamp | None
) -> TerrainCasters:
    """Build the casters of the meshes of a terrain.

    `trim`: rock surface below this height above the ground counts as ground, metres.
    `suns`, azimuth -> (3,): positions of the Sun lamps.
    """
    ground_count = int((terrain.rock_of_face == NO_ROCK).sum())
    ground_faces, standing_faces = np.split(terrain.faces, [ground_count])
    assert (terrain.rock_of_face[:ground_count] == NO_ROCK).all()
    ground = make_caster(terrain.vertices, ground_faces)
    is_of_ground = np.zeros(len(terrain.vertices), bool)
    is_of_ground[ground_faces] = True
    points = terrain.vertices[is_of_ground]
    level = float(np.median(points[:, 2]))
    rock_of_face = terrain.rock_of_face.copy()
    bodies: dict[int, RockBody] = {}
    for rock in terrain.rocks:
        rock_faces = np.flatnonzero(rock_of_face == rock)
        used, corner = np.unique(terrain.faces[rock_faces], return_inverse=True)
        vertices = terrain.vertices[used]
        height = _height_above(ground, level, vertices)
        low = min(trim, TRIM_SHARE * float(height.max()))
        bodies[rock] = RockBody(vertices, height > -CONTACT, height > low, meshed=True)
        rock_of_face[rock_faces[(height <= low)[corner.reshape(-1, 3)].all(axis=1)]] = NO_ROCK
    of_rock = rock_of_face != NO_ROCK
    return TerrainCasters(
        bodies,
        rock_of_face,
        ground,
        make_caster(terrain.vertices, standing_faces),
        ground_count,
        make_caster(terrain.vertices, terrain.faces[of_rock]),
        np.append(rock_of_face[of_rock], NO_ROCK),
        level,
        terrain.walls,
        None if terrain.walls is None else make_caster(*terrain.walls.mesh(level - WALL_FOOT_M)[:2]),
        suns,
        rig_lamp,
    )


def with_domes(world: TerrainCasters, domes: dict[int, Dome]) -> TerrainCasters:
    """Return the world with added domes for rocks without a mesh."""
    if not domes:
        return world
    bodies = dict(world.bodies)
    vertices, faces, rock_of_face = [], [], []
    count = 0
    for rock, dome in sorted(domes.items()):
        dome_vertices, corners = dome.mesh()
        standing = np.ones(len(dome_vertices), bool)
        bodies[rock] = RockBody(dome_vertices, standing, standing, meshed=False)
        vertices.append(dome_vertices)
        faces.append(corners + count)
        rock_of_face.append(np.full(len(corners), rock))
        count += len(dome_vertices)
    added, rocks = make_caster(np.concatenate(vertices), np.concatenate(faces)), np.concatenate(rock_of_face)
    return replace(
        world,
        bodies=bodies,
        rock_of_face=np.append(world.rock_of_face, rocks),
        standing=CompositeScene(world.standing, added, len(world.rock_of_face) - world.ground_faces),
        rocks=CompositeScene(world.rocks, added, len(world.rock_of_rocks_face) - 1),
        rock_of_rocks_face=np.concatenate([world.rock_of_rocks_face[:-1], rocks, [NO_ROCK]]),
    )


def _height_above(ground: Caster, level: float, points: np.ndarray) -> np.ndarray:
    starts = np.concatenate([points[:, :2], np.full((len(points), 1), HIGH)], axis=1)
    distance = ground.nearest(starts, np.broadcast_to([0.0, 0.0, -1.0], starts.shape))[0]
    return points[:, 2] - np.where(np.isfinite(distance), HIGH - distance, level)
