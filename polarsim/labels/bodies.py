"""Ground and rocks as bodies that rays meet: meshed rocks, and domes that stand in for rocks without a mesh."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from polarsim.geometry.casters import caster
from polarsim.geometry.outlines import TRIM, TRIM_SHARE
from polarsim.geometry.rays import Caster, Joined
from polarsim.photo import NO_ROCK
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.survey import SUN_LAMPS

HIGH = 10.0  # metres: above everything in the sandbox
CONTACT = 1e-3  # metres: a vertex this little below the ground's surface still belongs to the rock's visible foot
SURELY_CLEAR = 1e-3  # metres beside a rock's ball that no ray in single precision is off by


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

    @cached_property
    def centre(self) -> np.ndarray:
        """(3,) mean of the vertices."""
        return np.asarray(self.vertices.mean(axis=0))

    @cached_property
    def radius(self) -> float:
        """Of the ball about the centre that holds all vertices, metres."""
        return float(np.sqrt(((self.vertices - self.centre) ** 2).sum(axis=1).max()))


@dataclass(frozen=True)
class World:
    """What rays meet. Faces of a rock that lie lower than the trim count as ground."""

    bodies: dict[int, Body]
    rock_of_face: np.ndarray  # (f,) of the faces of `everything`
    ground: Caster
    standing: Caster  # all faces but those of `ground`, whose number follows
    ground_faces: int
    rocks: Caster  # of the faces in `standing` those that count as rock
    rock_of_rocks_face: np.ndarray  # rock of each face of `rocks`, and `NO_ROCK` at -1 for rays that meet none
    ground_level: float  # median height of the ground
    ground_bounds: np.ndarray  # (2, 2) lowest and highest x, y of the ground
    wall_height: float  # of the walls around the ground, metres; 0: there are none
    walls: Caster | None
    suns: Mapping[str, np.ndarray]  # azimuth -> (3,) position of the Sun lamp

    @property
    def everything(self) -> Joined:
        """Ground and rocks."""
        return Joined(self.ground, self.standing, self.ground_faces)

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
        """(n,) bool: another rock or a wall stands between the eye and points (n, 3) of a rock.

        What a rock hides of itself lies inside its own outline, so it does not matter here.
        """
        directions = points - eye
        hidden = self._passes_another(eye, directions, rock)
        passing = np.flatnonzero(hidden)
        distance, face = self.rocks.nearest(np.broadcast_to(eye, (len(passing), 3)), directions[passing])
        other = self.rock_of_rocks_face[face]
        hidden[passing] = (distance < 1) & (other != rock) & (other != NO_ROCK)
        if self.walls is None:
            return hidden
        return hidden | self.walls.occluded(np.broadcast_to(eye, points.shape), directions, 1.0)

    def _passes_another(self, eye: np.ndarray, directions: np.ndarray, rock: int) -> np.ndarray:
        """(n,) bool: the way along directions (n, 3) comes so near another rock that this one may be in it.

        Most rocks stand clear of each other, and a ball around each says so sooner than rays.
        """
        passes = np.zeros(len(directions), bool)
        if not len(directions):
            return passes
        squared = np.einsum("nk,nk->n", directions, directions)
        middle = directions.mean(axis=0)
        cone = _half_angle(middle, float(np.sqrt(((directions - middle) ** 2).sum(axis=1).max())))
        for other, body in self.bodies.items():
            towards, radius = body.centre - eye, body.radius + SURELY_CLEAR
            if other != rock and _angle(middle, towards) <= cone + _half_angle(towards, radius):
                # Farther off the line than the ball is wide: |d x c|^2 = |d|^2 |c|^2 - (d . c)^2 > |d|^2 r^2.
                passes |= (directions @ towards) ** 2 >= squared * (towards @ towards - radius**2)
        return passes


def _angle(one: np.ndarray, other: np.ndarray) -> float:
    """Between two directions (3,), radians."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def _half_angle(towards: np.ndarray, radius: float) -> float:
    """Of the cone from the origin around a ball at `towards` (3,), radians; pi from within the ball."""
    distance = float(np.linalg.norm(towards))
    return float(np.arcsin(radius / distance)) if radius < distance else np.pi


def build_worlds(
    terrain: TerrainMesh, localised: Mapping[str, LocalisedRig], suns: Mapping[str, np.ndarray], wall_height: float
) -> tuple[World, World]:
    """The terrain, and its bare ground for positions of unproven pose: their photos show rocks elsewhere.

    Without such positions the second is the first.
    """

    def built(terrain: TerrainMesh) -> World:
        return build_world(terrain, TRIM, suns, wall_height)

    world = built(terrain)
    return world, built(terrain.ground()) if any(rig.unproven for rig in localised.values()) else world


