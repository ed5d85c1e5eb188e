"""What stands out of the ground cut into pieces, and pieces made rocks by shape alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.creases import Joining, Relief, chance_of_two, cut_along_creases
from polarsim.rocks.heights import filled, hull_mask

PIECE_CHANCE = 0.10  # of two rocks below which neighbours are not even two pieces
ROCK_CHANCE = 0.40  # ... and below which they are one rock
ABSORBED_SHARE = 0.5  # of a region's cells in the hull of a larger one that make it a part of that one
UPRIGHT_HEIGHT = 0.03  # metres: lower things may be pebbles
SLIVER_REACH = 0.12  # metres from a sliver to the rock that it belongs to


@dataclass(frozen=True)
class Pieces:
    """What stands out of the ground, cut along creases, and which pieces are one rock by shape."""

    numbers: np.ndarray  # (rows, columns) from 1; 0 outside; cells that a rock hides from the scanners are its own
    rock: np.ndarray  # (n,) number from 1 of each piece's rock


def cut_apart(above: np.ndarray, labels: np.ndarray, seen: np.ndarray, cell: float) -> Pieces:
    """Cut regions into pieces, and say which pieces make a rock.

    Parameters
    ----------
    above : (rows, columns) float
        Heights above the ground, metres; of any value where nothing was seen.
    labels : (rows, columns) int
        Connected regions of what stands out of the ground, 0 outside.
    seen : (rows, columns) bool
        Cells with a measured surface.
    cell : float
        Side of a cell, metres.
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
    """The surface that is cut, and the regions (rows, columns) with what overhangs and shadows cut off and hide."""
    return Relief(np.where(seen, above, filled(above, seen)), seen, cell), _bridged(_absorbed(labels), seen)


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


def _bridged(labels: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Regions with the hidden cells inside their hulls: a rock's own shadow does not cut it in two."""
    labels = labels.copy()
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        if box is None:  # absorbed by another region
            continue
        inside = hull_mask(labels[box] == number) & ~seen[box] & (labels[box] == 0)
        labels[box][inside] = number
    return labels


def slivers_joined(
    above: np.ndarray, parts: np.ndarray, cell: float, annotated: Callable[[np.ndarray], bool]
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
    annotated : mask (rows, columns) -> bool
        Whether people drew a part as a rock.
    """
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
    """Whether something is taller than wide, metres: no rock stands so on sand, edges of hidden ones and cloth do."""
    return height > max(UPRIGHT_HEIGHT, width)
