"""Projected boxes of rock meshes, boxes moved between the two cameras of the rig, and rays through pixels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from polarsim.geometry.boxes import box_centres, clip
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.labels.bodies import TerrainCasters
from polarsim.photo import photo_scale

BORDER_PX = 2.0  # maximum distance to the image border of an edge that is cut by the border
MIN_VERTICES = 3  # minimum number of visible vertices of a rock
CENTRE_DEPTH = 0.3  # depth of the centre of the visible surface behind the foot of a rock, relative to its width


@dataclass(frozen=True)
class ProjectedRock:
    """Box (4,) of a rock clipped at the image border, and share of its surface that is unoccluded and in the image."""

    box: np.ndarray
    visible_share: float


def project_rock(world: TerrainCasters, view: Camera, rock: int) -> ProjectedRock | None:
    """Return the bounding box of the visible part of a rock; None if the view does not show the rock.

    Left and right edges are computed from the trimmed surface, top and bottom from the surface above the ground,
    because skirts of sand widen meshes and barely raise them.
    """
    body = world.bodies[rock]
    standing = np.flatnonzero(body.trimmed | body.above)
    pixels = view.project(body.vertices[standing])
    in_view = view.inside(pixels)
    in_view[in_view] = ~world.hidden(view.centre, body.vertices[standing[in_view]], rock)
    sides, ends = in_view & body.trimmed[standing], in_view & body.above[standing]
    if sides.sum() < MIN_VERTICES or ends.sum() < MIN_VERTICES:
        return None
    box = np.array(
        [pixels[sides, 0].min(), pixels[ends, 1].min(), pixels[sides, 0].max(), pixels[ends, 1].max()], float
    )
    return ProjectedRock(clip(box, *view.size), float(sides.sum() / body.trimmed.sum()))


def at_border(boxes: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return a mask (n, 4) of edges of boxes (n, 4) at the border of a photo (width, height)."""
    border = BORDER_PX * photo_scale(int(size[0]))
    return np.concatenate([boxes[:, :2] <= border, boxes[:, 2:] >= size - border], axis=1)


def move_rocks(
    world: TerrainCasters, source: Camera, target: Camera, boxes: np.ndarray, rocks: np.ndarray
) -> np.ndarray:
    """Return boxes (n, 4) of rocks (n,) shifted to the image of the other camera; sizes are kept (they differ by 1 %).

    The shift is the mean shift of the mesh vertices. For a rock without a mesh, it is the shift of the point on the ray
    through the centre of the box, `CENTRE_DEPTH` widths behind the foot.
    """
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    foot = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=-1)
    width = (boxes[:, 2] - boxes[:, 0]) / source.lens.fx  # relative to the depth
    depth = ground_depth(world, source, foot) * (1 + CENTRE_DEPTH * width)
    offset = _offset_at_depth(source, target, box_centres(boxes), depth)
    for row, rock in enumerate(rocks):
        body = world.bodies.get(int(rock))
        if body is not None and body.meshed:
            vertices = body.vertices[body.above]
            moved = target.project(vertices) - source.project(vertices)
            if np.isfinite(moved).all():
                offset[row] = moved.mean(axis=0)
    return boxes + np.tile(offset, 2)


def ground_depth(world: TerrainCasters, view: Camera, pixels: np.ndarray) -> np.ndarray:
    """Return the depth (n,) of the ground at pixels (n, 2), metres; inf above the horizon."""
    return world.ground_distance(view.centre, view.directions(pixels))


def move_flat(world: TerrainCasters, source: Camera, target: Camera, boxes: np.ndarray) -> np.ndarray:
    """Return boxes (n, 4) of flat objects shifted to the image of the other camera like the ground at their centres."""
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    centre = box_centres(boxes)
    return boxes + np.tile(_offset_at_depth(source, target, centre, ground_depth(world, source, centre)), 2)


def _offset_at_depth(source: Camera, target: Camera, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """Return the shift (n, 2) between two cameras of pixels (n, 2) with depth (n,), metres, clipped to 100 m."""
    points = source.centre + np.minimum(depth, 100.0)[:, None] * source.directions(pixels)
    return target.project(points) - pixels


@dataclass(frozen=True)
class Sightlines:
    """Rays (n,) through a grid of pixels, row by row, with first hits; distances in units of the direction length."""

    directions: np.ndarray  # (n, 3)
    distance: np.ndarray  # to ground or rocks; inf without a hit
    face: np.ndarray  # hit face of `TerrainCasters.everything`
    ground: np.ndarray  # distance to the ground, ignoring rocks; inf without a hit
    wall: np.ndarray  # distance to a wall of the sandbox that occludes the hit; inf without an occluding wall

    @property
    def hit(self) -> np.ndarray:
        """Mask (n,) of rays that hit ground or rock."""
        return np.asarray(np.isfinite(self.distance) & (self.distance < self.wall))


def sightlines(world: TerrainCasters, view: Camera, rows: np.ndarray, columns: np.ndarray) -> Sightlines:
    """Cast a ray through every pixel (row, column)."""
    grid = (np.ascontiguousarray(side, float).tobytes() for side in (rows, columns))
    directions = view.world_from_camera.rotate(_grid_directions(view.lens, *grid)).reshape(-1, 3)
    origins = np.broadcast_to(view.centre, directions.shape)
    ground, ground_face = world.ground.nearest(origins, directions)
    distance, face = world.everything.nearer(ground, ground_face, origins, directions)
    wall = np.full(len(directions), np.inf)
    if world.walls is not None:
        hit = np.flatnonzero(np.isfinite(distance))
        wall[hit] = world.walls.nearest(origins[: len(hit)], directions.take(hit, axis=0))[0]
    return Sightlines(directions, distance, face, ground, wall)


@lru_cache(maxsize=2)  # both cameras of a rig: all its positions have the same lenses
def _grid_directions(lens: Lens, rows: bytes, columns: bytes) -> np.ndarray:
    """Return ray directions in the camera frame. Rows and columns are bytes of float arrays, which are hashable."""
    return lens.directions(np.stack(np.meshgrid(np.frombuffer(columns), np.frombuffer(rows)), axis=-1))
