"""Rocks as regions of the floor grid: surfaces above the ground, separated where rocks touch, with stable ids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, count
from math import ceil

import numpy as np
from scipy import ndimage

from polarsim.errors import ReconstructionError
from polarsim.photo import FIRST_ID_WITHOUT_MESH
from polarsim.rocks.creases import neighbours
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import SandSurface
from polarsim.rocks.grouping import group_pieces
from polarsim.rocks.heights import hull_mask
from polarsim.rocks.splitting import Pieces, cut_into_pieces, is_upright, join_slivers

PEAK_SHARE = 0.99  # quantile of heights that defines a region's height, to ignore stray cells
WALL_CLEARANCE = 0.05  # distance from the sand's border within which only confirmed regions are rocks, metres
MIN_HEIGHT_SHARE = 0.16  # minimum height over size of an unconfirmed rock: ripples and heaps are flatter, rocks > 0.3
MIN_VISIBLE_WIDTH = 0.8  # minimum visible share of a rock's width, for the test whether it is upright
SWEEP = np.array([0.83, 0.56])  # direction of the order; oblique, so that rocks in rows along a wall do not tie
ID_SIDE = 0.25  # minimum side of the squares that define ids, metres
ID_HALF_WIDTH, ID_SQUARES = 2.0, 256  # minimum half width of the area of these squares, and maximum number of squares
ID_LAYERS = 3  # number of rocks with stable ids in a square


@dataclass(frozen=True)
class Limits:
    """Minimum heights and size of rocks, metres."""

    foot: float
    height: float
    confirmed_height: float
    size: float


@dataclass(frozen=True)
class RockRegion:
    """Rock on the floor grid."""

    seen: np.ndarray  # (n,) flat cells with a scanned surface
    footprint: np.ndarray  # (m,) these cells and the hidden cells between them
    centre: np.ndarray  # (2,) of the footprint
    size: float  # longest horizontal side, metres
    height: float  # above the ground, metres
    volume: float  # above the ground, m^3
    confirmed: tuple[str, ...] = ()  # positions with a matching seed box


@dataclass(frozen=True)
class Cut:
    """Surfaces above the ground, cut into pieces by shape only; arrays are (rows, columns)."""

    above: np.ndarray  # heights above the ground, metres
    seen: np.ndarray  # cells with a measured surface
    pieces: Pieces


def cut_by_shape(sand: SandSurface, limits: Limits) -> Cut:
    """Cut the surface above the ground into pieces for `find_regions`, without boxes."""
    above, labels, seen = standing(sand, limits.foot)
    return Cut(above, seen, cut_into_pieces(above, labels, seen, sand.grid.cell))


def find_regions(sand: SandSurface, limits: Limits, evidence: Evidence, cut: Cut | None = None) -> list[RockRegion]:
    """Return all rocks of a sand box; `cut` is the output of `cut_by_shape`, to avoid repeating it.

    A region is higher than the foot height everywhere and higher than the rock height somewhere, and has the shape of a
    rock. Regions that seed boxes confirm may be lower and have any shape. Touching rocks are separated by shape, and by
    boxes if these contradict.
    """
    cut = cut or cut_by_shape(sand, limits)
    above, seen, pieces = cut.above, cut.seen, cut.pieces

    def points_of(mask: np.ndarray) -> np.ndarray:
        return scanned_points(sand, np.flatnonzero(mask & seen))

    boxes = evidence.boxes([points_of(pieces.numbers == number) for number in range(1, len(pieces.rock) + 1)])
    touching = [(first - 1, second - 1) for first, second in neighbours(pieces.numbers)]
    rock = group_pieces(pieces.rock, touching, boxes, evidence.agreed, evidence.min_iou)
    labels = np.concatenate([[0], rock])[pieces.numbers] * seen
    labels = join_slivers(
        above, labels, sand.grid.cell, lambda mask: bool(evidence.confirming_positions(points_of(mask)))
    )
    regions: list[RockRegion] = []
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        if box is None:
            continue
        region = measure_region(sand, box, labels[box] == number)
        if region.size < limits.size or region.height < limits.confirmed_height:
            continue
        confirmed = tuple(evidence.confirming_positions(scanned_points(sand, region.seen)))
        if confirmed or (_has_rock_shape(region, limits) and not _at_wall(sand, box)):
            regions.append(replace(region, confirmed=confirmed))
    return sort_regions(regions)


def standing(sand: SandSurface, foot: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return heights above the ground, numbers from 1 of connected regions above the foot, and scanned cells."""
    above = np.where(sand.is_ground, 0.0, sand.top_above)
    stands = ndimage.binary_opening((above > foot) & (sand.standing > foot), np.ones((2, 2), bool))
    return above, ndimage.label(stands, np.ones((3, 3)))[0], np.isfinite(sand.surface)


def _has_rock_shape(region: RockRegion, limits: Limits) -> bool:
    """Return whether a region is a rock by shape: high enough, not a swell of the sand, and not upright.

    Scans hide part of the width of a rock that is as high as wide.
    """
    upright = is_upright(region.height, region.size / MIN_VISIBLE_WIDTH)
    return region.height >= max(limits.height, MIN_HEIGHT_SHARE * region.size) and not upright


