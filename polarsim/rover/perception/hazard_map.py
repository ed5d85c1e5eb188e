"""Where rocks lie along the drive, on a grid: as boxes in the front camera's pictures tell, and as it is.

Each look at a piece of ground says rock or none; near looks count more, as one over the fourth power of the distance.
A cell is rock where a rock stands in any of its parts. Rocks are taken for upper halves of ellipsoids over round
footprints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import caster
from polarsim.photo import ROCK
from polarsim.rover.cameras.layout import BOX
from polarsim.rover.cameras.options import OnboardOptions
from polarsim.rover.perception.ground_view import Estimate, estimate
from polarsim.rover.perception.sightings import MAP_FARTHEST_M, MAP_NEAREST_M, Ride, of_frames
from polarsim.rover.world.surface import World

_VOTES = 0.5  # share of the looks at a cell that must show a rock
_PARTS = 5  # points along a side of a cell
_RIM_PX = 2.0  # boxes so near to the picture's rim are cut: what they show is not known
_NEARNESS = 4  # power of the distance by which looks count less
_LEAST_SHARE = 0.5  # of a cell that must have been looked at


@dataclass(frozen=True)
class Grid:
    """Points (rows, columns) at the centres of the parts of cells, metres."""

    x: np.ndarray  # (columns,)
    y: np.ndarray  # (rows,)

    def of_cells(self, field: np.ndarray) -> np.ndarray:
        """Mean over the parts of each cell, without NaN; NaN where all are."""
        rows, columns = field.shape
        parts = field.reshape(rows // _PARTS, _PARTS, columns // _PARTS, _PARTS)
        known = np.isfinite(parts)
        count = known.sum(axis=(1, 3))
        total = np.where(known, parts, 0).sum(axis=(1, 3))
        return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


@dataclass(frozen=True)
class HazardMap:
    """By cell: looked at or not, rock or not, height above the ground, metres; 0 where there is no rock."""

    looked: np.ndarray
    rock: np.ndarray
    height: np.ndarray


def grid_over(world: World, options: OnboardOptions) -> Grid:
    """Whole cells over a world's ground."""
    step = options.cell_m / _PARTS
    x, y = (
        start + step * (np.arange(int((end - start) / options.cell_m) * _PARTS) + 0.5)
        for start, end in ((world.x[0], world.x[-1]), (world.y[0], world.y[-1]))
    )
    return Grid(x, y)


def true_map(world: World, grid: Grid) -> HazardMap:
    """From the rocks' triangles; their height is that above the ground beneath."""
    x, y = np.meshgrid(grid.x, grid.y)
    ground = world.height_at(x, y)
    top = float(world.vertices[:, 2].max(initial=0)) + 1
    origins = np.stack([x.ravel(), y.ravel(), np.full(x.size, top)], axis=1)
    distance = np.full(x.size, np.inf)
    if len(world.triangles):
        distance, _ = caster(world.vertices, world.triangles).nearest(origins, np.tile([0.0, 0, -1], (x.size, 1)))
    height = np.where(np.isfinite(distance), top - distance, -np.inf).reshape(x.shape) - ground
    return _cells(grid, height > 0, np.maximum(height, 0), np.ones(x.shape, bool))


def mapped(found: pd.DataFrame, ride: Ride, grid: Grid, options: OnboardOptions) -> HazardMap:
    """From detected or labelled boxes, columns frame, kind, confidence and corners."""
    sure = found[(found["kind"] == ROCK) & (found["confidence"] >= options.confidence)]
    by_frame = of_frames(sure)
    x, y = np.meshgrid(grid.x, grid.y)
    looks, votes, heights = (np.zeros(x.shape) for _ in range(3))
    for frame in ride.frames:
        window = _window(grid, ride.cameras[frame])
        points = np.stack([x[window], y[window], ride.ground(frame)(x[window], y[window])], axis=-1)
        pixel, weight = _looked_at(points, ride.cameras[frame])
        own = by_frame.get(frame)
        corners = own[BOX].to_numpy(float) if own is not None else np.zeros((0, 4))
        cut = _is_cut(corners, ride.cameras[frame].size)
        for box in corners[cut]:
            inside = ((pixel > box[:2]) & (pixel < box[2:])).all(axis=-1)
            weight[inside] = 0
        rocks = estimate(corners[~cut], ride.cameras[frame], ride.ground(frame))
        height = _shape(rocks, x[window], y[window])
        looks[window] += weight
        votes[window] += weight * (height > 0)
        heights[window] += weight * height
    with np.errstate(divide="ignore", invalid="ignore"):
        rock = (looks > 0) & (votes >= _VOTES * looks)
        height = np.where(rock, heights / votes, 0.0)
    return _cells(grid, rock, height, looks > 0)


def compared(found: HazardMap, true: HazardMap) -> pd.DataFrame:
    """One row: cells looked at, right, false and missed rock cells, F1, height errors: median of rocks, within 5 cm."""
    cells = found.looked
    right = int((found.rock & true.rock & cells).sum())
    false, missed = int((found.rock & ~true.rock & cells).sum()), int((~found.rock & true.rock & cells).sum())
    error = np.abs(found.height - true.height)
    either = cells & (found.rock | true.rock)
    row = {
        "cells": int(cells.sum()),
        "right": right,
        "false": false,
        "missed": missed,
        "f1": 2 * right / (2 * right + false + missed) if right + false + missed else np.nan,
        "height_error_m": float(np.median(error[either])) if either.any() else np.nan,
        "within_5_cm": float((error[cells] < 0.05).mean()) if cells.any() else np.nan,
    }
    return pd.DataFrame([row])


def _cells(grid: Grid, rock: np.ndarray, height: np.ndarray, looked: np.ndarray) -> HazardMap:
    seen = grid.of_cells(looked.astype(float)) >= _LEAST_SHARE
    share = grid.of_cells(np.where(looked, rock, np.nan).astype(float))
    flagged = np.nan_to_num(share) > 0
    mean = np.nan_to_num(grid.of_cells(np.where(rock & looked, height, np.nan)))
    return HazardMap(seen, flagged & seen, np.where(flagged & seen, mean, 0.0))


def _window(grid: Grid, camera: Camera) -> tuple[slice, slice]:
    reach = MAP_FARTHEST_M
    x, y = camera.centre[:2]
    columns = slice(*np.searchsorted(grid.x, [x - reach, x + reach]))
    rows = slice(*np.searchsorted(grid.y, [y - reach, y + reach]))
    return rows, columns


def _looked_at(points: np.ndarray, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Pixels (..., 2) that show points (..., 3) on the ground, and what a look at each counts; 0 out of suite."""
    pixel = camera.project(points)
    distance = np.linalg.norm((points - camera.centre)[..., :2], axis=-1)
    inside = camera.inside(pixel)
    inside &= (distance >= MAP_NEAREST_M) & (distance <= MAP_FARTHEST_M)
    return pixel, np.where(inside, np.maximum(distance, 0.1) ** -_NEARNESS, 0.0)


def _is_cut(corners: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.asarray((corners[:, :2] < _RIM_PX).any(axis=1) | (corners[:, 2:] > size - _RIM_PX).any(axis=1))


def _shape(rocks: Estimate, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the highest estimated rock at points, metres; 0 beside them."""
    highest = np.zeros(x.shape)
    for centre, width, height in zip(rocks.centre, rocks.width, rocks.height, strict=True):
        if np.isfinite(centre).all() and width > 0:
            squared = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (width / 2) ** 2
            highest = np.maximum(highest, np.where(squared < 1, height * np.sqrt(np.maximum(1 - squared, 0)), 0.0))
    return highest