def build_world(
    terrain: TerrainMesh, trim: float, suns: Mapping[str, np.ndarray] = SUN_LAMPS, wall_height: float = 0.0
) -> World:
    """The terrain's meshes as bodies.

    Parameters
    ----------
    trim : float
        Rock surface lower than this above the ground counts as ground, metres.
    suns : azimuth -> (3,)
        Positions of the Sun lamps.
    wall_height
        Of the walls around the ground, metres; 0: none.
    """
    ground_count = int((terrain.rock_of_face == NO_ROCK).sum())
    ground_faces, standing_faces = np.split(terrain.faces, [ground_count])
    assert (terrain.rock_of_face[:ground_count] == NO_ROCK).all()
    ground = caster(terrain.vertices, ground_faces)
    is_of_ground = np.zeros(len(terrain.vertices), bool)
    is_of_ground[ground_faces] = True
    points = terrain.vertices[is_of_ground]
    level = float(np.median(points[:, 2]))
    bounds = np.stack([points[:, :2].min(axis=0), points[:, :2].max(axis=0)])
    rock_of_face = terrain.rock_of_face.copy()
    bodies: dict[int, Body] = {}
    for rock in terrain.rocks:
        own = np.flatnonzero(rock_of_face == rock)
        used, corner = np.unique(terrain.faces[own], return_inverse=True)
        vertices = terrain.vertices[used]
        height = _height_above(ground, level, vertices)
        low = min(trim, TRIM_SHARE * float(height.max()))
        bodies[rock] = Body(vertices, height > -CONTACT, height > low, meshed=True)
        rock_of_face[own[(height <= low)[corner.reshape(-1, 3)].all(axis=1)]] = NO_ROCK
    of_rock = rock_of_face != NO_ROCK
    return World(
        bodies,
        rock_of_face,
        ground,
        caster(terrain.vertices, standing_faces),
        ground_count,
        caster(terrain.vertices, terrain.faces[of_rock]),
        np.append(rock_of_face[of_rock], NO_ROCK),
        level,
        bounds,
        wall_height,
        wall_caster(bounds, level, wall_height),
        suns,
    )


def with_domes(world: World, domes: dict[int, Dome]) -> World:
    """The same world with stand-ins for rocks that have no mesh."""
    if not domes:
        return world
    bodies = dict(world.bodies)
    vertices, faces, rock_of_face = [], [], []
    count = 0
    for rock, dome in sorted(domes.items()):
        own, corners = dome.mesh()
        standing = np.ones(len(own), bool)
        bodies[rock] = Body(own, standing, standing, meshed=False)
        vertices.append(own)
        faces.append(corners + count)
        rock_of_face.append(np.full(len(corners), rock))
        count += len(own)
    added, rocks = caster(np.concatenate(vertices), np.concatenate(faces)), np.concatenate(rock_of_face)
    return replace(
        world,
        bodies=bodies,
        rock_of_face=np.append(world.rock_of_face, rocks),
        standing=Joined(world.standing, added, len(world.rock_of_face) - world.ground_faces),
        rocks=Joined(world.rocks, added, len(world.rock_of_rocks_face) - 1),
        rock_of_rocks_face=np.concatenate([world.rock_of_rocks_face[:-1], rocks, [NO_ROCK]]),
    )


def _height_above(ground: Caster, level: float, points: np.ndarray) -> np.ndarray:
    starts = np.concatenate([points[:, :2], np.full((len(points), 1), HIGH)], axis=1)
    distance = ground.nearest(starts, np.broadcast_to([0.0, 0.0, -1.0], starts.shape))[0]
    return points[:, 2] - np.where(np.isfinite(distance), HIGH - distance, level)


def wall_caster(bounds: np.ndarray, level: float, height: float) -> Caster | None:
    """The four walls around the ground (2, 2), `height` metres above its level; None for no walls."""
    if height <= 0:
        return None
    low, high = bounds
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    bottom = np.column_stack([corners, np.full(4, level - height)])
    top = np.column_stack([corners, np.full(4, level + height)])
    following = np.roll(np.arange(4), -1)
    faces = np.concatenate(
        [
            np.column_stack([np.arange(4), following, following + 4]),
            np.column_stack([np.arange(4), following + 4, np.arange(4) + 4]),
        ]
    )
    return caster(np.concatenate([bottom, top]), faces)
