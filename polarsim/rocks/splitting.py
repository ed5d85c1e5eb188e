"""Touching rocks told apart: by the passes between their peaks, and because two convex bodies make no convex one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.heights import filled, hull_mask

SADDLE_SHARE = 0.92  # two peaks may be two rocks where the pass between is lower than this share of the lower peak
PIECE_SHARE = 0.98  # ... and two pieces, of one rock or of two, where it is lower than this one
SPLIT_SMOOTHING = 1.2  # cells: chips and noise make no peaks
ABSORBED_SHARE = 0.5  # of a region's cells in the hull of a larger one that make it a part of that one
UPRIGHT_HEIGHT = 0.03  # metres: lower things may be pebbles
SLIVER_REACH = 0.12  # metres from a sliver to the rock that it belongs to
SOLIDITY = 0.93  # share of its plan's hull that one rock fills; two discs that touch fill 0.88


@dataclass(frozen=True)
class Pieces:
    """What stands out of the ground, cut at every pass, and which pieces are one rock by shape."""

    numbers: np.ndarray  # (rows, columns) from 1; 0 outside; cells that a rock hides from the scanners are its own
    rock: np.ndarray  # (n,) number from 1 of each piece's rock


def told_apart(above: np.ndarray, labels: np.ndarray, seen: np.ndarray, lowest_peak: float) -> Pieces:
    """Cut regions into pieces, and say which pieces make a rock.

    Parameters
    ----------
    above : (rows, columns) float
        Heights above the ground, metres; of any value where nothing was seen.
    labels : (rows, columns) int
        Connected regions of what stands out of the ground, 0 outside.
    seen : (rows, columns) bool
        Cells with a measured surface.
    lowest_peak : float
        Peaks below this height, metres, are no pieces of their own.
    """
    labels = _absorbed(labels)
    bridged, labels = _bridged(np.where(seen, above, filled(above, seen)), labels, seen)
    rocks = _convex_joined(split_peaks(bridged, labels, lowest_peak, SADDLE_SHARE))
    numbers = split_peaks(bridged, labels, lowest_peak, PIECE_SHARE)
    windows = enumerate(ndimage.find_objects(numbers), 1)
    rock = [np.bincount(rocks[window][numbers[window] == number]).argmax() for number, window in windows]
    return Pieces(numbers, np.array(rock, np.int64))


def _absorbed(labels: np.ndarray) -> np.ndarray:
    """Regions that lie mostly in the hull of a larger one joined to it: an overhang hides what joins them."""
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


def _bridged(above: np.ndarray, labels: np.ndarray, seen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights and regions with the hidden cells inside a region's hull: a rock's own shadow does not cut it in two."""
    labels = labels.copy()
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        if box is None:  # absorbed by another region
            continue
        inside = hull_mask(labels[box] == number) & ~seen[box] & (labels[box] == 0)
        labels[box][inside] = number
    return np.where(labels > 0, above, 0.0), labels


def _convex_joined(parts: np.ndarray) -> np.ndarray:
    """Parts that together fill their hull made one, those that fill it best first."""
    parts = parts.copy()
    pairs = {pair: _solidity(parts, pair) for pair in neighbours(parts)}
    while pairs and max(pairs.values()) >= SOLIDITY:
        one, other = min(pairs, key=lambda pair: (-pairs[pair], pair))
        parts[parts == other] = one
        touched = {pair for pair in pairs if {one, other} & set(pair)}
        pairs = {pair: value for pair, value in pairs.items() if pair not in touched}
        numbers = {one if number == other else number for pair in touched for number in pair} - {one}
        pairs |= {pair: _solidity(parts, pair) for n in numbers for pair in [(min(one, n), max(one, n))]}
    return parts


def _solidity(parts: np.ndarray, pair: tuple[int, int]) -> float:
    union = (parts == pair[0]) | (parts == pair[1])
    union = union[ndimage.find_objects(union.astype(np.int8))[0]]
    return float(union.sum() / hull_mask(union).sum())


