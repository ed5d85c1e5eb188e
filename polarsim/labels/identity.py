"""Which rock an annotated box shows: its mesh where one projects there, a numbered stand-in elsewhere."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from polarsim.geometry.boxes import centres, iou
from polarsim.geometry.camera import Camera
from polarsim.labels.bodies import Dome, World
from polarsim.labels.projection import ground_depth
from polarsim.photo import FIRST_UNMESHED_ROCK

SAME_POSITION = 0.06  # metres: two stand-ins nearer than this, or than half a radius, are one rock
FORBIDDEN = 1e3


def match_boxes(annotated: np.ndarray, expected: np.ndarray, gate_px: float, smallest_iou: float = 0.2) -> np.ndarray:
    """(n,) row of `expected` (m, 4) for each box of `annotated` (n, 4), -1 for none: one-to-one, nearest and likest
    first.

    A pair farther apart than the gate, centre to centre, counts only if its boxes overlap by `smallest_iou`: large
    boxes may be off by more.
    """
    found = np.full(len(annotated), -1)
    if not len(annotated) or not len(expected):
        return found
    overlap = iou(annotated, expected)
    distance = np.linalg.norm(centres(annotated)[:, None] - centres(expected)[None], axis=-1)
    cost = distance / gate_px - overlap
    cost[(distance > gate_px) & (overlap < smallest_iou)] = FORBIDDEN
    rows, columns = linear_sum_assignment(cost)
    good = cost[rows, columns] < FORBIDDEN
    found[rows[good]] = columns[good]
    return found


def dome_behind(world: World, view: Camera, box: np.ndarray) -> Dome | None:
    """The dome whose outline a box (4,) frames; None where the box's foot is not on the ground.

    From a camera that looks down by p, a dome of radius a and height h spans a sin p + sqrt((h cos p)^2 + (a sin p)^2).
    """
    foot = np.array([[(box[0] + box[2]) / 2, box[3]]])
    depth = float(ground_depth(world, view, foot)[0])
    if not np.isfinite(depth):
        return None
    direction = view.directions(foot)[0]
    unit = direction / np.linalg.norm(direction)
    metres_per_px = depth * np.linalg.norm(direction) / view.lens.fx
    radius = (box[2] - box[0]) / 2 * metres_per_px
    span = (box[3] - box[1]) * metres_per_px
    down, level = -unit[2], float(np.hypot(unit[0], unit[1]))
    height = np.sqrt(max(0.0, span**2 - 2 * span * radius * down)) / max(level, 0.2)
    ahead = np.array([unit[0], unit[1], 0]) / max(level, 1e-9)
    centre = view.centre + depth * direction + radius * ahead
    return Dome(centre, float(radius), float(np.clip(height, 0.4 * radius, 2.5 * radius)))


def number_domes(
    domes_of_views: list[list[Dome | None]], first: int = FIRST_UNMESHED_ROCK
) -> tuple[list[list[int]], dict[int, Dome]]:
    """Give unmeshed rocks their numbers: domes of different views that stand at one position are one rock.

    Returns the number of each dome (`first` and on, in the order of views and of domes within; a box that gave no dome
    gets a number of its own too), and the mean dome of each number.
    """
    members: dict[int, list[Dome]] = {}
    numbers: list[list[int]] = []
    following = first
    for domes in domes_of_views:
        known = sorted(number for number, stood in members.items() if stood)
        cost = np.array([[_apart(dome, members[number]) for number in known] for dome in domes]).reshape(
            len(domes), len(known)
        )
        rows, columns = linear_sum_assignment(cost)
        pairs = zip(rows.tolist(), columns.tolist(), strict=True)
        taken = {row: known[column] for row, column in pairs if cost[row, column] < FORBIDDEN}
        own = []
        for row, dome in enumerate(domes):
            number = taken.get(row, following)
            following += row not in taken
            members.setdefault(number, [])
            if dome is not None:
                members[number].append(dome)
            own.append(number)
        numbers.append(own)
    return numbers, {number: _mean_dome(stood) for number, stood in members.items() if stood}


def _apart(dome: Dome | None, others: list[Dome]) -> float:
    if dome is None:
        return FORBIDDEN
    other = _mean_dome(others)
    distance = float(np.linalg.norm(dome.foot[:2] - other.foot[:2]))
    return distance if distance < max(SAME_POSITION, dome.radius, other.radius) else FORBIDDEN


def _mean_dome(domes: list[Dome]) -> Dome:
    return Dome(
        np.mean([dome.foot for dome in domes], axis=0),
        float(np.mean([dome.radius for dome in domes])),
        float(np.mean([dome.height for dome in domes])),
    )
