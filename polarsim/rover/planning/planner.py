"""Shortest path between hazards over a lattice of positions and headings, by SciPy's Dijkstra.

The heading must be part of the plan, since rocks may pass between the wheels; grid planners such as scikit-image's
`MCP_Geometric` do not model it. The lattice (Pivtoraiko, Knepper & Kelly, J. Field Robotics 26 (2009) 308) is defined
in the rover's frame, with node 0, 0 at heading 0 at the rover's pose. Edges are straight steps and bends between
adjacent headings, as cubic Hermite curves within the maximum curvature. An edge is free if all four wheels keep their
gap.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from polarsim.errors import RoverError
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.planning.options import PlannerOptions

STEP = 0.15  # m between nodes of the lattice
FINE = 5  # cells of the distance field along a cell of the map
_WAYS = ((1, 0), (2, 1), (1, 1), (1, 2))  # straight steps that end on nodes, for headings of a quarter turn
_REACH = 8  # maximum extent of a bend, cells
_ROUNDING_M = 1e-6
_SAMPLE = 0.1  # m between poses at which an edge is checked
_WINDOW_M = 5.0  # extent of paths ahead of the rover
_SOFT_M = 0.25  # distance outside the gap within which nearness to hazards costs
_UNSEEN_COST = 8.0  # m per metre over unobserved ground
_BEND_COST = 0.05  # m per bend
_GOAL_WEIGHT = 2.5  # weight of the distance to the goal relative to the length of the path (weighted A*)
_TURNED_COST = 0.4  # m per radian between the final heading and the direction of the goal
_MIN_GAIN_M = 2.0  # m; minimum progress towards the goal, unless the goal is reached: shorter paths are dead ends
_MAX_UNSEEN = 0.5  # maximum share of wheels on unobserved ground at the end of a path
_GOAL_M = 0.4  # distance at which the goal is reached
_LEAVING_M = 1.0  # m; up to this distance, a path may be as close to hazards as the rover is now
_EDGE_M = 0.25  # margin to the edge of the world, in addition to the gap


@dataclass(frozen=True)
class Edge:
    """Edge from a node at a heading: end node, and poses (n, 3) x, y, heading along the edge without the first."""

    start: int
    end: int
    columns: int
    rows: int
    places: np.ndarray
    length: float


@dataclass(frozen=True)
class LatticeFrame:
    """Pose of the rover in the world, m and rad: the frame of the lattice."""

    x: float
    y: float
    heading: float

    def to_world(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y in the world of points u ahead and v to the left of the rover."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return self.x + cos * u - sin * v, self.y + sin * u + cos * v


@dataclass(frozen=True)
class HazardField:
    """Distances from points of the world to the nearest hazards, m, for the wheels and for the body.

    A distance starts at the near edge of the point's cell, so that rounding cannot reduce gaps.
    """

    x0: float
    y0: float
    cell: float
    wheels: np.ndarray
    body: np.ndarray
    unseen: np.ndarray

    def at(self, values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the values at the cells of points; the nearest edge cell outside the grid."""
        column = np.clip(((x - self.x0) / self.cell).astype(int), 0, values.shape[1] - 1)
        row = np.clip(((y - self.y0) / self.cell).astype(int), 0, values.shape[0] - 1)
        return np.asarray(values[row, column])


def hazard_field(grid: HazardGrid, hazards: np.ndarray, high: np.ndarray, seen: np.ndarray) -> HazardField:
    """Return the distances to cells (rows, columns) that wheels or the body must avoid; `seen`: observed cells."""
    cell = grid.cell_m / FINE
    blocked, tall, known = (np.kron(cells, np.ones((FINE, FINE), bool)) for cells in (hazards, high, seen))
    rim = math.ceil(_EDGE_M / cell)
    blocked[:rim], blocked[-rim:], blocked[:, :rim], blocked[:, -rim:] = True, True, True, True
    unlimited = np.full(blocked.shape, np.inf)
    return HazardField(
        float(grid.x[0] - grid.cell_m / 2),
        float(grid.y[0] - grid.cell_m / 2),
        cell,
        _to_edges(blocked, cell),
        _to_edges(tall, cell) if tall.any() else unlimited,
        ~known,
    )


def _to_edges(blocked: np.ndarray, cell: float) -> np.ndarray:
    """Return distances to the nearest blocked cell: between centres, minus half a cell at both ends."""
    return np.asarray(np.maximum(ndimage.distance_transform_edt(~blocked) - 1, 0) * cell)


def angles() -> np.ndarray:
    """Return the (16,) headings of the lattice, rad."""
    quarter = [math.atan2(y, x) for x, y in _WAYS]
    return np.array([angle + turn * math.pi / 2 for turn in range(4) for angle in quarter])