def slivers_joined(
    above: np.ndarray, parts: np.ndarray, cell: float, drawn: Callable[[np.ndarray], bool]
) -> np.ndarray:
    """Upright parts that nobody drew made one with a larger one beside: what hides lies between.

    Parameters
    ----------
    above : (rows, columns) float
        Heights above the ground, metres.
    parts : (rows, columns) int
        Numbered parts, 0 outside.
    cell : float
        Side of a cell, metres.
    drawn : mask (rows, columns) -> bool
        Whether people drew a part as a rock.
    """
    parts = parts.copy()
    reach = round(SLIVER_REACH / cell)
    sizes = np.bincount(parts.ravel())
    for number, box in enumerate(ndimage.find_objects(parts), 1):
        if box is None:
            continue
        height = np.where(parts[box] == number, above[box], 0.0).max()
        if not is_upright(height, max(above[box].shape) * cell) or drawn(parts == number):
            continue
        window = tuple(slice(max(0, part.start - reach), part.stop + reach) for part in box)
        sliver = parts[window] == number
        larger = (parts[window] > 0) & (sizes[parts[window]] > sizes[number])
        distance = np.where(larger, ndimage.distance_transform_edt(~sliver), np.inf)
        if distance.min() <= reach:
            parts[window][sliver] = parts[window].ravel()[distance.argmin()]
    return parts


def is_upright(height: float, width: float) -> bool:
    """Whether something is taller than wide, metres: no rock stands so on sand, edges of hidden ones and cloth do."""
    return height > max(UPRIGHT_HEIGHT, width)


def neighbours(parts: np.ndarray) -> set[tuple[int, int]]:
    """Pairs of parts (lower number first) with cells side by side."""
    sides = [(parts[:, :-1], parts[:, 1:]), (parts[:-1], parts[1:])]
    pairs = np.concatenate(
        [np.stack([a[meet], b[meet]], axis=1) for a, b in sides for meet in [(a != b) & (a * b > 0)]]
    )
    return {(int(low), int(high)) for low, high in np.unique(np.sort(pairs, axis=1), axis=0)}


def split_peaks(above: np.ndarray, labels: np.ndarray, lowest_peak: float, saddle_share: float) -> np.ndarray:
    """Regions cut where they have several peaks with a low pass between.

    Cells are visited from the highest down; a cell joins the peaks that it touches. Where it touches two, it is the
    pass between them: both become one if either peak is low above the pass, else they stay two rocks (the merge tree
    of a height field).

    Parameters
    ----------
    above : (rows, columns) float
        Heights above the ground, metres.
    labels : (rows, columns) int
        Connected regions, 0 outside.
    lowest_peak : float
        Peaks below this height, metres, are not told apart.
    saddle_share : float
        Two peaks are told apart where the pass between is lower than this share of the lower one.
    """
    smooth = np.pad(
        ndimage.gaussian_filter(above, SPLIT_SMOOTHING), 1
    )  # so that no cell's neighbour is out of the grid
    cells = np.flatnonzero(np.pad(labels, 1))
    cells = cells[np.argsort(-smooth.ravel()[cells], kind="stable")]
    heights, width = smooth.ravel().tolist(), smooth.shape[1]
    steps = [-width - 1, -width, -width + 1, -1, 1, width - 1, width, width + 1]
    owner: dict[int, int] = {}
    parent: dict[int, int] = {}
    for cell in cells.tolist():
        touched = sorted(
            {_root(parent, owner[cell + step]) for step in steps if cell + step in owner},
            key=lambda c: (-heights[c], c),
        )
        if not touched:
            parent[cell] = cell
            owner[cell] = cell
            continue
        owner[cell] = touched[0]
        for peak in touched[1:]:
            if heights[peak] < lowest_peak or heights[cell] > saddle_share * heights[peak]:
                parent[peak] = touched[0]
    result = np.zeros(smooth.size, np.int64)
    roots = [_root(parent, owner[cell]) for cell in cells.tolist()]
    result[cells] = np.unique(roots, return_inverse=True)[1] + 1 if roots else 0
    return result.reshape(smooth.shape)[1:-1, 1:-1]


def _root(parent: dict[int, int], peak: int) -> int:
    while parent[peak] != peak:
        peak = parent[peak]
    return peak
