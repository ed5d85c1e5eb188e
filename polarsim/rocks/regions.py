"""Rocks as regions of the floor grid: what stands out of the ground, touching rocks told apart, with stable ids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain, count

import numpy as np
from scipy import ndimage

from polarsim.rocks.creases import neighbours
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import Sand
from polarsim.rocks.grouping import grouped
from polarsim.rocks.heights import hull_mask
from polarsim.rocks.splitting import Pieces, cut_apart, is_upright, slivers_joined
from polarsim.survey import SANDBOX_HALF_WIDTH

PEAK_SHARE = 0.99  # quantile of heights that counts as a region's height: one stray cell does not decide
WALL_CLEARANCE = 0.05  # metres from the sand's border within which only confirmed finds are rocks
FLATTEST = 0.16  # height over size of a rock that nobody drew: ripples, rims and heaps are flatter, scanned rocks > 0.3
SEEN_WIDTH = 0.8  # least share of a rock's width that must be seen for it to be told from what stands upright
SWEEP = np.array([0.83, 0.56])  # order along this oblique line: rocks laid in rows along a wall do not tie
ID_SIDE = 0.25  # metres of the squares that ids count
ID_LAYERS = 3  # rocks in one square that have ids of their own
ID_SQUARES = round(2 * SANDBOX_HALF_WIDTH / ID_SIDE)  # along each side of the sandbox


@dataclass(frozen=True)
class Limits:
    """What counts as a rock, metres."""

    foot: float
    height: float
    confirmed_height: float
    size: float


@dataclass(frozen=True)
class Region:
    """One rock on the floor grid."""

    seen: np.ndarray  # (n,) flat cells where its surface was seen
    footprint: np.ndarray  # (m,) these and the hidden cells between them
    centre: np.ndarray  # (2,) of the footprint
    size: float  # longest horizontal side, metres
    height: float  # above the ground, metres
    volume: float  # above the ground, m^3
    confirmed: tuple[str, ...] = ()  # positions whose seed boxes show it


@dataclass(frozen=True)
class Cut:
    """What stands out of a sand box, cut into pieces by shape alone; arrays are (rows, columns)."""

    above: np.ndarray  # heights above the ground, metres
    seen: np.ndarray  # cells with a measured surface
    pieces: Pieces


def cut_by_shape(sand: Sand, limits: Limits) -> Cut:
    """The pieces of which `find_regions` makes rocks; boxes have no part in it."""
    above, labels, seen = standing(sand, limits.foot)
    return Cut(above, seen, cut_apart(above, labels, seen, sand.grid.cell))


def find_regions(sand: Sand, limits: Limits, evidence: Evidence, cut: Cut | None = None) -> list[Region]:
    """Every rock of a sand box; `cut` is its `cut_by_shape`, for those who look more than once.

    A region is what stands higher than the foot height and somewhere higher than the rock height, and is shaped like a
    rock; where seed boxes confirm it a lower height is enough, and any shape. Touching rocks are told apart by shape,
    and by boxes where these say otherwise.
    """
    cut = cut or cut_by_shape(sand, limits)
    above, seen, pieces = cut.above, cut.seen, cut.pieces

    def points_of(mask: np.ndarray) -> np.ndarray:
        return surface_points(sand, np.flatnonzero(mask & seen))

    boxes = evidence.boxes([points_of(pieces.numbers == number) for number in range(1, len(pieces.rock) + 1)])
    touching = [(one - 1, other - 1) for one, other in neighbours(pieces.numbers)]
    rock = grouped(pieces.rock, touching, boxes, evidence.agreed, evidence.min_iou)
    labels = np.concatenate([[0], rock])[pieces.numbers] * seen
    labels = slivers_joined(above, labels, sand.grid.cell, lambda mask: bool(evidence.confirming(points_of(mask))))
    regions: list[Region] = []
    for number, box in enumerate(ndimage.find_objects(labels), 1):
        if box is None:
            continue
        region = measured_region(sand, box, labels[box] == number)
        if region.size < limits.size or region.height < limits.confirmed_height:
            continue
        confirmed = tuple(evidence.confirming(surface_points(sand, region.seen)))
        if confirmed or (_looks_like_rock(region, limits) and not _at_wall(sand, box)):
            regions.append(replace(region, confirmed=confirmed))
    return in_order(regions)


def standing(sand: Sand, foot: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights above the ground, numbers from 1 of what hangs together above the foot, and cells that were seen."""
    above = np.where(sand.is_ground, 0.0, sand.top_above)
    stands = ndimage.binary_opening((above > foot) & (sand.standing > foot), np.ones((2, 2), bool))
    return above, ndimage.label(stands, np.ones((3, 3)))[0], np.isfinite(sand.surface)


