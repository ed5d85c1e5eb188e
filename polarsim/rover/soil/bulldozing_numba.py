"""`bulldozing.bulldoze` compiled."""

from __future__ import annotations

import math

import numpy as np

from polarsim.kernels import njit
from polarsim.rover.soil.bulldozing import DISTURBED, MOVED, SQRT2, Bulldozing, taps
from polarsim.rover.soil.nodes import FLOW, FREE, LEVEL, ORIGINAL, ROCK, START, Ground
from polarsim.rover.soil.shapes import Bodies
from polarsim.rover.soil.shapes_numba import clear, intersect, window


def bulldoze(ground: Ground, bodies: Bodies, rule: Bulldozing) -> None:
    """Move aside what the bodies pressed since the last call, then let it slide around them."""
    climb = ground.cell * math.tan(math.radians(rule.angle_deg))
    _bulldoze(
        ground.state, ground.normals, ground.owner, ground.x0, ground.y0, ground.cell,
        bodies.numbers, bodies.centres, bodies.rotations,
        taps(rule, ground.cell), rule.share, rule.headroom, climb, rule.sweeps,
    )  # fmt: skip


def settle(ground: Ground, angle_deg: float = 36.0, sweeps: int = 200, still_m: float = DISTURBED) -> None:
    """`bulldozing.settle`: let disturbed ground everywhere slide until it rests."""
    _slide(ground.state, ground.owner, ground.cell * math.tan(math.radians(angle_deg)), sweeps, still_m, True)


@njit()
def _bulldoze(  # type: ignore[no-untyped-def]
    state, normals, owner, x0, y0, cell, shapes, centres, rotations, weights, share, headroom, climb, sweeps,
):  # fmt: skip
    rows, columns = owner.shape
    by = len(weights) // 2
    for body in range(len(shapes)):
        nodes = window(shapes[body], centres[body], rotations[body], x0, y0, cell, rows, columns)
        nodes = _sources(state, owner, nodes)
        if nodes[0] >= nodes[1]:
            continue
        top, bottom = max(nodes[0] - by, 0), min(nodes[1] + by, rows)
        left, right = max(nodes[2] - by, 0), min(nodes[3] + by, columns)
        part, owners = state[top:bottom, left:right], owner[top:bottom, left:right]
        slopes = normals[top:bottom, left:right]
        dx, dy = x0 + cell * left - centres[body, 0], y0 + cell * top - centres[body, 1]
        _push(
            part, slopes, owners, shapes[body], centres[body, 2], rotations[body], dx, dy, cell,
            weights, share, headroom,
        )  # fmt: skip
        _slide(part, owners, climb, sweeps, 0.0, False)


@njit()
def _sources(state, owner, nodes):  # type: ignore[no-untyped-def]
    """Bounds of the nodes of a window that were pressed; empty if none was."""
    top, bottom, left, right = nodes[1], nodes[0], nodes[3], nodes[2]
    for row in range(nodes[0], nodes[1]):
        for column in range(nodes[2], nodes[3]):
            if state[row, column, FLOW] > 0 and owner[row, column] != ROCK:
                top, bottom = min(top, row), max(bottom, row + 1)
                left, right = min(left, column), max(right, column + 1)
    return top, bottom, left, right


@njit()
def _push(  # type: ignore[no-untyped-def]  # noqa: C901  loops over nodes
    part, slopes, owners, shape, height, rotation, dx, dy, cell, weights, share, headroom,
):  # fmt: skip
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
                if clear(
                    shape, rotation, dx + cell * column, dy + cell * row, height - headroom - part[row, column, LEVEL]
                ):
                    continue
                met = intersect(shape, rotation, dx + cell * column, dy + cell * row, cell)
                if met[0] > 0 and height + met[1] - part[row, column, LEVEL] < headroom:
                    room[row, column] = 0.0
    reached = _blur_at(pressed, room, weights)
    for row in range(rows):
        for column in range(columns):
            if pressed[row, column] > 0:
                if reached[row, column] > 0:
                    pressed[row, column] *= share / reached[row, column]
                    part[row, column, FLOW] = 0.0
                else:
                    pressed[row, column] = 0.0
    gained = _blur(pressed, weights)
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
            if field[row, column] != 0:  # most nodes send nothing
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
def _blur_at(wanted, field, weights):  # type: ignore[no-untyped-def]
    """`_blur` where `wanted` is above 0, which is at few nodes; 0 elsewhere."""
    rows, columns = field.shape
    reach = len(weights) // 2
    total = np.zeros((rows, columns))
    along = np.empty(rows)
    for column in range(columns):
        top, bottom = rows, 0
        for row in range(rows):
            if wanted[row, column] > 0:
                top, bottom = min(top, row), max(bottom, row + 1)
        if top >= bottom:
            continue
        for row in range(max(top - reach, 0), min(bottom + reach, rows)):
            one = 0.0
            for other in range(max(column - reach, 0), min(column + reach + 1, columns)):
                one += weights[column - other + reach] * field[row, other]
            along[row] = one
        for row in range(top, bottom):
            if wanted[row, column] > 0:
                for other in range(max(row - reach, 0), min(row + reach + 1, rows)):
                    total[row, column] += weights[other - row + reach] * along[other]
    return total


@njit()
def _slide(part, owners, climb, sweeps, still, corners):  # type: ignore[no-untyped-def]  # noqa: C901  loops over nodes
    """All sweeps, or until none moves a level by more than `still`, metres.

    On copies that lie close together, for a node's state is spread over a cache line of its own.
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
        most = 0.0
        for row in range(rows):
            for column in range(columns):
                for side in range(sides):
                    # To the right, below, below to the right, below to the left.
                    to_row, to_column = row + min(side, 1), column + (1, 0, 1, -1)[side]
                    if to_row == rows or to_column == columns or to_column < 0:
                        continue
                    one, two = level[row, column], level[to_row, to_column]
                    excess = abs(two - one) - (climb if side < 2 else SQRT2 * climb)
                    if (
                        excess > 0  # first, for it is rare
                        and owners[row, column] == FREE
                        and owners[to_row, to_column] == FREE
                        and (
                            abs(one - original[row, column]) > DISTURBED
                            or abs(two - original[to_row, to_column]) > DISTURBED
                        )
                    ):
                        moved = (MOVED if side < 2 else MOVED / 2) * (excess if two > one else -excess)
                        change[row, column] += moved
                        change[to_row, to_column] -= moved
        for row in range(rows):
            for column in range(columns):
                most = max(most, abs(change[row, column]))
                level[row, column] += change[row, column]
                start[row, column] += change[row, column]
                change[row, column] = 0.0
        if most <= still:
            break
    for row in range(rows):
        for column in range(columns):
            part[row, column, LEVEL] = level[row, column]
            part[row, column, START] = start[row, column]
