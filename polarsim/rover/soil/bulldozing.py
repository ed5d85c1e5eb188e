"""Soil that a wheel displaces piles up beside and before it, and slides where it is too steep: the reference.

The rule of volume: of what is pressed down, a share moves aside and the rest compacts; sliding keeps volume. Chrono
puts displaced soil on the one ring of nodes around a patch and slides at 55 degrees, which leaves a saw of single nodes
along ruts; here it is spread over a few centimetres and slides at the angle at which loose sand rests.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from polarsim.rover.soil.nodes import FLOW, FREE, LEVEL, ORIGINAL, ROCK, START, Ground
from polarsim.rover.soil.shapes import Bodies, half_extent, intersect

TAPS = 5.0  # the spread is followed so many times as far as it is wide
MOVED = 0.2  # of the excess height between two neighbours in one sweep; 0.25 is where sweeps start to swing
SQRT2 = math.sqrt(2.0)
DISTURBED = 1e-5  # m: ground that no wheel changed does not slide


@dataclass(frozen=True)
class Bulldozing:
    """Where displaced soil goes."""

    share: float = 0.5  # of the pressed volume that moves aside; the rest compacts
    spread: float = 0.03  # m, standard deviation of the distance that soil is pushed
    headroom: float = 0.02  # m: no soil goes where a wheel is nearer to the ground
    angle_deg: float = 36.0  # degrees, steeper soil slides
    sweeps: int = 3
    every: int = 10  # steps of the contact


def taps(rule: Bulldozing, cell: float) -> np.ndarray:
    """(2 r + 1,) weights of the spread along one axis."""
    reach = max(math.ceil(TAPS * rule.spread / cell), 1)
    return np.exp(-0.5 * (np.arange(-reach, reach + 1) * cell / rule.spread) ** 2)


def bulldoze(ground: Ground, bodies: Bodies, rule: Bulldozing) -> None:
    """Move aside what the bodies pressed since the last call, then let it slide around them."""
    weights = taps(rule, ground.cell)
    climb = ground.cell * math.tan(math.radians(rule.angle_deg))
    for body in range(len(bodies.numbers)):
        inner = ground.window(bodies.centres[body], half_extent(bodies.numbers[body], bodies.rotations[body]))
        pressed = _sources(ground, inner)
        if pressed is None:
            continue
        outer = _wider(ground, pressed, len(weights) // 2)
        _push(ground, bodies, body, outer, weights, rule)
        for _ in range(rule.sweeps):
            slide(ground, outer, climb)


def settle(ground: Ground, angle_deg: float = 36.0, sweeps: int = 200, still_m: float = DISTURBED) -> None:
    """Let disturbed ground everywhere slide until it rests, for pictures: a wheel's own sweeps stop half-way.

    It rests when no sweep moves a level by more than `still_m`: a long slope creeps on at a rate far below its excess.
    Soil slides across corners too, so no slope in any of eight directions stays steeper; between them the gradient is
    up to 1 / cos(22.5 degrees) of the tangent.
    """
    everywhere = slice(0, ground.owner.shape[0]), slice(0, ground.owner.shape[1])
    for _ in range(sweeps):
        if slide(ground, everywhere, ground.cell * math.tan(math.radians(angle_deg)), corners=True) <= still_m:
            return


def slide(ground: Ground, part: tuple[slice, slice], climb: float, corners: bool = False) -> float:
    """One sweep over a part of the grid: neighbours whose levels differ by more than `climb` exchange soil.

    With `corners` nodes across a corner are neighbours too, sqrt(2) as far away. Returns the largest change of a level,
    m.
    """
    state, owner = ground.state[part], ground.owner[part]
    level = state[..., LEVEL]
    disturbed = np.abs(level - state[..., ORIGINAL]) > DISTURBED
    free = owner == FREE
    change = np.zeros_like(level)
    every, but_last, but_first = slice(None), slice(None, -1), slice(1, None)
    pairs = [
        ((every, but_last), (every, but_first), climb, MOVED),
        ((but_last, every), (but_first, every), climb, MOVED),
    ]
    if corners:
        pairs += [
            ((but_last, but_last), (but_first, but_first), SQRT2 * climb, MOVED / 2),
            ((but_last, but_first), (but_first, but_last), SQRT2 * climb, MOVED / 2),
        ]
    for one, two, rests, share in pairs:
        step = level[two] - level[one]
        may = free[one] & free[two] & (disturbed[one] | disturbed[two])
        moved = np.where(may, share * np.sign(step) * np.maximum(np.abs(step) - rests, 0.0), 0.0)
        change[one] += moved
        change[two] -= moved
    state[..., LEVEL] += change
    state[..., START] += change
    return float(np.abs(change).max())


def _push(
    ground: Ground, bodies: Bodies, body: int, part: tuple[slice, slice], weights: np.ndarray, rule: Bulldozing
) -> None:
    state, owner, normals = ground.state[part], ground.owner[part], ground.normals[part]
    pressed = np.where(owner == ROCK, 0.0, state[..., FLOW] / normals[..., 2])
    y, x = np.meshgrid(ground.y[part[0]], ground.x[part[1]], indexing="ij")
    hits = intersect(
        bodies.numbers[body], bodies.centres[body], bodies.rotations[body], x.ravel(), y.ravel(), ground.cell
    )
    surface = hits.level.reshape(owner.shape)
    below = hits.hit.reshape(owner.shape) & (surface - state[..., LEVEL] < rule.headroom)
    room = ((owner == FREE) & ~below).astype(float)
    reached = _blur(room, weights)
    sends = (pressed > 0) & (reached > 0)  # soil without room waits
    sent = np.where(sends, rule.share * pressed / np.where(sends, reached, 1.0), 0.0)
    gained = room * _blur(sent, weights)
    state[..., LEVEL] += gained
    state[..., START] += gained
    state[sends, FLOW] = 0


def _blur(field: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Sum over neighbours along columns, then along rows; nothing lies outside."""
    reach = len(weights) // 2
    for axis in (1, 0):
        padded = np.pad(field, [(reach, reach) if axis == k else (0, 0) for k in (0, 1)])
        length = field.shape[axis]
        field = sum(
            weight * np.take(padded, np.arange(at, at + length), axis=axis) for at, weight in enumerate(weights)
        )
    return field


def _sources(ground: Ground, part: tuple[slice, slice]) -> tuple[slice, slice] | None:
    """Bounds of the nodes of a window that were pressed."""
    rows, columns = np.nonzero((ground.state[part][..., FLOW] > 0) & (ground.owner[part] != ROCK))
    if not len(rows):
        return None
    top, left = part[0].start, part[1].start
    return (
        slice(top + int(rows.min()), top + int(rows.max()) + 1),
        slice(left + int(columns.min()), left + int(columns.max()) + 1),
    )


def _wider(ground: Ground, part: tuple[slice, slice], by: int) -> tuple[slice, slice]:
    rows, columns = (
        slice(max(side.start - by, 0), min(side.stop + by, count))
        for side, count in zip(part, ground.owner.shape, strict=True)
    )
    return rows, columns
