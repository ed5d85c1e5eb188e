"""What a scan really saw: points of a range map or cloud without mixed pixels and wild returns, in the left frame."""

from __future__ import annotations

import numpy as np

from polarsim.formats import nasa
from polarsim.geometry.lens import Lens
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.run_files.inventory import Inventory

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


def read_scan(inventory: Inventory, position: str, rig: StereoRig) -> np.ndarray:
    """(n, 3) points of a position's scan in its left camera's frame, metres; the range map where there are both.

    Raises
    ------
    FormatError
        The file is not what it should be.
    """
    grid = rectified_left(rig)
    lens, path = grid.lens, inventory.range_maps.get(position)
    if path is not None:
        range_map = nasa.read_range_map(path, (lens.width, lens.height))
    else:
        range_map, lens = organised(nasa.read_cloud(inventory.clouds[position]), lens)
    trusted = range_map[trusted_pixels(range_map, lens.fx)]
    return np.asarray(grid.left_from_rectified.apply(trusted.astype(float)))


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