@lru_cache(maxsize=8)
def edges(curvature: float) -> tuple[Edge, ...]:
    """Return all edges that start at a node."""
    headings, result = angles(), []
    for start, heading in enumerate(headings):
        step = np.rint(np.array([math.cos(heading), math.sin(heading)]) * math.hypot(*_WAYS[start % 4])).astype(int)
        result.append(_edge(start, start, (int(step[0]), int(step[1])), headings))
        for turn in (-1, 1):
            end = (start + turn) % len(headings)
            bends = [
                bend
                for columns in range(-_REACH, _REACH + 1)
                for rows in range(-_REACH, _REACH + 1)
                if columns * math.cos(heading) + rows * math.sin(heading) > 1
                and _largest_curvature(bend := _edge(start, end, (columns, rows), headings)) <= curvature
            ]
            if not bends:
                raise RoverError(f"curvature_1_m: {curvature:g} 1/m is too small for the lattice of paths")
            result.append(min(bends, key=lambda bend: bend.length))
    return tuple(result)


def _edge(start: int, end: int, cells: tuple[int, int], headings: np.ndarray) -> Edge:
    """Return a cubic Hermite curve with tangents as long as the chord."""
    goal = STEP * np.array(cells, float)
    chord = float(np.hypot(*goal))
    first, last = (chord * np.array([math.cos(a), math.sin(a)]) for a in (headings[start], headings[end]))
    t = np.linspace(0, 1, 21)[:, None]
    points = (t**3 - 2 * t**2 + t) * first + (3 * t**2 - 2 * t**3) * goal + (t**3 - t**2) * last
    slopes = (3 * t**2 - 4 * t + 1) * first + (6 * t - 6 * t**2) * goal + (3 * t**2 - 2 * t) * last
    places = np.column_stack([points, np.arctan2(slopes[:, 1], slopes[:, 0])])
    length = float(np.hypot(*np.diff(points, axis=0).T).sum())
    chosen = np.linspace(0, 20, max(math.ceil(length / _SAMPLE), 1) + 1).round().astype(int)[1:]
    return Edge(start, end, *cells, places[chosen], length)


def _largest_curvature(edge: Edge) -> float:
    """Return the maximum curvature between poses, including the initial heading."""
    headings = np.concatenate([[angles()[edge.start]], edge.places[:, 2]])
    points = np.vstack([[0.0, 0.0], edge.places[:, :2]])
    turned = np.abs((np.diff(headings) + np.pi) % (2 * np.pi) - np.pi)
    return float((turned / np.maximum(np.hypot(*np.diff(points, axis=0).T), 1e-9)).max())


