"""One camera in the sandbox, and what it sees of ground and rocks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from polarsim.formats.rigs import PlacedRig
from polarsim.geometry.boxes import centres, clip
from polarsim.geometry.lens import Lens
from polarsim.labels.world import World
from polarsim.photo import Camera

BORDER_PX = 2.0  # an edge this near to the photo's border is where the photo ends
SURE_VERTICES = 3  # fewer visible vertices than this are no rock
CENTRE_DEPTH = 0.3  # of a rock's width: how far the middle of what we see of it lies behind its foot


@dataclass(frozen=True)
class View:
    """A camera of a placed rig."""

    placed: PlacedRig
    camera: Camera

    @property
    def centre(self) -> np.ndarray:
        """(3,) in the sandbox."""
        return self.placed.sandbox_from(self.camera).translation

    @property
    def size(self) -> np.ndarray:
        """(2,) width and height of the photo, px."""
        lens = self.placed.rig.lens(self.camera)
        return np.array([lens.width, lens.height])

    @property
    def focal_px(self) -> float:
        return self.placed.rig.lens(self.camera).fx

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels (..., 2) of sandbox points (..., 3); NaN behind the camera."""
        return self.placed.project(self.camera, points)

    def directions(self, pixels: np.ndarray) -> np.ndarray:
        """Sandbox directions (..., 3) through pixels (..., 2), of unit depth along the optical axis."""
        directions = self.placed.rig.lens(self.camera).directions(pixels)
        return self.placed.sandbox_from(self.camera).rotate(directions)

    def grid_directions(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """(rows, columns, 3) `directions` through a grid of pixels."""
        grid = (np.ascontiguousarray(side, float).tobytes() for side in (rows, columns))
        return self.placed.sandbox_from(self.camera).rotate(_grid_directions(self.placed.rig.lens(self.camera), *grid))

    def ground_depth(self, world: World, pixels: np.ndarray) -> np.ndarray:
        """(n,) depth in metres at which the rays through pixels (n, 2) meet the ground; inf above the horizon."""
        return world.ground_distance(self.centre, self.directions(pixels))

    def inside(self, pixels: np.ndarray) -> np.ndarray:
        """(n,) bool: pixels (n, 2) of the photo; NaN is outside."""
        with np.errstate(invalid="ignore"):
            return np.all((pixels > 0) & (pixels < self.size), axis=-1)


@lru_cache(maxsize=2)  # both cameras of a rig: all its places have the same lenses
def _grid_directions(lens: Lens, rows: bytes, columns: bytes) -> np.ndarray:
    """In the camera's frame; rows and columns are the bytes of float arrays, for arrays are no keys."""
    return lens.directions(np.stack(np.meshgrid(np.frombuffer(columns), np.frombuffer(rows)), axis=-1))


@dataclass(frozen=True)
class ProjectedRock:
    """A rock in a view: its box (4,) cut at the border, and its share that no other rock hides and no border cuts."""

    box: np.ndarray
    seen: float


def project_rock(world: World, view: View, rock: int) -> ProjectedRock | None:
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


def move_rocks(world: World, source: View, target: View, boxes: np.ndarray, rocks: np.ndarray) -> np.ndarray:
    """Boxes (n, 4) of rocks (n,) as the rig's other camera sees them: shifted, sizes kept (they differ by 1 %).

    The shift is that of the rock's mesh, mean over its vertices; of a rock without mesh, that of the point on the ray
    through its centre that lies `CENTRE_DEPTH` widths behind its foot.
    """
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    foot = np.stack([(boxes[:, 0] + boxes[:, 2]) / 2, boxes[:, 3]], axis=-1)
    width = (boxes[:, 2] - boxes[:, 0]) / source.focal_px  # as a share of the depth
    depth = source.ground_depth(world, foot) * (1 + CENTRE_DEPTH * width)
    shift = _shift_at_depth(source, target, centres(boxes), depth)
    for row, rock in enumerate(rocks):
        body = world.bodies.get(int(rock))
        if body is not None and body.meshed:
            vertices = body.vertices[body.above]
            moved = target.project(vertices) - source.project(vertices)
            if np.isfinite(moved).all():
                shift[row] = moved.mean(axis=0)
    return boxes + np.tile(shift, 2)


def move_flat(world: World, source: View, target: View, boxes: np.ndarray) -> np.ndarray:
    """Boxes (n, 4) of flat things as the rig's other camera sees them: moved like the ground at their centres."""
    boxes = np.asarray(boxes, float).reshape(-1, 4)
    middle = centres(boxes)
    return boxes + np.tile(_shift_at_depth(source, target, middle, source.ground_depth(world, middle)), 2)


def _shift_at_depth(source: View, target: View, pixels: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(n, 2) how far pixels (n, 2) of known depth (n,) move between two cameras; inf depth: the far plane of 100 m."""
    points = source.centre + np.minimum(depth, 100.0)[:, None] * source.directions(pixels)
    return target.project(points) - pixels
