"""How much of a rock a lamp lights: rays from its surface to the lamp."""

from __future__ import annotations

import numpy as np

from polarsim.labels.world import World
from polarsim.photo import Azimuth

POINTS = 150  # of a rock's surface, about, to which rays are cast
LIFT = 0.003  # metres from the surface towards the lamp: where a ray starts, clear of the rock's own faces


def lit_share(world: World, rock: int, azimuth: Azimuth) -> float:
    """Share of a rock's body above the ground that a Sun lamp reaches; 1 without body or lamp."""
    body = world.bodies.get(rock)
    if body is None or azimuth not in world.suns:
        return 1.0
    points = surface(world, rock)
    return float((~shaded(world, points, world.suns[azimuth])).mean()) if len(points) else 0.0


def surface(world: World, rock: int) -> np.ndarray:
    """(n, 3) of a body's surface above the ground, about `POINTS`."""
    body = world.bodies[rock]
    points = body.vertices[body.above]
    return points[:: max(1, len(points) // POINTS)]


def shaded(world: World, points: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """(n,) bool: ground, a rock or a wall stands between points (n, 3) and a lamp (3,)."""
    to_lamp = lamp - points
    starts = points + LIFT * to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    dark = world.everything.occluded(starts, to_lamp, 1.0)
    if world.walls is not None and not dark.all():
        dark |= world.walls.occluded(starts, to_lamp, 1.0)
    return np.asarray(dark)
