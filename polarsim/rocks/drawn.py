"""Rocks too low and gentle to tell from sand by shape, found where boxes of two positions meet on the ground."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, product

import numpy as np
from scipy import ndimage

from polarsim.geometry.boxes import around, iou
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import Sand
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import PEAK_SHARE, Limits, Region, measured_region, numbered, surface_points

FLANK = 3  # cells about a place that may be its flanks and do not tell the ground's height below
LOWEST = 0.005  # metres that such a rock must rise above the ground about it: ripples and scanner's noise do not
RAISED = 0.001  # metres above the ground from which a cell is the rock's


def with_drawn(sand: Sand, regions: list[Region], limits: Limits, evidence: Evidence) -> tuple[Sand, list[Region]]:
    """Sand and regions after boxes that no region explains were looked into, where two positions have such boxes.

    Two boxes of different rocks meet somewhere too. A place counts as a rock where it fills both boxes and is higher
    than the ground about it.
    """
    left = evidence.unexplained([surface_points(sand, region.seen) for region in regions])
    left = {position: boxes for position, boxes in left.items() if len(boxes)}
    if len(left) < 2:
        return sand, regions
    free = np.isfinite(sand.surface) & sand.is_ground
    cells = np.flatnonzero(free)
    points = surface_points(sand, cells)
    pixels = {position: evidence.placed[position].project("L", points) for position in left}
    found: list[Region] = []
    for one, other in combinations(sorted(left), 2):
        for pair in product(left[one], left[other]):
            inside = np.ones(len(cells), bool)
            for position, box in zip((one, other), pair, strict=True):
                inside &= ((pixels[position] > box[:2]) & (pixels[position] < box[2:])).all(axis=1)
            fits = inside.any() and all(
                iou(around(pixels[position][inside])[None], box[None]) >= evidence.min_iou
                for position, box in zip((one, other), pair, strict=True)
            )
            if fits:
                raised = _raised(sand, cells[inside])
                if raised is not None and raised[1].size >= limits.size:
                    sand, region = raised
                    found.append(replace(region, confirmed=(one, other)))
    return sand, numbered([*regions, *found])


def _raised(sand: Sand, cells: np.ndarray) -> tuple[Sand, Region] | None:
    """Sand with the ground under flat cells (n,) drawn from around them, and what stands out; None: too little."""
    place = np.zeros(sand.surface.shape, bool)
    place.ravel()[cells] = True
    is_ground = sand.is_ground & ~ndimage.binary_dilation(place, iterations=FLANK)
    below = replace(sand, is_ground=is_ground, ground=filled(np.nan_to_num(sand.surface), is_ground))
    raised = place & (below.above > RAISED)
    if not raised.any() or np.quantile(below.above[raised], PEAK_SHARE) < LOWEST:
        return None
    window = ndimage.find_objects(raised.astype(np.int8))[0]
    return below, measured_region(below, window, raised[window])
