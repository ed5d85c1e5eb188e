"""Division of surfaces above the ground into pieces, and grouping of pieces into rocks by shape only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.creases import Joining, Relief, chance_of_two, cut_along_creases
from polarsim.rocks.heights import filled, hull_mask

PIECE_CHANCE = 0.10  # minimum chance of two rocks for two pieces
ROCK_CHANCE = 0.40  # minimum chance of two rocks for two rocks
ABSORBED_SHARE = 0.5  # minimum share of a region's cells in the hull of a larger region that absorbs it
UPRIGHT_HEIGHT = 0.03  # minimum height of upright objects, metres: lower objects may be pebbles
SLIVER_REACH = 0.12  # maximum distance from a sliver to its rock, metres


@dataclass(frozen=True)
class Pieces:
    """Surfaces above the ground, cut along creases, and the rock of each piece by shape."""

    numbers: np.ndarray  # (rows, columns) from 1; 0 outside; cells that a rock hides from the scanners belong to it
    rock: np.ndarray  # (n,) number from 1 of each piece's rock


def cut_into_pieces(above: np.ndarray, labels: np.ndarray, seen: np.ndarray, cell: float) -> Pieces:
    """Cut regions into pieces, and group pieces into rocks.

    `above` (rows, columns): heights above the ground, metres; arbitrary in hidden cells.
    `labels` (rows, columns): connected regions above the ground, 0 outside.
    `seen` (rows, columns): cells with a measured surface.
    `cell`: side of a cell, metres.
    """
    relief, labels = relief_and_regions(above, labels, seen, cell)
    joining = Joining(relief, cut_along_creases(relief, labels))
    pieces = joining.join_below(PIECE_CHANCE, chance_of_two)
    rocks = joining.join_below(ROCK_CHANCE, chance_of_two)
    first = np.unique(pieces, return_index=True)
    rock = rocks.ravel()[first[1][first[0] > 0]]
    numbers = np.unique(np.append(0, pieces), return_inverse=True)[1][1:].reshape(pieces.shape)
    return Pieces(numbers, np.unique(rock, return_inverse=True)[1] + 1)


def relief_and_regions(
    above: np.ndarray, labels: np.ndarray, seen: np.ndarray, cell: float
) -> tuple[Relief, np.ndarray]:
    """Return the surface, and the regions (rows, columns) joined across overhangs and shadows."""
    return Relief(np.where(seen, above, filled(above, seen)), seen, cell), _bridge(_absorb(labels), seen)


def _absorb(labels: np.ndarray) -> np.ndarray:
    """Join regions that are mostly in the hull of a larger region: an overhang hides the connection."""
    labels = labels.copy()
    boxes = ndimage.find_objects(labels)
    sizes = np.bincount(labels.ravel())
    for number in np.argsort(-sizes[1:], kind="stable") + 1:
        window = labels[boxes[number - 1]]
        inside = window[hull_mask(window == number)] if (window == number).any() else window[:0, 0]
        shares = np.bincount(inside, minlength=len(sizes)) / np.maximum(sizes, 1)
        others = np.flatnonzero((shares > ABSORBED_SHARE) & (sizes < sizes[number]))
        window[np.isin(window, others[others > 0])] = number
    return labels


def _bridge(labels: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Add hidden cells inside the hulls of regions, so that a rock's shadow does not cut it in two."""
    labels = labels.copy()
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        if box is None:  # absorbed by another region
            continue
        inside = hull_mask(labels[box] == number) & ~seen[box] & (labels[box] == 0)
        labels[box][inside] = number
    return labels


def join_slivers(
    above: np.ndarray, parts: np.ndarray, cell: float, annotated: Callable[[np.ndarray], bool]
) -> np.ndarray:
    """Join unannotated upright parts, numbered (rows, columns), with a larger part nearby: the connection is hidden."""
    parts = parts.copy()
    reach = round(SLIVER_REACH / cell)
    sizes = np.bincount(parts.ravel())
    for number, box in enumerate(ndimage.find_objects(parts), 1):
        if box is None:
            continue
        height = np.where(parts[box] == number, above[box], 0.0).max()
        if not is_upright(height, max(above[box].shape) * cell) or annotated(parts == number):
            continue
        window = tuple(slice(max(0, part.start - reach), part.stop + reach) for part in box)
        sliver = parts[window] == number
        larger = (parts[window] > 0) & (sizes[parts[window]] > sizes[number])
        distance = np.where(larger, ndimage.distance_transform_edt(~sliver), np.inf)
        if distance.min() <= reach:
            parts[window][sliver] = parts[window].ravel()[distance.argmin()]
    return parts


def is_upright(height: float, width: float) -> bool:
    """Return whether an object is higher than wide, metres, unlike rocks on sand: edges of hidden rocks, or cloth."""
    return height > max(UPRIGHT_HEIGHT, width)
