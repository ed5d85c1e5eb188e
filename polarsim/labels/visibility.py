"""How much of a rock a Sun lamp lights, and which rocks lie in the dark: rays from their surface to the lamp."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from polarsim.labels.bodies import World
from polarsim.photo import Azimuth

POINTS = 150  # of a rock's surface, about, to which rays are cast
LIFT = 0.003  # metres from the surface towards the lamp: where a ray starts, clear of the rock's own faces
FARTHEST = np.diag([0.6, 0.6, 0.3])  # metres, x y z: twice the survey's standard deviations
OFFSETS = np.concatenate([np.zeros((1, 3)), FARTHEST, -FARTHEST])  # of a lamp about the surveyed one


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


def hidden_by_dark(world: World, rock: int, azimuth: Azimuth, annotated: Iterable[Azimuth]) -> bool:
    """A rock that people do not draw under a Sun lamp, for it is dark there.

    The survey localises lamps to decimetres only, and walls and slopes throw long shadows. A rock counts as dark if it
    is so wherever the lamp may have stood, and if it should not be dark as well at the azimuths where people drew it
    (`annotated`): there the meshes or the walls are not as they were.
    """
    return in_the_dark(world, rock, azimuth) and not any(in_the_dark(world, rock, other) for other in annotated)


def in_the_dark(world: World, rock: int, azimuth: Azimuth) -> bool:
    """No point of a rock's body above the ground is lit, wherever within the survey's error the lamp stands."""
    if rock not in world.bodies or azimuth not in world.suns:
        return False
    points = surface(world, rock)
    return all(shaded(world, points, world.suns[azimuth] + off).all() for off in OFFSETS)
