"""Displaced soil piles up at the sides and in front of a wheel, and slides where the slope is too steep; compiled.

A share of the pressed volume moves aside and the rest compacts; sliding keeps volume. Chrono puts displaced soil on the
single ring of nodes around a patch and slides at 55 degrees, which produces a sawtooth of single nodes along ruts.
Here, soil is spread over a few centimetres and slides at the angle of repose of loose sand. The NumPy reference is
`tests/reference/soil.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.nodes import FLOW, FREE, LEVEL, ORIGINAL, ROCK, START, SoilGround
from polarsim.rover.soil.shapes import HALF_WIDTH, RADIUS, lowest_wheel_point, wheel_window

SHARE = 0.5  # share of the pressed volume that moves aside; the rest compacts
SPREAD = 0.03  # m, standard deviation of the distance that soil is pushed
HEADROOM = 0.02  # m; no soil moves to nodes with less clearance below a wheel
ANGLE_DEG = 36.0  # steeper soil slides
SWEEPS = 3
TAPS = 5.0  # truncation of the spread, in standard deviations
MOVED = 0.2  # share of the excess height between adjacent nodes moved in a sweep; sweeps oscillate from 0.25 on
SQRT2 = math.sqrt(2.0)
DISTURBED = 1e-5  # m; ground with a smaller change does not slide
EVERY_S = 0.01  # time between moves of displaced soil in a drive


class Bulldozing(NamedTuple):
    """Rules for displaced soil on a grid, for the kernels."""

    weights: np.ndarray  # (2 r + 1,) weights of the spread along an axis
    climb: float  # m between adjacent nodes; soil slides above this difference
    every: int  # steps of the contact between moves
    share: float

    @classmethod
    def on(cls, cell: float, every: int = 10, share: float = SHARE) -> Bulldozing:
        """Return the rules for a grid with cells of this side, m."""
        reach = max(math.ceil(TAPS * SPREAD / cell), 1)
        weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * cell / SPREAD) ** 2)
        return cls(weights, cell * math.tan(math.radians(ANGLE_DEG)), every, share)


def settle(ground: SoilGround, angle_deg: float = ANGLE_DEG, sweeps: int = 200, still_m: float = DISTURBED) -> None:
    """Let all disturbed ground slide until it rests, for rendering; the sweeps during a drive end before that.

    The ground is at rest when no sweep moves a level by more than `still_m`, since a long slope creeps on at a rate far
    below its excess. Soil also slides across corners, so the slope is limited in eight directions; between these, the
    gradient is up to 1 / cos(22.5 degrees) times the tangent.
    """
    _slide(ground.state, ground.owner, ground.cell * math.tan(math.radians(angle_deg)), sweeps, still_m, True)


@njit()
def bulldoze_nodes(ground, bodies, rule):  # type: ignore[no-untyped-def]
    rows, columns = ground.owner.shape
    by, cell = len(rule.weights) // 2, ground.cell
    for body in range(len(bodies.shapes)):
        shape, centre, rotation = bodies.shapes[body], bodies.centres[body], bodies.rotations[body]
        nodes = _sources(ground.state, ground.owner, wheel_window(ground, shape, centre, rotation))
        if nodes[0] >= nodes[1]:
            continue
        top, bottom = max(nodes[0] - by, 0), min(nodes[1] + by, rows)
        left, right = max(nodes[2] - by, 0), min(nodes[3] + by, columns)
        part, owners = ground.state[top:bottom, left:right], ground.owner[top:bottom, left:right]
        slopes = ground.normals[top:bottom, left:right]
        dx, dy = ground.x0 + cell * left - centre[0], ground.y0 + cell * top - centre[1]
        _push(part, slopes, owners, shape, centre[2], rotation, dx, dy, cell, rule)
        _slide(part, owners, rule.climb, SWEEPS, 0.0, False)


@njit()
def _sources(state, owner, nodes):  # type: ignore[no-untyped-def]
    """Return the bounds of the pressed nodes of a window; empty if there are none."""
    top, bottom, left, right = nodes[1], nodes[0], nodes[3], nodes[2]
    for row in range(nodes[0], nodes[1]):
        for column in range(nodes[2], nodes[3]):
            if state[row, column, FLOW] > 0 and owner[row, column] != ROCK:
                top, bottom = min(top, row), max(bottom, row + 1)
                left, right = min(left, column), max(right, column + 1)
    return top, bottom, left, right


@njit()
def _push(part, slopes, owners, shape, height, rotation, dx, dy, cell, rule):  # type: ignore[no-untyped-def]  # noqa: C901  loops over nodes
    """Move pressed soil aside in a part of the grid; (dx, dy) is the first node relative to the wheel's centre."""
    ax, ay, az = rotation[0, 1], rotation[1, 1], rotation[2, 1]
    rows, columns = owners.shape
    room, pressed = np.zeros((rows, columns)), np.zeros((rows, columns))
    for row in range(rows):
        for column in range(columns):
            if owners[row, column] == ROCK:
                continue
            if part[row, column, FLOW] > 0:
                pressed[row, column] = part[row, column, FLOW] / slopes[row, column, 2]
            if owners[row, column] == FREE:
                room[row, column] = 1.0
                hit = lowest_wheel_point(
                    ax, ay, az, shape[RADIUS], shape[HALF_WIDTH], dx + cell * column, dy + cell * row, cell
                )
                if hit[0] > 0 and height + hit[1] - part[row, column, LEVEL] < HEADROOM:
                    room[row, column] = 0.0
    reached = _blur(room, rule.weights)
    for row in range(rows):
        for column in range(columns):
            if pressed[row, column] > 0:
                if reached[row, column] > 0:
                    pressed[row, column] *= rule.share / reached[row, column]
                    part[row, column, FLOW] = 0.0
                else:
                    pressed[row, column] = 0.0
    gained = _blur(pressed, rule.weights)
    for row in range(rows):
        for column in range(columns):
            if room[row, column] > 0:
                part[row, column, LEVEL] += gained[row, column]
                part[row, column, START] += gained[row, column]


