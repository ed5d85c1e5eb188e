"""Walls of the sandbox from scans: inner face and top edge on each side.

Cameras see the inner face of the far walls, but only the top and the outer face of the near wall. On both kinds, the
first points above wall height, seen from the sand, belong to the inner edge.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np

from polarsim.photo import Terrain, terrain_text
from polarsim.rocks.scans import ScanPoints, wall_foot
from polarsim.run_files.walls import STRIP_M, Side, Wall, Walls, surveyed_walls, wall_strips
from polarsim.site_parts import Sandbox

log = logging.getLogger("polarsim")
MAX_OFFSET = 0.4  # maximum distance of a wall from its nominal line, metres
CORNER = 0.1  # metres at both ends of a wall that are ignored: the adjacent walls are near
FACE_STRIP = 0.02  # width of the strips in which the inner face is searched, metres
FACE_PERCENTILE = 2.0  # of the outward distances of high points: robust against single wrong points
TOP_DEPTH = (-0.02, 0.15)  # range of the outward distance from the inner face that contains the top, metres
TOP_PERCENTILE = 97.0  # of the heights in this range
MIN_POINTS = 20  # minimum number of points of a strip
MAX_DROP = 0.03  # metres: strips lower than the median top by more show only the lower part of the wall
MIN_SUPPORT = 0.3  # minimum share of the strips with points; otherwise the nominal wall is used


def measure_walls(terrain: Terrain, sandbox: Sandbox, scans: ScanPoints, level: float) -> Walls | None:
    """Measure the walls of a terrain; None for a sandbox without walls.

    `scans`: all points near the sandbox, sandbox frame.
    `level`: height of the sand, metres.
    """
    nominal = surveyed_walls(sandbox, level)
    if nominal is None:
        return None
    half = sandbox.half_width_m
    points = scans.points[scans.points[:, 2] > level + wall_foot(sandbox)]
    measured = {side: _measure(points, side, half) for side in nominal.sides}
    missing = [side for side, wall in measured.items() if wall is None]
    if missing:
        log.warning(
            "terrain %s: the scans do not show the walls %s; walls of the site used",
            terrain_text(terrain),
            ", ".join(missing),
        )
    sides = {side: wall if wall is not None else nominal.sides[side] for side, wall in measured.items()}
    return replace(nominal, sides=sides, origin="survey" if len(missing) == len(measured) else "scans")


def _measure(points: np.ndarray, side: Side, half_width_m: tuple[float, float]) -> Wall | None:
    """Return the wall of one side from points (n, 3) above wall height; None with too little support."""
    axis, sign = "xy".index(side[1]), -1.0 if side[0] == "-" else 1.0
    half = half_width_m[1 - axis]
    outward, along = sign * points[:, axis], points[:, 1 - axis]
    near = (outward > half_width_m[axis] - MAX_OFFSET) & (np.abs(along) < half - CORNER)
    outward, along, height = outward[near], along[near], points[near, 2]
    if not len(outward):
        return None
    first = _per_strip(outward, along, FACE_STRIP, FACE_PERCENTILE, min_points=1)
    if len(first) < MIN_SUPPORT * 2 * half / FACE_STRIP:
        return None
    face = float(np.median(list(first.values())))
    is_top = (outward > face + TOP_DEPTH[0]) & (outward < face + TOP_DEPTH[1])
    tops = _per_strip(height[is_top], along[is_top] + half, STRIP_M, TOP_PERCENTILE, MIN_POINTS)
    usual = np.median(list(tops.values())) if tops else 0.0
    tops = {strip: top for strip, top in tops.items() if top > usual - MAX_DROP}
    centres = wall_strips(half)
    if len(tops) < MIN_SUPPORT * len(centres):
        return None
    measured = np.array(sorted(tops))
    top = np.interp(centres, centres[measured], [tops[strip] for strip in measured])
    return Wall(face, centres, top, len(tops) / len(centres))


def _per_strip(
    values: np.ndarray, along: np.ndarray, width: float, percentile: float, min_points: int
) -> dict[int, float]:
    """Return a percentile of the values (n,) of each strip with enough points."""
    strip = np.floor(along / width).astype(int)
    order = np.argsort(strip, kind="stable")
    numbers, starts = np.unique(strip[order], return_index=True)
    parts = np.split(values[order], starts[1:])
    return {
        int(number): float(np.percentile(part, percentile))
        for number, part in zip(numbers, parts, strict=True)
        if len(part) >= min_points
    }