class Planner:
    """Planner for a rover with wheels at `wheels` (4, 2) in base_link, metres."""

    def __init__(self, wheels: np.ndarray, options: PlannerOptions) -> None:
        self.wheels, self.options = np.asarray(wheels, float), options
        ahead, aside = math.ceil(_WINDOW_M / STEP), math.ceil(0.6 * _WINDOW_M / STEP)
        self._columns, self._rows = np.arange(-3, ahead + 1), np.arange(-aside, aside + 1)
        self._shape = (len(angles()), len(self._rows), len(self._columns))

    def clearance(self, field: HazardField, places: np.ndarray) -> np.ndarray:
        """Return (...) m, the clearance in addition to the gap at poses (..., 3) x, y, heading; negative: not free."""
        places = np.asarray(places, float)
        x, y = self._points(places, self.wheels)
        room = np.asarray(field.at(field.wheels, x, y).min(axis=-1)) - self.options.wheel_gap_m
        if np.isfinite(field.body).any():
            length, half = float(np.ptp(self.wheels[:, 0])) / 2, float(np.ptp(self.wheels[:, 1])) / 4
            middle = np.array([[s * length, t * half] for s in (-1, -0.5, 0, 0.5, 1) for t in (-1, 0, 1)])
            x, y = self._points(places, middle)
            room = np.minimum(room, field.at(field.body, x, y).min(axis=-1) - half)
        return room

    def free(self, field: HazardField, places: np.ndarray, here: np.ndarray) -> np.ndarray:
        """Return (...) bool: poses (..., 3) that keep the gap or, near `here` (3,), at least the clearance at `here`.

        A hazard of the map may be under the rover or closer than the gap. The rover may then leave, but not get closer.
        """
        places = np.asarray(places, float)
        near = np.hypot(places[..., 0] - here[0], places[..., 1] - here[1]) < _LEAVING_M
        return np.asarray(self.clearance(field, places) > np.where(near, self.required_room(field, here), 0.0))

    def required_room(self, field: HazardField, here: np.ndarray) -> float:
        """Return the lower bound of the clearance, m, of poses near `here` (3,): 0, or that of `here` if lower."""
        return min(float(self.clearance(field, here)) - _ROUNDING_M, 0.0)

    def plan(self, field: HazardField, x: float, y: float, heading: float, goal: np.ndarray) -> np.ndarray | None:
        """Return poses (n, 3) x, y, heading in the world from here towards the goal (2,), or None if there is no path.

        Near the rover, `free` allows less clearance. Paths may cross unobserved ground, at a cost, but end where at
        least half of the wheels are on observed ground. A rover without observations therefore stops.
        """
        frame, required = LatticeFrame(x, y, heading), self.required_room(field, np.array([x, y, heading]))
        number = np.arange(np.prod(self._shape)).reshape(self._shape)
        starts, ends, costs, all_edges = [], [], [], edges(self.options.curvature_1_m)
        for edge in all_edges:
            rows = slice(max(-edge.rows, 0), len(self._rows) - max(edge.rows, 0))
            columns = slice(max(-edge.columns, 0), len(self._columns) - max(edge.columns, 0))
            u = STEP * self._columns[columns][None, :, None] + edge.places[:, 0]
            v = STEP * self._rows[rows][:, None, None] + edge.places[:, 1]
            headings = heading + edge.places[:, 2]
            places = np.stack(np.broadcast_arrays(*frame.to_world(u, v), headings), axis=-1)
            cost, free = self._cost(field, places, edge, np.hypot(u, v) < _LEAVING_M, required)
            from_here = number[edge.start, rows, columns]
            end_nodes = number[edge.end][
                rows.start + edge.rows : rows.stop + edge.rows,
                columns.start + edge.columns : columns.stop + edge.columns,
            ]
            starts.append(from_here[free])
            ends.append(end_nodes[free])
            costs.append(cost[free])
        size = int(np.prod(self._shape))
        graph = sparse.csr_array(
            (np.concatenate(costs), (np.concatenate(starts), np.concatenate(ends))), shape=(size, size)
        )
        here = int(number[0, len(self._rows) // 2, 3])
        distance, before = csgraph.dijkstra(graph, indices=np.array(here), return_predecessors=True)
        distance = np.where(self._ends_unseen(field, frame), np.inf, distance.reshape(self._shape))
        best = self._best(distance, frame, goal)
        return None if best is None else self._path(best, here, before, frame)

    def _points(self, places: np.ndarray, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        cos, sin = np.cos(places[..., 2])[..., None], np.sin(places[..., 2])[..., None]
        x = places[..., 0, None] + cos * offsets[:, 0] - sin * offsets[:, 1]
        y = places[..., 1, None] + sin * offsets[:, 0] + cos * offsets[:, 1]
        return x, y

    def _cost(
        self, field: HazardField, places: np.ndarray, edge: Edge, near: np.ndarray, required: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the cost of an edge from each node, and whether it is free.

        `near` (...): poses at which the clearance must exceed `required` instead of 0.
        """
        clearance = self.clearance(field, places)
        room = clearance.min(axis=-1)
        nearness = np.clip(1 - room / _SOFT_M, 0, 1)
        x, y = self._points(places[..., -1, :], self.wheels)
        unseen = field.at(field.unseen, x, y).mean(axis=-1)
        bend = _BEND_COST * (edge.start != edge.end)
        free = np.asarray((clearance > np.where(near, required, 0.0)).all(axis=-1))
        return edge.length * (1 + nearness + _UNSEEN_COST * unseen) + bend, free

    def _ends_unseen(self, field: HazardField, frame: LatticeFrame) -> np.ndarray:
        """Return (headings, rows, columns) bool: nodes with more than half of the wheels on unobserved ground."""
        angle, v, u = np.meshgrid(angles(), STEP * self._rows, STEP * self._columns, indexing="ij")
        places = np.stack([*frame.to_world(u, v), frame.heading + angle], axis=-1)
        return np.asarray(field.at(field.unseen, *self._points(places, self.wheels)).mean(axis=-1) > _MAX_UNSEEN)

    def _best(self, distance: np.ndarray, frame: LatticeFrame, goal: np.ndarray) -> int | None:
        x, y = frame.to_world(STEP * self._columns[None, None], STEP * self._rows[None, :, None])
        dx, dy = goal[0] - x, goal[1] - y
        remaining = np.hypot(dx, dy)
        off = np.arctan2(dy, dx) - frame.heading - angles()[:, None, None]
        off = np.abs((off + np.pi) % (2 * np.pi) - np.pi) * (remaining > 0.5)
        gain = math.hypot(goal[0] - frame.x, goal[1] - frame.y) - remaining
        total = np.where(
            np.isfinite(distance) & ((gain >= _MIN_GAIN_M) | (remaining < _GOAL_M)) & (distance > 0),
            distance + _GOAL_WEIGHT * (remaining + _TURNED_COST * off),
            np.inf,
        )
        best = int(np.argmin(total))
        return best if np.isfinite(total.ravel()[best]) else None

    def _path(self, best: int, here: int, before: np.ndarray, frame: LatticeFrame) -> np.ndarray:
        nodes = [best]
        while nodes[-1] != here:
            nodes.append(int(before[nodes[-1]]))
        by_ends = {(e.start, e.end, e.columns, e.rows): e for e in edges(self.options.curvature_1_m)}
        places = [np.zeros((1, 3))]
        for node, following in zip(nodes[::-1], nodes[-2::-1], strict=False):
            (k, row, column), (m, next_row, next_column) = (np.unravel_index(n, self._shape) for n in (node, following))
            edge = by_ends[int(k), int(m), int(next_column - column), int(next_row - row)]
            places.append(edge.places + np.array([STEP * self._columns[column], STEP * self._rows[row], 0.0]))
        local = np.concatenate(places)
        return np.column_stack([*frame.to_world(*local[:, :2].T), frame.heading + local[:, 2]])