@njit()
def _blur(field, weights):  # type: ignore[no-untyped-def]
    rows, columns = field.shape
    reach = len(weights) // 2
    along, total = np.zeros((rows, columns)), np.zeros((rows, columns))
    top, bottom = rows, 0
    for row in range(rows):
        for column in range(columns):
            if field[row, column] != 0:  # most nodes are zero
                top, bottom = min(top, row), row + 1
                for other in range(max(column - reach, 0), min(column + reach + 1, columns)):
                    along[row, other] += weights[other - column + reach] * field[row, column]
    for row in range(rows):
        for other in range(max(row - reach, top), min(row + reach + 1, bottom)):
            weight = weights[other - row + reach]
            for column in range(columns):
                total[row, column] += weight * along[other, column]
    return total


@njit()
def _slide(part, owners, climb, sweeps, still, corners):  # type: ignore[no-untyped-def]  # noqa: C901  loops over nodes
    """Run all sweeps, or until no sweep moves a level by more than `still`, metres.

    The sweeps work on contiguous copies, since the state of each node fills a cache line.
    """
    rows, columns = owners.shape
    level, start, original = np.empty((rows, columns)), np.empty((rows, columns)), np.empty((rows, columns))
    for row in range(rows):
        for column in range(columns):
            level[row, column] = part[row, column, LEVEL]
            start[row, column] = part[row, column, START]
            original[row, column] = part[row, column, ORIGINAL]
    change = np.zeros((rows, columns))
    sides = 4 if corners else 2
    for _ in range(sweeps):
        largest = 0.0
        for row in range(rows):
            for column in range(columns):
                for side in range(sides):
                    # To the right, below, below to the right, below to the left.
                    to_row, to_column = row + min(side, 1), column + (1, 0, 1, -1)[side]
                    if to_row == rows or to_column == columns or to_column < 0:
                        continue
                    here, there = level[row, column], level[to_row, to_column]
                    excess = abs(there - here) - (climb if side < 2 else SQRT2 * climb)
                    if (
                        excess > 0  # rare, so checked first
                        and owners[row, column] == FREE
                        and owners[to_row, to_column] == FREE
                        and (
                            abs(here - original[row, column]) > DISTURBED
                            or abs(there - original[to_row, to_column]) > DISTURBED
                        )
                    ):
                        moved = (MOVED if side < 2 else MOVED / 2) * (excess if there > here else -excess)
                        change[row, column] += moved
                        change[to_row, to_column] -= moved
        for row in range(rows):
            for column in range(columns):
                largest = max(largest, abs(change[row, column]))
                level[row, column] += change[row, column]
                start[row, column] += change[row, column]
                change[row, column] = 0.0
        if largest <= still:
            break
    for row in range(rows):
        for column in range(columns):
            part[row, column, LEVEL] = level[row, column]
            part[row, column, START] = start[row, column]
