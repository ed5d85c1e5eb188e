"""Shadows that rocks cast on the ground under a near lamp, as a view shows them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from polarsim.formats.rigs import PlacedRig
from polarsim.geometry.boxes import of_mask
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.polygons import without_thin_parts
from polarsim.labels.parts import Window, without_small_components
from polarsim.labels.wall_shade import passing_heights
from polarsim.labels.world import World
from polarsim.photo import NO_ROCK, Azimuth, Light

THIN_PX = 4.0  # parts of a shadow thinner than this do not widen its box: rims under rocks, where meshes meet the sand
ROCK_ELLIPSE = 0.8  # of a rock's label box: the ellipse in which people see rock, never shadow


def lamp(world: World, placed: PlacedRig, light: Light, azimuth: Azimuth) -> np.ndarray | None:
    """(3,) place of the lamp that casts the shadows, sandbox frame; None in the dark.

    A Sun lamp outshines the rover light.
    """
    if azimuth != "no":
        return world.suns[azimuth]
    if light == "on":
        return placed.rover_light
    return None


@dataclass(frozen=True)
class Sightlines:
    """Rays (n,) through a grid of a view's pixels, row by row, and what they meet first; distances by their length."""

    directions: np.ndarray  # (n, 3)
    distance: np.ndarray  # to ground or rocks; inf for neither
    face: np.ndarray  # of the world's `everything`
    ground: np.ndarray  # distance to the ground, whatever stands before it; inf for none
    wall: np.ndarray  # distance to a wall of the sandbox, which the near one hides things with; inf where it hides none

    @property
    def met(self) -> np.ndarray:
        """(n,) bool: ground or rock is seen."""
        return np.asarray(np.isfinite(self.distance) & (self.distance < self.wall))


def sightlines(world: World, view: Camera, rows: np.ndarray, columns: np.ndarray) -> Sightlines:
    """Cast a ray through every pixel (row, column)."""
    grid = (np.ascontiguousarray(side, float).tobytes() for side in (rows, columns))
    directions = view.world_from_camera.rotate(_grid_directions(view.lens, *grid)).reshape(-1, 3)
    origins = np.broadcast_to(view.centre, directions.shape)
    ground, ground_face = world.ground.nearest(origins, directions)
    distance, face = world.everything.nearer(ground, ground_face, origins, directions)
    wall = np.full(len(directions), np.inf)
    if world.walls is not None:
        met = np.flatnonzero(np.isfinite(distance))
        wall[met] = world.walls.nearest(origins[met], directions[met])[0]
    return Sightlines(directions, distance, face, ground, wall)


@lru_cache(maxsize=2)  # both cameras of a rig: all its places have the same lenses
def _grid_directions(lens: Lens, rows: bytes, columns: bytes) -> np.ndarray:
    """In the camera's frame; rows and columns are the bytes of float arrays, for arrays are no keys."""
    return lens.directions(np.stack(np.meshgrid(np.frombuffer(columns), np.frombuffer(rows)), axis=-1))


class Ids:
    """What a view sees at a grid of pixels (rows, columns): the rock there, and the ground there or behind the rock.

    The near wall of the sandbox hides both.
    """

    def __init__(self, world: World, view: Camera, rows: np.ndarray, columns: np.ndarray) -> None:
        seen = sightlines(world, view, rows, columns)
        self.shape = (len(rows), len(columns))
        self.hit = seen.met.reshape(self.shape)
        self.rock = np.where(self.hit, world.rock_of_face[seen.face].reshape(self.shape), NO_ROCK)
        on_ground = np.isfinite(seen.ground) & (seen.ground < seen.wall)
        self.ground = on_ground.reshape(self.shape)
        # (n, 3), row by row
        self.places = view.centre + seen.ground[on_ground, None] * seen.directions[on_ground]

    def shadow_of(self, world: World, lamp_place: np.ndarray) -> np.ndarray:
        """(rows, columns) rock that takes the lamp's light from the ground at each pixel; `NO_ROCK` elsewhere.

        Other rocks hide a rock's shadow, its own mesh does not: where the rock ends is for its label to say, since
        meshes may be wider than their rocks (skirts, back sides that no scan saw).
        """
        distance, face = world.rocks.nearest(self.places, lamp_place - self.places)
        occluded = distance < 1
        rock = np.full(len(self.places), NO_ROCK)
        rock[occluded] = world.rock_of_rocks_face[face[occluded]]
        shadow = np.full(self.shape, NO_ROCK)
        shadow[self.ground] = rock
        shadow[(self.rock != NO_ROCK) & (self.rock != shadow)] = NO_ROCK
        return shadow

    def over_walls(self, world: World, lamp_place: np.ndarray) -> np.ndarray:
        """(rows, columns) metres above the sand at which a lamp's light passes the walls on its way to the ground.

        Infinite where nothing is in its way, and where no ground is seen.
        """
        heights = np.full(self.shape, np.inf)
        passing = passing_heights(self.places, lamp_place, world.ground_bounds)
        heights[self.ground] = passing - world.ground_level
        return heights


def shadow_box(
    shadow: np.ndarray, rock: int, rock_box: np.ndarray | None, step: int, windows: Mapping[int, Window]
) -> np.ndarray | None:
    """(4,) box around the visible shadow of a rock, px; None where too little of it is seen.

    Parameters
    ----------
    shadow : (rows, columns) int
        Rock whose shadow is seen at every `step`-th pixel.
    rock_box : (4,) float or None
        The rock's label in the same photo. People see rock in it, so that a shadow starts where the rock ends.
    windows
        The picture's, from `windows_of`.
    """
    if rock not in windows:
        return None
    mask = shadow[windows[rock]] == rock
    (top, bottom), (left, right) = ((side.start, side.stop) for side in windows[rock])
    if rock_box is not None:
        x, y = (np.arange(left, right) + 0.5) * step, (np.arange(top, bottom) + 0.5) * step
        half = np.maximum(rock_box[2:] - rock_box[:2], 1.0) / 2 * ROCK_ELLIPSE
        centre = (rock_box[2:] + rock_box[:2]) / 2
        mask = mask & ((((y - centre[1]) / half[1]) ** 2)[:, None] + ((x - centre[0]) / half[0]) ** 2 > 1)
    core = without_thin_parts(mask, round(THIN_PX / step))
    box = of_mask(without_small_components(core, connectivity=8))
    return None if box is None else (box + np.tile([left, top], 2)) * step