def _at_wall(sand: SandSurface, box: tuple[slice, ...]) -> bool:
    """Return whether a window of the grid is near the border: objects that lean on a wall are not rocks."""
    margin = round(WALL_CLEARANCE / sand.grid.cell)
    return any(
        part.start < margin or part.stop > size - margin for part, size in zip(box, sand.grid.shape, strict=True)
    )


def sort_regions(regions: Sequence[RockRegion]) -> list[RockRegion]:
    """Return regions in the order of an oblique sweep."""
    return sorted(regions, key=lambda region: float(region.centre @ SWEEP))


def number_regions(regions: Sequence[RockRegion], half: np.ndarray) -> dict[int, RockRegion]:
    """Return regions by the number of the sandbox square that contains their centre, from 1, along x, then along y.

    Of several regions in a square, the largest has this number; the next and the third get the numbers in a second and
    third layer of squares (256 and 512 more in a sandbox of 4 m); further regions get subsequent numbers. Therefore a
    rock that is added, removed or moved by millimetres changes at most ids in the same square; ranks along a sweep
    would change all ids after it.

    `half` (2,): half the width of the sand along X and Y, metres.
    """
    reach, side, shape = _id_squares(half)
    squares = int(np.prod(shape))
    ids: dict[int, RockRegion] = {}
    for region in sorted(regions, key=lambda region: (-region.size, float(region.centre @ SWEEP))):
        column, row = np.clip((region.centre + reach) // side, 0, shape - 1).astype(int).tolist()
        layers = [1 + column + int(shape[0]) * row + layer * squares for layer in range(ID_LAYERS)]
        numbers = chain(layers, count(1 + ID_LAYERS * squares))
        ids[next(number for number in numbers if number not in ids)] = region
    if max(ids, default=0) >= FIRST_ID_WITHOUT_MESH:
        raise ReconstructionError(
            f"{len(ids)} rocks: too many for ids below {FIRST_ID_WITHOUT_MESH}, raise rocks.min_size_mm"
        )
    return dict(sorted(ids.items()))


def _id_squares(half: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Return half widths (2,) of the area of the squares that define ids, their side, metres, and their number (2,).

    The area of small sandboxes is that of a sandbox of 4 m. The squares of large sandboxes are larger, so that ids of
    `ID_LAYERS` rocks in each square remain below those of rocks without a mesh.
    """
    if half.max() <= ID_HALF_WIDTH:
        half = np.full(2, ID_HALF_WIDTH)
    side = ID_SIDE
    while (number := ceil(2 * half[0] / side) * ceil(2 * half[1] / side)) > ID_SQUARES:
        side *= max(1.001, (number / ID_SQUARES) ** 0.25)
    return half, side, np.array([ceil(2 * along / side) for along in half])


def scanned_points(sand: SandSurface, cells: np.ndarray) -> np.ndarray:
    """Return points (n, 3) on the scanned surface of flat cells (n,)."""
    nodes = sand.grid.centres().reshape(-1, 2)[cells]
    return np.column_stack([nodes, sand.surface.ravel()[cells]])


def measure_mask(sand: SandSurface, mask: np.ndarray) -> RockRegion:
    """Measure the region that the non-empty `mask` (rows, columns) marks on the entire grid."""
    box = ndimage.find_objects(mask.astype(np.int8))[0]
    return measure_region(sand, box, mask[box])


def region_of(sand: SandSurface, cells: np.ndarray, evidence: Evidence) -> RockRegion:
    """Measure the region of flat cells (n,), and add the positions that confirm it."""
    region = measure_mask(sand, _mask(sand, cells))
    return replace(region, confirmed=tuple(evidence.confirming_positions(scanned_points(sand, region.seen))))


def largest_piece(sand: SandSurface, cells: np.ndarray) -> np.ndarray:
    """Return the cells of the largest connected part of flat cells (n,)."""
    pieces, _ = ndimage.label(_mask(sand, cells), np.ones((3, 3)))
    piece = pieces.ravel()[cells]
    return cells[piece == np.bincount(piece).argmax()]


def _mask(sand: SandSurface, cells: np.ndarray) -> np.ndarray:
    mask = np.zeros(sand.surface.shape, bool)
    mask.ravel()[cells] = True
    return mask


def measure_region(sand: SandSurface, box: tuple[slice, ...], mask: np.ndarray) -> RockRegion:
    """Measure the region that `mask` marks in a window of the grid."""
    rows, columns = np.nonzero(mask)
    hidden = ~np.isfinite(sand.surface[box])
    covered = mask | (hidden & hull_mask(mask))
    footprint_rows, footprint_columns = np.nonzero(covered)
    above = np.where(mask, sand.above[box], 0.0)
    heights = above[mask]
    width = sand.grid.shape[1]
    top_row, left_column = box[0].start, box[1].start
    footprint = (footprint_rows + top_row) * width + footprint_columns + left_column
    nodes = sand.grid.centres().reshape(-1, 2)[footprint]
    return RockRegion(
        seen=(rows + top_row) * width + columns + left_column,
        footprint=footprint,
        centre=nodes.mean(axis=0),
        size=float(np.ptp(nodes, axis=0).max() + sand.grid.cell),
        height=float(np.quantile(heights, PEAK_SHARE)),
        volume=float((above.sum() + heights.mean() * (covered.sum() - mask.sum())) * sand.grid.cell**2),
    )
