"""Rock cells of a recorded drive, estimated from boxes in the front camera's pictures, and true cells.

The rule `rover_onboard` scores this map.
Each picture of a point votes rock or no rock, with the inverse fourth power of the distance as weight. A cell is rock
if at least one of its points is rock. `hazard_grid`, the map by which the rover drives, fuses otherwise: it adds
log-odds with the inverse square of the distance as weight, decays with time, and ignores dark pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.geometry.camera import Camera
from polarsim.rover.cameras.layout import BOX
from polarsim.rover.perception.cells import CELL_M, by_cells, rocks_on_ground, true_surface, visible_points
from polarsim.rover.perception.ground_view import estimate
from polarsim.rover.perception.sightings import (
    MAP_FARTHEST_M,
    MAP_NEAREST_M,
    FrontCameraDrive,
    confident_rocks,
    rows_by_frame,
)
from polarsim.rover.world.surface import World

_VOTES = 0.5  # minimum share of the weighted votes for a rock
_PARTS = 5  # points along a side of a cell
_NEARNESS = 4  # exponent of the distance in the weight of a vote
_LEAST_SHARE = 0.5  # minimum visible share of a cell


@dataclass(frozen=True)
class MapGrid:
    """Points (rows, columns) at the centres of the parts of cells, metres."""

    x: np.ndarray  # (columns,)
    y: np.ndarray  # (rows,)

    def of_cells(self, field: np.ndarray) -> np.ndarray:
        """Return the mean over the parts of each cell, ignoring NaN; NaN if all parts are NaN."""
        parts = by_cells(field, _PARTS)
        known = np.isfinite(parts)
        count = known.sum(axis=(1, 3))
        total = np.where(known, parts, 0).sum(axis=(1, 3))
        return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


@dataclass(frozen=True)
class HazardMap:
    """Visibility, rock and height above the ground, m, by cell; the height is 0 without a rock."""

    visible: np.ndarray
    rock: np.ndarray
    height: np.ndarray


def grid_over(world: World) -> MapGrid:
    """Return the cells that are completely inside a world's ground."""
    step = CELL_M / _PARTS
    x, y = (
        start + step * (np.arange(int((end - start) / CELL_M) * _PARTS) + 0.5)
        for start, end in ((world.x[0], world.x[-1]), (world.y[0], world.y[-1]))
    )
    return MapGrid(x, y)


def true_map(world: World, grid: MapGrid) -> HazardMap:
    """Return the map of the rocks' triangles; heights are above the ground below."""
    x, y = np.meshgrid(grid.x, grid.y)
    ground, rock = true_surface(world, x, y)
    height = rock - ground
    return _cells(grid, height > 0, np.maximum(height, 0), np.ones(x.shape, bool))


def map_from_boxes(detections: pd.DataFrame, ride: FrontCameraDrive, grid: MapGrid, confidence: float) -> HazardMap:
    """Return the map of detected or labelled boxes, columns frame, kind, confidence and corners."""
    by_frame = rows_by_frame(confident_rocks(detections, confidence))
    x, y = np.meshgrid(grid.x, grid.y)
    weights, votes, heights = (np.zeros(x.shape) for _ in range(3))
    for frame in ride.frames:
        camera, ground = ride.cameras[frame], ride.ground(frame)
        window = _window(grid, camera)
        points = np.stack([x[window], y[window], ground(x[window], y[window])], axis=-1)
        rows = by_frame.get(frame)
        corners = rows[BOX].to_numpy(float) if rows is not None else np.zeros((0, 4))
        view = visible_points(points, camera, corners, (MAP_NEAREST_M, MAP_FARTHEST_M))
        weight = np.where(view.inside, np.maximum(view.distance, 0.1) ** -_NEARNESS, 0.0)
        height = np.zeros(weight.shape)
        for _, _, rise in rocks_on_ground(estimate(corners[view.whole], camera, ground), x[window], y[window]):
            height = np.maximum(height, rise)
        weights[window] += weight
        votes[window] += weight * (height > 0)
        heights[window] += weight * height
    with np.errstate(divide="ignore", invalid="ignore"):
        rock = (weights > 0) & (votes >= _VOTES * weights)
        height = np.where(rock, heights / votes, 0.0)
    return _cells(grid, rock, height, weights > 0)


def compare_maps(estimated: HazardMap, true: HazardMap) -> pd.DataFrame:
    """Return a row: visible cells, right, false and missed rock cells, F1, and errors of height.

    Errors of height are the median over rock cells and the share of cells within 5 cm.
    """
    cells = estimated.visible
    right = int((estimated.rock & true.rock & cells).sum())
    false, missed = int((estimated.rock & ~true.rock & cells).sum()), int((~estimated.rock & true.rock & cells).sum())
    error = np.abs(estimated.height - true.height)
    either = cells & (estimated.rock | true.rock)
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


def _cells(grid: MapGrid, rock: np.ndarray, height: np.ndarray, visible: np.ndarray) -> HazardMap:
    cell_visible = grid.of_cells(visible.astype(float)) >= _LEAST_SHARE
    share = grid.of_cells(np.where(visible, rock, np.nan).astype(float))
    flagged = np.nan_to_num(share) > 0
    mean = np.nan_to_num(grid.of_cells(np.where(rock & visible, height, np.nan)))
    return HazardMap(cell_visible, flagged & cell_visible, np.where(flagged & cell_visible, mean, 0.0))


def _window(grid: MapGrid, camera: Camera) -> tuple[slice, slice]:
    reach = MAP_FARTHEST_M
    x, y = camera.centre[:2]
    columns = slice(*np.searchsorted(grid.x, [x - reach, x + reach]))
    rows = slice(*np.searchsorted(grid.y, [y - reach, y + reach]))
    return rows, columns
