"""Rocks in the dark: no light of a Sun lamp reaches them, so people who label what they see leave them out.

The survey places lamps to decimetres only, and walls and slopes throw long shadows. A rock counts as dark if it is so
wherever the lamp may have stood, and if people drew none of its boxes in what should be dark as well: where they did,
the meshes or the walls are not as they were.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from polarsim.labels.lit import shaded, surface
from polarsim.labels.world import World
from polarsim.photo import Azimuth

FARTHEST = np.diag([0.6, 0.6, 0.3])  # metres, x y z: twice the survey's standard deviations
PLACES = np.concatenate([np.zeros((1, 3)), FARTHEST, -FARTHEST])  # of a lamp about the surveyed one


def hidden_by_dark(world: World, rock: int, azimuth: Azimuth, annotated: Iterable[Azimuth]) -> bool:
    """A rock that people do not draw under a Sun lamp, for it is dark there; `annotated`: azimuths where they drew
    it.
    """
    return in_the_dark(world, rock, azimuth) and not any(in_the_dark(world, rock, other) for other in annotated)


def in_the_dark(world: World, rock: int, azimuth: Azimuth) -> bool:
    """No point of a rock's body above the ground is lit, wherever within the survey's error the lamp stands."""
    if rock not in world.bodies or azimuth not in world.suns:
        return False
    points = surface(world, rock)
    return all(shaded(world, points, world.suns[azimuth] + off).all() for off in PLACES)
