"""Projection: the box of a rock's mesh in a camera, a box moved to the other camera of the rig, and rays of pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from polarsim.geometry.boxes import centres, clip
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.labels.bodies import World

BORDER_PX = 2.0  # an edge this near to the photo's border is where the photo ends
SURE_VERTICES = 3  # fewer visible vertices than this are no rock
CENTRE_DEPTH = 0.3  # of a rock's width: how far the centre of what we see of it lies behind its foot


@dataclass(frozen=True)
class ProjectedRock:
    """A rock in a view: its box (4,) cut at the border, and its share that no other rock hides and no border cuts."""

    box: np.ndarray
    seen: float


def project_rock(world: World, view: Camera, rock: int) -> ProjectedRock | None:
    """The box that a person would draw around a rock's mesh; None where the view does not show it.

    Left and right edges come from the trimmed surface, top and bottom from all that is above the ground: skirts of
    sand widen meshes and hardly heighten them.
    """
    body = world.bodies[rock]
    standing = np.flatnonzero(body.trimmed | body.above)
    pixels = view.project(body.vertices[standing])
    shown = view.inside(pixels)
    shown[shown] = ~world.hidden(view.centre, body.vertices[standing[shown]], rock)
    sides, ends = shown & body.trimmed[standing], shown & body.above[standing]
    if sides.sum() < SURE_VERTICES or ends.sum() < SURE_VERTICES:
        return None
    box = np.array(
        [pixels[sides, 0].min(), pixels[ends, 1].min(), pixels[sides, 0].max(), pixels[ends, 1].max()], float
    )
    return ProjectedRock(clip(box, *view.size), float(sides.sum() / body.trimmed.sum()))


def at_border(boxes: np.ndarray, size: np.ndarray) -> np.ndarray:
    """(n, 4) bool: edges of boxes (n, 4) at the border of a photo (width, height), where things go on unseen."""
    return np.concatenate([boxes[:, :2] <= BORDER_PX, boxes[:, 2:] >= size - BORDER_PX], axis=1)


def move_rocks(world: World, source: Camera, target: Camera, boxes: np.ndarray, rocks: np.ndarray) -> np.ndarray:
    """Boxes (n, 4) of rocks (n,) as the rig's other camera sees them: moved, sizes kept (they differ by 1 %).

    The offset is that of the rock's mesh, mean over its vertices; of a rock without mesh, that of the point on the ray
    through its centre that lies `CENTRE_DEPTH` widths behind its foot.
    """
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    foot = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=-1)
    width = (boxes[:, 2] - boxes[:, 0]) / source.lens.fx  # as a share of the depth
    depth = ground_depth(world, source, foot) * (1 + CENTRE_DEPTH * width)
    offset = _offset_at_depth(source, target, centres(boxes), depth)
    for row, rock in enumerate(rocks):
        body = world.bodies.get(int(rock))
        if body is not None and body.meshed:
            vertices = body.vertices[body.above]
            moved = target.project(vertices) - source.project(vertices)
            if np.isfinite(moved).all():
                offset[row] = moved.mean(axis=0)
    return boxes + np.tile(offset, 2)


def ground_depth(world: World, view: Camera, pixels: np.ndarray) -> np.ndarray:
    """(n,) depth in metres at which the rays through pixels (n, 2) meet the ground; inf above the horizon."""
    return world.ground_distance(view.centre, view.directions(pixels))


def move_flat(world: World, source: Camera, target: Camera, boxes: np.ndarray) -> np.ndarray:
    """Boxes (n, 4) of flat things as the rig's other camera sees them: moved like the ground at their centres."""
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    centre = centres(boxes)
    return boxes + np.tile(_offset_at_depth(source, target, centre, ground_depth(world, source, centre)), 2)


def _offset_at_depth(source: Camera, target: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(n, 2) how far pixels (n, 2) of known depth (n,) move between two cameras; inf depth: the far plane of 100 m."""
    points = source.centre + np.minimum(depth, 100.0)[:, None] * source.directions(pixels)
    return target.project(points) - pixels


@dataclass(frozen=True)
class Sightlines:
    """Rays (n,) through a grid of a view's pixels, row by row, and what they meet first; distances by their length."""

    directions: np.ndarray  # (n, 3)
    distance: np.ndarray  # to ground or rocks; inf for neither
    face: np.ndarray  # of the world's `everything`
    ground: np.ndarray  # distance to the ground, whatever stands before it; inf for none
    wall: np.ndarray  # distance to a wall of the sandbox, which the near one hides things with; inf where it hides none

    @property
    def hit(self) -> np.ndarray:
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
        hit = np.flatnonzero(np.isfinite(distance))
        wall[hit] = world.walls.nearest(origins[hit], directions[hit])[0]
    return Sightlines(directions, distance, face, ground, wall)


@lru_cache(maxsize=2)  # both cameras of a rig: all its positions have the same lenses
def _grid_directions(lens: Lens, rows: bytes, columns: bytes) -> np.ndarray:
    """In the camera's frame; rows and columns are the bytes of float arrays, for arrays are no keys."""
    return lens.directions(np.stack(np.meshgrid(np.frombuffer(columns), np.frombuffer(rows)), axis=-1))
