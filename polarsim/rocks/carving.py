"""Rocks that a box of one position shows and no region explains: cut out of another one, or found in the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.annotated import raised
from polarsim.rocks.creases import neighbours
from polarsim.rocks.evidence import PEN_IOU, Evidence
from polarsim.rocks.ground import Sand
from polarsim.rocks.grouping import grouped
from polarsim.rocks.regions import Limits, Region, in_order, largest_piece, region_of, surface_points

FILLED = 0.65  # least IoU of what is cut out with its box: no second position speaks for it
BIN_PX = 8  # side of the squares of the photo in which only what is nearest counts as seen
DEPTH = 0.05  # metres behind the nearest within such a square that still count


@dataclass(frozen=True)
class _Cut:
    """Sand and regions with a rock that a box shows."""

    fit: float  # IoU of the rock with the box
    sand: Sand
    regions: list[Region]


@dataclass(frozen=True)
class _SeenCells:
    """All seen cells in the photo of one position."""

    cells: np.ndarray  # (n,) flat
    pixels: np.ndarray  # (n, 2)
    away: np.ndarray  # (n,) metres from the camera

    def shown(self, box: np.ndarray) -> np.ndarray:
        """(m,) cells in a box (4,) that no other one hides."""
        inside = np.flatnonzero(((self.pixels > box[:2]) & (self.pixels < box[2:])).all(axis=1))
        if not len(inside):
            return self.cells[inside]
        bins = np.floor(self.pixels[inside] / BIN_PX).astype(np.int64)
        number = np.unique(bins, axis=0, return_inverse=True)[1].ravel()
        nearest = np.full(number.max() + 1, np.inf)
        np.minimum.at(nearest, number, self.away[inside])
        return self.cells[inside[self.away[inside] < nearest[number] + DEPTH]]


def carved(sand: Sand, regions: Sequence[Region], limits: Limits, evidence: Evidence) -> tuple[Sand, list[Region]]:
    """Sand and regions after boxes that no region explains were looked into, each on its own.

    What a box shows may hang together with another rock, or have a side as gentle as sand. It counts as a rock where
    it fills the box, stands out of the ground about it, and what is left of the other rock fits its own boxes as well
    as before, at all positions. At last regions that touch are joined where boxes say so: what one position's box cuts
    out may be a piece of a rock that other positions show whole.
    """
    regions = list(regions)
    for position, boxes in evidence.unexplained(_surfaces(sand, regions)).items():
        if not len(boxes):
            continue
        cells = _seen_cells(sand, evidence, position)
        for box in boxes:
            if any(evidence.fit(position, one, box[None]) >= evidence.min_iou for one in _surfaces(sand, regions)):
                continue  # a box before this one cut out what it shows
            shown = cells.shown(box)
            cuts = (
                _cut(sand, regions, number, position, box, shown, limits, evidence)
                for number in (None, *range(len(regions)))
            )
            best = max((cut for cut in cuts if cut is not None), key=lambda cut: cut.fit, default=None)
            if best is not None:
                sand, regions = best.sand, best.regions
    return sand, in_order(_joined(sand, regions, evidence))


def _joined(sand: Sand, regions: list[Region], evidence: Evidence) -> list[Region]:
    """Regions after those that touch were joined where that makes them fit the boxes better."""
    numbers = np.zeros(sand.surface.shape, np.int64)
    for number, region in enumerate(regions, 1):
        numbers.ravel()[region.seen] = number
    reached = ndimage.grey_dilation(numbers, size=(3, 3))
    touching = [(one - 1, other - 1) for one, other in neighbours(np.where(numbers > 0, numbers, reached))]
    boxes = evidence.boxes(_surfaces(sand, regions))
    rock = grouped(np.arange(len(regions)), touching, boxes, evidence.agreed, evidence.min_iou)
    groups = [[regions[number] for number in np.flatnonzero(rock == one)] for one in np.unique(rock)]
    return [
        group[0] if len(group) == 1 else region_of(sand, np.concatenate([one.seen for one in group]), evidence)
        for group in groups
    ]


def _seen_cells(sand: Sand, evidence: Evidence, position: str) -> _SeenCells:
    cells = np.flatnonzero(np.isfinite(sand.surface))
    points, rig = surface_points(sand, cells), evidence.localised[position]
    away = np.linalg.norm(points - rig.sandbox_from_left.translation, axis=1)
    return _SeenCells(cells, rig.project("L", points), away)


def _cut(
    sand: Sand,
    regions: Sequence[Region],
    number: int | None,
    position: str,
    box: np.ndarray,
    shown: np.ndarray,
    limits: Limits,
    evidence: Evidence,
) -> _Cut | None:
    """What stands out among the flat cells (n,) that a box shows, of one region or of none; None for no rock."""
    own = np.zeros(0, np.int64) if number is None else regions[number].seen
    if number is not None and not np.isin(shown, own).any():
        return None
    others = np.concatenate([own[:0], *(region.seen for other, region in enumerate(regions) if other != number)])
    standing = raised(sand, np.setdiff1d(shown, others), limits.foot, limits.confirmed_height)
    if standing is None:
        return None
    below, region = standing
    part = region_of(below, largest_piece(below, region.seen), evidence)
    fit = evidence.fit(position, surface_points(sand, part.seen), box[None])
    if fit < FILLED or part.size < limits.size or part.height < limits.confirmed_height:
        return None
    if number is None:
        return _Cut(fit, below, [*regions, part])
    rest = np.setdiff1d(own, part.seen)
    if not len(rest) or not _fits_as_before(evidence, surface_points(sand, own), surface_points(sand, rest)):
        return None
    remaining = region_of(below, rest, evidence)
    if remaining.size < limits.size:
        return None
    return _Cut(fit, below, [*regions[:number], remaining, *regions[number + 1 :], part])


def _fits_as_before(evidence: Evidence, before: np.ndarray, after: np.ndarray) -> bool:
    """Whether points (m, 3) that are left of a rock (n, 3) fit its boxes about as well as it did; not without a box."""
    annotated_somewhere = False
    for position, annotated in evidence.agreed.items():
        fit = evidence.fit(position, before, annotated)
        if fit < evidence.min_iou:
            continue
        annotated_somewhere = True
        if evidence.fit(position, after, annotated) < fit - PEN_IOU:
            return False
    return annotated_somewhere


def _surfaces(sand: Sand, regions: Sequence[Region]) -> list[np.ndarray]:
    """(n, 3) seen points of every region."""
    return [surface_points(sand, region.seen) for region in regions]
