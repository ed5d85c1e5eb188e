"""What a scan really saw: a range map without its mixed pixels, in the sandbox, cropped to the sand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose

GRAZING_JUMP = 8.0  # range steps over pixel spacings between neighbours: surface seen under less than 7 degrees
NOISE_JUMP = 0.010  # metres that noise alone (2 mm, 5 sigma) may put between neighbours
MIN_ALIKE = 5  # of 8 neighbours that must lie on a pixel's surface: so many do at a straight edge
_ALL, _BUT_LAST, _BUT_FIRST = slice(None), slice(None, -1), slice(1, None)
_NEIGHBOURS = (  # each pair of neighbours once: rows and columns of the one and of the other
    ((_ALL, _BUT_LAST), (_ALL, _BUT_FIRST)),
    ((_BUT_LAST, _ALL), (_BUT_FIRST, _ALL)),
    ((_BUT_LAST, _BUT_LAST), (_BUT_FIRST, _BUT_FIRST)),
    ((_BUT_LAST, _BUT_FIRST), (_BUT_FIRST, _BUT_LAST)),
)
FILLING = 0.7  # pixels a point, along a side, of the map that a cloud is put on: 7 of 8 pixels get one
WALL_HEIGHT = 0.12  # metres above the sand: what stands higher at the rim of the box is wall


@dataclass(frozen=True)
class ScanPoints:
    """Points of one or several scans: in the sandbox, metres."""

    points: np.ndarray  # (n, 3)
    to_scanner: np.ndarray  # (n, 3) unit vectors towards the scanner that saw the point
    weights: np.ndarray  # (n,) 1 / range^2: near scans are denser and suffer less from pose errors

    def __len__(self) -> int:
        return len(self.points)

    def select(self, chosen: np.ndarray) -> ScanPoints:
        """The points of a mask or index array (n,)."""
        return ScanPoints(self.points[chosen], self.to_scanner[chosen], self.weights[chosen])

    def scanner(self, places: np.ndarray) -> np.ndarray:
        """(n,) number of the scanner that saw each point, of scanners at places (s, 3), metres."""
        away = places[:, None] - self.points  # (s, n, 3)
        along = np.einsum("snk,nk->sn", away, self.to_scanner) / np.linalg.norm(away, axis=-1)
        return np.asarray(along.argmax(axis=0))

    def moved(self, pose: Pose) -> ScanPoints:
        """The same points after a motion."""
        return ScanPoints(pose.apply(self.points), pose.rotate(self.to_scanner), self.weights)


@dataclass(frozen=True)
class Extent:
    """A rectangle of the sandbox's floor, metres."""

    x0: float
    y0: float
    x1: float
    y1: float

    def grown(self, margin: float) -> Extent:
        return Extent(self.x0 - margin, self.y0 - margin, self.x1 + margin, self.y1 + margin)

    def snapped(self, cell: float) -> Extent:
        """The largest extent inside that begins and ends at multiples of `cell`: grids of one cell then coincide."""
        low, high = (
            np.ceil(np.array([self.x0, self.y0]) / cell - 1e-6),
            np.floor(np.array([self.x1, self.y1]) / cell + 1e-6),
        )
        return Extent(*(low * cell).tolist(), *(high * cell).tolist())

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(n,) whether points (n, 2 or 3) lie inside."""
        x, y = points[:, 0], points[:, 1]
        return (x >= self.x0) & (x <= self.x1) & (y >= self.y0) & (y <= self.y1)


def trusted_pixels(range_map: np.ndarray, focal_px: float) -> np.ndarray:
    """(h, w) bool: pixels of a range map (h, w, 3) that lie on a surface.

    A beam that meets an edge returns a range between both surfaces, and some returns are wild: such pixels are alone.
    A pixel on a surface, also at its edge, has neighbours whose range differs by no more than that of a surface that
    is seen well; surfaces seen at grazing angles go with the mixed pixels.
    """
    distance = np.linalg.norm(range_map, axis=-1)
    allowed = np.maximum(NOISE_JUMP, GRAZING_JUMP * distance / focal_px)
    alike = np.zeros(distance.shape, np.uint8)
    with np.errstate(invalid="ignore"):
        for one, other in _NEIGHBOURS:
            agree = np.abs(distance[one] - distance[other]) < allowed[one]
            alike[one] += agree
            alike[other] += agree
    return alike >= MIN_ALIKE


def place_scan(range_map: np.ndarray, trusted: np.ndarray, sandbox_from_rectified: Pose) -> ScanPoints:
    """The trusted points of a range map (h, w, 3) in the sandbox."""
    seen = range_map[trusted].astype(float)
    distance = np.linalg.norm(seen, axis=1)
    to_scanner = sandbox_from_rectified.rotate(-seen / distance[:, None])
    return ScanPoints(sandbox_from_rectified.apply(seen), to_scanner, distance**-2)


def organised(cloud: np.ndarray, lens: Lens) -> tuple[np.ndarray, Lens]:
    """A cloud (n, 3) in the rectified left frame as a range map, per pixel the nearest point, and that map's lens.

    The map is as fine as most pixels get a point, for `trusted_pixels` compares neighbours.
    """
    pixels = lens.project(cloud)
    inside = np.isfinite(pixels).all(axis=1)
    inside &= ((pixels >= 0) & (pixels < [lens.width, lens.height])).all(axis=1)
    factor = min(1.0, FILLING * np.sqrt(inside.sum() / (lens.width * lens.height)))
    coarse = lens.scaled(factor)
    column, row = np.floor(pixels[inside] * factor).astype(int).T
    column, row = np.minimum(column, coarse.width - 1), np.minimum(row, coarse.height - 1)
    seen = cloud[inside]
    order = np.argsort(-np.linalg.norm(seen, axis=1), kind="stable")  # the nearest is written last
    range_map = np.full((coarse.height, coarse.width, 3), np.nan, np.float32)
    range_map[row[order], column[order]] = seen[order]
    return range_map, coarse


def merged(scans: list[ScanPoints]) -> ScanPoints:
    """All points of several scans."""
    return ScanPoints(
        np.concatenate([scan.points for scan in scans] or [np.zeros((0, 3))]),
        np.concatenate([scan.to_scanner for scan in scans] or [np.zeros((0, 3))]),
        np.concatenate([scan.weights for scan in scans] or [np.zeros(0)]),
    )
