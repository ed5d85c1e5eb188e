"""Small rocks too low to stand out of the ground by slope, found as convex caps on even sand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.annotated import raised
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import FOOT_MARGIN, Sand
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import FLATTEST, WALL_CLEARANCE, Limits, Region, in_order, largest_piece, region_of

SMOOTHING = 0.012  # metres, sigma: scanner's noise makes no caps, and a rock of 4 cm still is one
CURVATURE = 6.0  # 1 / m that a cap bends down at least in any direction; a ridge or a ripple's crest is straight in one
REACH = 0.11  # metres about a cap that are looked at
FLANK = 0.015  # metres from the convex core to the end of the foot
RING = 0.035  # metres of sand beyond, which tell how high the ground is and how even
FOOT_SHARE, FOOT = 0.25, 0.003  # of the height, and metres at least, above which a cap is measured: noise lies below
FITS = 4  # rounds of reweighted least squares: what else stands on the ring loses its weight
NOISE = 1e-5  # metres: surfaces of no noise at all have residuals too

# Chosen on scenes of benchmarks/foreign.py, each left out in turn.
STANDING_OUT = 5.0  # height over the standard deviation of the ring: among ripples and tracks a cap must be higher
KNOWN_RING = 0.8  # of the ring that was seen and is no other rock's: beside rocks and shadows flanks look like caps
ROUNDNESS = 0.4  # width over length: what is longer is a ripple, a track's rim


@dataclass(frozen=True)
class Bumps:
    """Which caps of the sand are rocks, metres."""

    height: float  # above the sand about it, of the lowest
    largest: float  # longest side

    def __contains__(self, cap: Cap) -> bool:
        """Whether a cap is a rock."""
        return (
            cap.height >= max(self.height, FLATTEST * cap.size, STANDING_OUT * cap.unevenness)
            and cap.size <= self.largest
            and cap.roundness >= ROUNDNESS
            and cap.known >= KNOWN_RING
        )


@dataclass(frozen=True)
class Cap:
    """A convex spot of the surface, measured above sand that a quadric continues from the ring about it."""

    cells: np.ndarray  # (n,) flat, out to the end of its foot
    size: float  # longest horizontal side, metres
    height: float  # metres
    roundness: float  # width over length, 1 for a disc
    unevenness: float  # standard deviation of the ring about the quadric, metres
    known: float  # share of the ring that was seen and is no rock


def with_bumps(
    sand: Sand, regions: Sequence[Region], limits: Limits, evidence: Evidence, bumps: Bumps
) -> tuple[Sand, list[Region]]:
    """Sand and regions after small caps of the sand between the regions were made rocks, whoever drew them or not.

    A rock of 5 cm rises 1 cm or so, with flanks that the scanner's noise and the grid make as gentle as sand. What
    tells it from sand is that it bends down in all directions, on sand that is much more even than it is high.
    """
    finds: list[Region] = []
    smallest = limits.size + sand.grid.cell  # the grid widens all by its own cell
    for cap in caps(sand, regions):
        if cap.size < smallest - NOISE or cap not in bumps:
            continue
        standing = raised(sand, np.setdiff1d(cap.cells, _cells(finds)), FOOT, bumps.height)
        if standing is None:
            continue
        below, region = standing
        region = region_of(below, largest_piece(below, region.seen), evidence)
        if region.size >= limits.size and len(np.setdiff1d(region.seen, cap.cells)) == 0:
            sand = below
            finds.append(region)
    return sand, in_order([*regions, *finds])


def caps(sand: Sand, regions: Sequence[Region]) -> Iterator[Cap]:
    """Convex spots between the regions, those that bend most first."""
    taken = np.zeros(sand.surface.shape, bool)
    taken.ravel()[_cells(regions)] = True
    taken = ndimage.binary_dilation(taken, np.ones((3, 3), bool), iterations=FOOT_MARGIN)
    known = np.isfinite(sand.surface) & ~taken
    height = filled(np.nan_to_num(sand.surface), known)
    bend = curvature(height, sand.grid.cell, SMOOTHING)
    peaks = (bend == ndimage.maximum_filter(bend, 5)) & (bend > CURVATURE) & known
    margin = round(WALL_CLEARANCE / sand.grid.cell)
    peaks[:margin] = peaks[-margin:] = peaks[:, :margin] = peaks[:, -margin:] = False
    nodes = np.argwhere(peaks)
    for node in nodes[np.argsort(-bend[peaks], kind="stable")]:
        cap = _measured(height, known, taken, bend > 0, sand.grid.cell, node)
        if cap is not None:
            yield cap


def curvature(height: np.ndarray, cell: float, smoothing: float) -> np.ndarray:
    """(rows, columns) by how much a smoothed surface bends down in the direction in which it does least, 1 / m.

    That is minus the larger eigenvalue of the matrix of second derivatives.
    """
    across, mixed, along = (
        ndimage.gaussian_filter(height.astype(np.float32), smoothing / cell, order=order) / cell**2
        for order in ((2, 0), (1, 1), (0, 2))
    )
    return np.asarray(-(across + along) / 2 - np.hypot((across - along) / 2, mixed))


def _measured(
    height: np.ndarray, known: np.ndarray, taken: np.ndarray, convex: np.ndarray, cell: float, node: np.ndarray
) -> Cap | None:
    """The cap at a position (2,) of the grid; None where the sand about it or the cap itself cannot be told."""
    reach = round(REACH / cell)
    window = tuple(slice(max(0, at - reach), at + reach + 1) for at in node.tolist())
    peak = tuple(at - part.start for at, part in zip(node.tolist(), window, strict=True))
    away = ndimage.distance_transform_edt(~_piece(convex[window], peak)) * cell
    ring = (away > FLANK) & (away < FLANK + RING)
    sand = ring & known[window]
    if sand.sum() < 0.5 * KNOWN_RING * ring.sum() or not ring.any():
        return None
    level, unevenness = _quadric(height[window], sand, cell)
    above = height[window] - level
    foot = max(FOOT, FOOT_SHARE * np.quantile(above[away == 0], 0.95))
    near = (away < FLANK) & ~taken[window]
    cap = _piece((above > foot) & near, peak)
    if not cap.any():
        return None
    rows, columns = np.nonzero(near & (above > 0))
    flat = (rows + window[0].start) * height.shape[1] + columns + window[1].start
    return Cap(
        cells=flat,
        size=cell * max(np.ptp(axis) + 1 for axis in np.nonzero(cap)),
        height=float(np.quantile(above[cap], 0.97)),
        roundness=_roundness(cap),
        unevenness=unevenness,
        known=float(sand.sum() / ring.sum()),
    )


def _piece(mask: np.ndarray, node: tuple[int, ...]) -> np.ndarray:
    """The connected piece of a mask at a point; empty where the point is not in it."""
    pieces, _ = ndimage.label(mask)
    return np.asarray((pieces == pieces[node]) & mask)


def _quadric(height: np.ndarray, sand: np.ndarray, cell: float) -> tuple[np.ndarray, float]:
    """Heights (h, w) of the quadric through the marked cells, and their standard deviation about it, metres."""
    y, x = (np.indices(height.shape) - np.array(height.shape)[:, None, None] / 2) * cell
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weights, left = np.ones(int(sand.sum())), np.zeros(0)
    for _ in range(FITS):
        factors = np.linalg.lstsq(terms[sand] * weights[:, None], height[sand] * weights, rcond=None)[0]
        left = height[sand] - terms[sand] @ factors
        spread = 1.4826 * np.median(np.abs(left)) + NOISE
        weights = 1 / np.sqrt(1 + (left / (2 * spread)) ** 2)  # Cauchy's
    return terms @ factors, float(left.std())


def _roundness(mask: np.ndarray) -> float:
    """Width over length of a mask, from its second moments; that of each cell is part of it."""
    short, long = np.linalg.eigvalsh(np.cov(np.nonzero(mask), ddof=0) + np.eye(2) / 12)
    return float(np.sqrt(short / long))


def _cells(regions: Sequence[Region]) -> np.ndarray:
    return np.concatenate([np.zeros(0, np.int64), *(region.footprint for region in regions)])
