"""Where a view shows the sandbox's ground, and where what lies around it."""

from __future__ import annotations

import numpy as np

from polarsim.geometry.rays import Caster, caster
from polarsim.labels.shadows import Ids
from polarsim.labels.shapes import Shape
from polarsim.labels.view import View
from polarsim.labels.world import World

SMALL_REGION = 400  # px: smaller pieces of ground or background are not worth a polygon
THIN_PX = 2  # neither are pieces that are narrower


def backdrop(
    world: World, view: View, ids: Ids, wall_height: float, simplify_px: float
) -> list[tuple[str, np.ndarray]]:
    """Rings (n, 2) of background and of ground, which goes on below rocks and shadows."""
    import cv2

    ground = np.zeros(ids.shape, np.uint8)
    seen = _wall_free(world, view, ids, wall_height).astype(np.uint8)
    lines, _ = cv2.findContours(seen, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(ground, [line for line in lines if cv2.contourArea(line) >= SMALL_REGION], -1, 1, cv2.FILLED)
    rings = [
        (name, ring)
        for name, mask in (("background", ground == 0), ("ground", ground == 1))
        for ring in Shape(mask, 0, 0).rings(simplify_px)
    ]
    return [(name, ring) for name, ring in rings if np.ptp(ring, axis=0).min() >= THIN_PX]


def _wall_free(world: World, view: View, ids: Ids, wall_height: float) -> np.ndarray:
    """(h, w) bool: pixels that show ground or rocks, and no wall of the sandbox in front of them."""
    seen = ids.hit.copy()
    walls = wall_caster(world, wall_height)
    if walls is None:
        return seen
    directions = ids.places - view.centre
    seen[ids.ground] &= ~walls.blocked(np.broadcast_to(view.centre, directions.shape), directions, 1.0)
    return seen


def wall_caster(world: World, height: float) -> Caster | None:
    """The four walls around the ground mesh, `height` metres above the ground's level; None for no walls."""
    if height <= 0:
        return None
    low, high = world.ground_bounds
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    bottom = np.column_stack([corners, np.full(4, world.ground_level - height)])
    top = np.column_stack([corners, np.full(4, world.ground_level + height)])
    following = np.roll(np.arange(4), -1)
    faces = np.concatenate(
        [
            np.column_stack([np.arange(4), following, following + 4]),
            np.column_stack([np.arange(4), following + 4, np.arange(4) + 4]),
        ]
    )
    return caster(np.concatenate([bottom, top]), faces)