def _looks_like_rock(region: Region, limits: Limits) -> bool:
    """By shape alone: high enough, no swell of the sand, and nothing that stands upright.

    Of a rock that is as tall as wide scans hide some of the width.
    """
    upright = is_upright(region.height, region.size / SEEN_WIDTH)
    return region.height >= max(limits.height, FLATTEST * region.size) and not upright


def _at_wall(sand: Sand, box: tuple[slice, ...]) -> bool:
    """Whether a window of the grid comes near its border: what leans on a wall is a wall's or was put there."""
    margin = round(WALL_CLEARANCE / sand.grid.cell)
    return any(
        part.start < margin or part.stop > size - margin for part, size in zip(box, sand.grid.shape, strict=True)
    )


def in_order(regions: Sequence[Region]) -> list[Region]:
    """Regions along an oblique sweep."""
    return sorted(regions, key=lambda region: float(region.centre @ SWEEP))


def by_id(regions: Sequence[Region]) -> dict[int, Region]:
    """Regions by the number of the square of the sandbox in which their centre lies, from 1, along x, then along y.

    Of several in one square the largest has this number, the next one 256 more, the third one 512 more; any others
    count on from there. So a rock that comes, goes or moves by millimetres changes its own id at most, or one in its
    own square: with ranks along a sweep it changed all after it.
    """
    ids: dict[int, Region] = {}
    for region in sorted(regions, key=lambda region: (-region.size, float(region.centre @ SWEEP))):
        column, row = np.clip((region.centre + SANDBOX_HALF_WIDTH) // ID_SIDE, 0, ID_SQUARES - 1).astype(int).tolist()
        layers = [1 + column + ID_SQUARES * row + layer * ID_SQUARES**2 for layer in range(ID_LAYERS)]
        numbers = chain(layers, count(1 + ID_LAYERS * ID_SQUARES**2))
        ids[next(number for number in numbers if number not in ids)] = region
    return dict(sorted(ids.items()))


def surface_points(sand: Sand, cells: np.ndarray) -> np.ndarray:
    """(n, 3) points on the scanned surface of flat cells (n,)."""
    nodes = sand.grid.centres().reshape(-1, 2)[cells]
    return np.column_stack([nodes, sand.surface.ravel()[cells]])


def marked_region(sand: Sand, mask: np.ndarray) -> Region:
    """Measure the region that `mask` (rows, columns) marks on the whole grid; it marks something."""
    box = ndimage.find_objects(mask.astype(np.int8))[0]
    return measured_region(sand, box, mask[box])


def region_of(sand: Sand, cells: np.ndarray, evidence: Evidence) -> Region:
    """Measure the region of flat cells (n,), and ask who drew it."""
    region = marked_region(sand, _mask(sand, cells))
    return replace(region, confirmed=tuple(evidence.confirming(surface_points(sand, region.seen))))


def largest_piece(sand: Sand, cells: np.ndarray) -> np.ndarray:
    """Those of flat cells (n,) that make the largest connected piece."""
    pieces, _ = ndimage.label(_mask(sand, cells), np.ones((3, 3)))
    own = pieces.ravel()[cells]
    return cells[own == np.bincount(own).argmax()]


def _mask(sand: Sand, cells: np.ndarray) -> np.ndarray:
    mask = np.zeros(sand.surface.shape, bool)
    mask.ravel()[cells] = True
    return mask


def measured_region(sand: Sand, box: tuple[slice, ...], mask: np.ndarray) -> Region:
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
    return Region(
        seen=(rows + top_row) * width + columns + left_column,
        footprint=footprint,
        centre=nodes.mean(axis=0),
        size=float(np.ptp(nodes, axis=0).max() + sand.grid.cell),
        height=float(np.quantile(heights, PEAK_SHARE)),
        volume=float((above.sum() + heights.mean() * (covered.sum() - mask.sum())) * sand.grid.cell**2),
    )
