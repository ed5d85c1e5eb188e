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

from polarsim.rover.cameras.layout import BOX
from polarsim.rover.perception.ground_view import by_cells, grid_points, rocks_on_ground, true_surface, view_ground
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
class HazardMap:
    """Visibility, rock and height above the ground, m, by cell; the height is 0 without a rock."""

    visible: np.ndarray
    rock: np.ndarray
    height: np.ndarray


def true_map(world: World) -> HazardMap:
    """Return the map of the rocks' triangles; heights are above the ground below."""
    x, y = np.meshgrid(*grid_points(world, _PARTS))
    ground, rock = true_surface(world, x, y)
    height = rock - ground
    return _cells(height > 0, np.maximum(height, 0), np.ones(x.shape, bool))


def map_from_boxes(detections: pd.DataFrame, ride: FrontCameraDrive, world: World, confidence: float) -> HazardMap:
    """Return the map of detected or labelled boxes, columns frame, kind, confidence and corners."""
    by_frame = rows_by_frame(confident_rocks(detections, confidence))
    x, y = grid_points(world, _PARTS)
    weights, votes, heights = (np.zeros((len(y), len(x))) for _ in range(3))
    for frame in ride.frames:
        boxes = by_frame[frame][BOX].to_numpy(float) if frame in by_frame else np.zeros((0, 4))
        view = view_ground(x, y, ride.cameras[frame], ride.ground(frame), boxes, (MAP_NEAREST_M, MAP_FARTHEST_M))
        weight = np.where(view.inside, np.maximum(view.distance, 0.1) ** -_NEARNESS, 0.0)
        height = np.zeros(weight.shape)
        for _, _, rise in rocks_on_ground(view.rocks, view.points[..., 0], view.points[..., 1]):
            height = np.maximum(height, rise)
        weights[view.window] += weight
        votes[view.window] += weight * (height > 0)
        heights[view.window] += weight * height
    with np.errstate(divide="ignore", invalid="ignore"):
        rock = (weights > 0) & (votes >= _VOTES * weights)
        height = np.where(rock, heights / votes, 0.0)
    return _cells(rock, height, weights > 0)


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


def _cells(rock: np.ndarray, height: np.ndarray, visible: np.ndarray) -> HazardMap:
    cell_visible = _mean_of_cells(visible.astype(float)) >= _LEAST_SHARE
    flagged = cell_visible & (np.nan_to_num(_mean_of_cells(np.where(visible, rock, np.nan))) > 0)
    mean = np.nan_to_num(_mean_of_cells(np.where(rock & visible, height, np.nan)))
    return HazardMap(cell_visible, flagged, np.where(flagged, mean, 0.0))


def _mean_of_cells(values: np.ndarray) -> np.ndarray:
    """Return the mean over the finite parts of each cell; NaN without a finite part."""
    parts = by_cells(values, _PARTS)
    finite = np.isfinite(parts)
    count = finite.sum(axis=(1, 3))
    total = np.where(finite, parts, 0).sum(axis=(1, 3))
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))
