"""Detection of small rocks that are too low for detection by slope, as convex caps on even sand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.rocks.annotated import raised
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import FOOT_MARGIN, SandSurface
from polarsim.rocks.heights import filled
from polarsim.rocks.regions import (
    MIN_HEIGHT_SHARE,
    WALL_CLEARANCE,
    Limits,
    RockRegion,
    largest_piece,
    region_of,
    sort_regions,
)

CAP_SMOOTHING = 0.012  # metres, sigma: removes caps of scanner noise, but not a rock of 4 cm
CURVATURE = 6.0  # minimum downward curvature of a cap in all directions, 1 / m; ridges and crests are straight in one
CAP_REACH = 0.11  # metres around a cap that are analysed
FLANK_WIDTH = 0.015  # metres from the convex core to the end of the foot
RING_WIDTH = 0.035  # width of the ring of sand farther out, which determines height and evenness of the ground, metres
FOOT_SHARE, FOOT = 0.25, 0.003  # share of the height, and minimum, metres, from which a cap is measured (noise below)
FIT_ROUNDS = 4  # rounds of reweighted least squares: objects on the ring lose their weight
NOISE = 1e-5  # metres: minimum residual of a surface without noise

MIN_HEIGHT = 0.005  # of a rock above the surrounding sand, metres
MAX_SIZE = 0.095  # longest side of a rock, metres; larger rocks are detected by slope

# Selected on the scenes of benchmarks/foreign.py, each left out in turn.
MIN_HEIGHT_SD = 5.0  # minimum height over the standard deviation of the ring, because of ripples and tracks
MIN_KNOWN_RING = 0.8  # minimum share of the ring that is visible and not rock: flanks of rocks look like caps
MIN_ROUNDNESS = 0.4  # minimum width over length; ripples and rims of tracks are longer


@dataclass(frozen=True)
class Cap:
    """Convex part of the surface, measured above a quadric through the surrounding ring of sand."""

    cells: np.ndarray  # (n,) flat, including its foot
    size: float  # longest horizontal side, metres
    height: float  # metres
    roundness: float  # width over length, 1 for a disc
    unevenness: float  # standard deviation of the ring about the quadric, metres
    known: float  # share of the ring that is visible and not rock

    @property
    def is_rock(self) -> bool:
        return (
            self.height >= max(MIN_HEIGHT, MIN_HEIGHT_SHARE * self.size, MIN_HEIGHT_SD * self.unevenness)
            and self.size <= MAX_SIZE
            and self.roundness >= MIN_ROUNDNESS
            and self.known >= MIN_KNOWN_RING
        )


def add_bumps(
    sand: SandSurface, regions: Sequence[RockRegion], limits: Limits, evidence: Evidence
) -> tuple[SandSurface, list[RockRegion]]:
    """Return sand and regions after adding small caps between the regions as rocks, with or without annotations.

    A rock of 5 cm rises about 1 cm, with flanks that scanner noise and the grid make as gentle as sand. It differs from
    sand by downward curvature in all directions, on sand that is much more even than the cap is high.
    """
    detected: list[RockRegion] = []
    smallest = limits.size + sand.grid.cell  # sizes on the grid are a cell larger
    for cap in caps(sand, regions):
        if cap.size < smallest - NOISE or not cap.is_rock:
            continue
        standing = raised(sand, np.setdiff1d(cap.cells, _cells(detected)), FOOT, MIN_HEIGHT)
        if standing is None:
            continue
        below, region = standing
        region = region_of(below, largest_piece(below, region.seen), evidence)
        if region.size >= limits.size and len(np.setdiff1d(region.seen, cap.cells)) == 0:
            sand = below
            detected.append(region)
    return sand, sort_regions([*regions, *detected])


def caps(sand: SandSurface, regions: Sequence[RockRegion]) -> Iterator[Cap]:
    """Yield convex caps between the regions, largest curvature first."""
    taken = np.zeros(sand.surface.shape, bool)
    taken.ravel()[_cells(regions)] = True
    taken = ndimage.binary_dilation(taken, np.ones((3, 3), bool), iterations=FOOT_MARGIN)
    known = np.isfinite(sand.surface) & ~taken
    height = filled(np.nan_to_num(sand.surface), known)
    bend = curvature(height, sand.grid.cell, CAP_SMOOTHING)
    peaks = (bend == ndimage.maximum_filter(bend, 5)) & (bend > CURVATURE) & known
    margin = round(WALL_CLEARANCE / sand.grid.cell)
    peaks[:margin] = peaks[-margin:] = peaks[:, :margin] = peaks[:, -margin:] = False
    nodes = np.argwhere(peaks)
    for node in nodes[np.argsort(-bend[peaks], kind="stable")]:
        cap = _measure_cap(height, known, taken, bend > 0, sand.grid.cell, node)
        if cap is not None:
            yield cap


def curvature(height: np.ndarray, cell: float, smoothing: float) -> np.ndarray:
    """Return the minimum downward curvature (rows, columns) of a smoothed surface over all directions, 1 / m.

    This is minus the larger eigenvalue of the matrix of second derivatives.
    """
    across, mixed, along = (
        ndimage.gaussian_filter(height.astype(np.float32), smoothing / cell, order=order) / cell**2
        for order in ((2, 0), (1, 1), (0, 2))
    )
    return np.asarray(-(across + along) / 2 - np.hypot((across - along) / 2, mixed))


def _measure_cap(
    height: np.ndarray, known: np.ndarray, taken: np.ndarray, convex: np.ndarray, cell: float, node: np.ndarray
) -> Cap | None:
    """Measure the cap at a position (2,) of the grid; None if the ring or the cap cannot be measured."""
    reach = round(CAP_REACH / cell)
    window = tuple(slice(max(0, at - reach), at + reach + 1) for at in node.tolist())
    peak = tuple(at - part.start for at, part in zip(node.tolist(), window, strict=True))
    away = ndimage.distance_transform_edt(~_part_at(convex[window], peak)) * cell
    ring = (away > FLANK_WIDTH) & (away < FLANK_WIDTH + RING_WIDTH)
    sand = ring & known[window]
    if sand.sum() < 0.5 * MIN_KNOWN_RING * ring.sum() or not ring.any():
        return None
    level, unevenness = _quadric(height[window], sand, cell)
    above = height[window] - level
    foot = max(FOOT, FOOT_SHARE * np.quantile(above[away == 0], 0.95))
    near = (away < FLANK_WIDTH) & ~taken[window]
    cap = _part_at((above > foot) & near, peak)
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


def _part_at(mask: np.ndarray, node: tuple[int, ...]) -> np.ndarray:
    """Return the connected part of a mask at a point; empty if the point is not in the mask."""
    pieces, _ = ndimage.label(mask)
    return np.asarray((pieces == pieces[node]) & mask)


def _quadric(height: np.ndarray, sand: np.ndarray, cell: float) -> tuple[np.ndarray, float]:
    """Return heights (h, w) of the quadric through the marked cells, and their standard deviation from it, metres."""
    y, x = (np.indices(height.shape) - np.array(height.shape)[:, None, None] / 2) * cell
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    weights, residuals = np.ones(int(sand.sum())), np.zeros(0)
    for _ in range(FIT_ROUNDS):
        factors = np.linalg.lstsq(terms[sand] * weights[:, None], height[sand] * weights, rcond=None)[0]
        residuals = height[sand] - terms[sand] @ factors
        spread = 1.4826 * np.median(np.abs(residuals)) + NOISE
        weights = 1 / np.sqrt(1 + (residuals / (2 * spread)) ** 2)  # Cauchy weights
    return terms @ factors, float(residuals.std())


def _roundness(mask: np.ndarray) -> float:
    """Return width over length of a mask, from its second moments, including the second moment of a cell."""
    short, long = np.linalg.eigvalsh(np.cov(np.nonzero(mask), ddof=0) + np.eye(2) / 12)
    return float(np.sqrt(short / long))


def _cells(regions: Sequence[RockRegion]) -> np.ndarray:
    return np.concatenate([np.zeros(0, np.int64), *(region.footprint for region in regions)])
