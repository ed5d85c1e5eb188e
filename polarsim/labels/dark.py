"""Rocks in the dark: no light of a Sun lamp reaches them, so people who label what they see leave them out.

The survey places lamps to decimetres only, and walls and slopes throw long shadows. A rock counts as dark if it is so
wherever the lamp may have stood, and if people drew none of its boxes in what should be dark as well: where they did,
the meshes or the walls are not as they were.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from polarsim.labels.world import World
from polarsim.photo import Azimuth

FARTHEST = np.diag([0.6, 0.6, 0.3])  # metres, x y z: twice the survey's standard deviations
PLACES = np.concatenate([np.zeros((1, 3)), FARTHEST, -FARTHEST])  # of a lamp about the surveyed one
POINTS = 150  # of a rock's surface, about, to which rays are cast
LIFT = 0.003  # metres from the surface towards the lamp: where a ray starts, clear of the rock's own faces


def hidden_by_dark(world: World, rock: int, azimuth: Azimuth, drawn: Iterable[Azimuth]) -> bool:
    """A rock that people do not draw under a Sun lamp, for it is dark there; `drawn`: azimuths where they drew it."""
    return in_the_dark(world, rock, azimuth) and not any(in_the_dark(world, rock, other) for other in drawn)


def in_the_dark(world: World, rock: int, azimuth: Azimuth) -> bool:
    """No point of a rock's body above the ground is lit, wherever within the survey's error the lamp stands."""
    body = world.bodies.get(rock)
    if body is None or azimuth not in world.suns:
        return False
    points = body.vertices[body.above]
    points = points[:: max(1, len(points) // POINTS)]
    return not any(_lit(world, points, world.suns[azimuth] + off) for off in PLACES)


def _lit(world: World, points: np.ndarray, lamp: np.ndarray) -> bool:
    to_lamp = lamp - points
    starts = points + LIFT * to_lamp / np.linalg.norm(to_lamp, axis=1, keepdims=True)
    dark = world.everything.blocked(starts, to_lamp, 1.0)
    if world.walls is not None and not dark.all():
        dark |= world.walls.blocked(starts, to_lamp, 1.0)
    return not dark.all()
