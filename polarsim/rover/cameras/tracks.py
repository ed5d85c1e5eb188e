"""Rendered ground: a fine mesh between the nodes of the drive's coarse ground, with ruts.

Untouched ground is a cubic spline through the nodes, since a low Sun would show flat cells of centimetres as squares,
some lit and some black. On the path of the wheels, levels settle first, because the physics of a wheel produces a
sawtooth of single nodes along the ruts. A cubic B-spline then interpolates the changes of the levels on the fine mesh;
positive weights prevent overshoot.

Grousers press grooves into a rut, each at the place where a grouser points straight down. The soil of the drive has
smooth wheels; marks are added to the rendered ground only. Their spacing follows the rotation and slip of the wheel.
Marks of a later wheel replace earlier marks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import ndimage
from scipy.interpolate import RectBivariateSpline
from scipy.spatial.transform import Rotation

from polarsim.rover.soil.bulldozing import settle
from polarsim.rover.soil.nodes import LEVEL, ROCK, make_soil_ground

SETTLE_DEG = 36.0  # steeper soil slides, in images as below the wheels
TILE = 16  # cells along a side of a tile, the unit that is rebuilt
_MARGIN = 8  # cells that soil may slide beyond the nodes changed by wheels
# Metres to which changes are rounded: smaller changes rebuild no mesh, and images do not depend on earlier frames.
_STEP = 1e-5
DEPTH_M, SD_M = 0.006, 0.006  # depth of a mark, and standard deviation of its Gaussian profile along the rut
_MARK_EDGE_M = 0.01  # width of the transition at the side of the wheel


@dataclass(frozen=True)
class NodeGrid:
    """Nodes of the ground before the drive: level (rows, columns) at x0 + column cell, y0 + row cell; metres."""

    x0: float
    y0: float
    cell: float
    level: np.ndarray

    @cached_property
    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Slopes along y and along x at the nodes."""
        along_y, along_x = np.gradient(self.level, self.cell)
        return along_y, along_x

    def refined(self, finer: int) -> NodeGrid:
        """Return the lattice with `finer` cells per cell along each side, on a cubic spline through the nodes."""
        if finer == 1:
            return self
        rows, columns = (np.arange((size - 1) * finer + 1) / finer for size in self.level.shape)
        spline = RectBivariateSpline(rows[::finer], columns[::finer], self.level)
        return NodeGrid(self.x0, self.y0, self.cell / finer, spline(rows, columns))


class WheelTracks:
    """Tiles that a drive changes, and their mesh at the time of the last `show`."""

    def __init__(self, lattice: NodeGrid, changed: np.ndarray, finer: int) -> None:
        """Create tiles around changed nodes (rows, columns) bool, with `finer` cells per coarse cell along a side."""
        self.lattice, self.finer = lattice, finer
        self.fine = lattice.refined(finer)
        rows, columns = lattice.level.shape
        near = ndimage.binary_dilation(changed, np.ones((3, 3), bool), iterations=_MARGIN) if changed.any() else changed
        self._whole = ((rows - 1) // TILE, (columns - 1) // TILE)
        self.tiles = _touched(near, self._whole)
        # Nodes that must not change; `settle` treats them as rock.
        self._bound = ~_inside(self.tiles, lattice.level.shape)
        self._change = np.zeros((rows + 2, columns + 2))  # with a margin for the splines
        # With a margin of one node.
        self.marks = np.zeros(((rows - 1) * finer + 3, (columns - 1) * finer + 3), np.float32)
        self._printed = np.zeros(self._whole, bool)
        self.side = TILE * finer + 1
        self._weights, self._derivative = spline_weights(TILE, finer)

    @property
    def covered(self) -> np.ndarray:
        """Cells of `fine` (rows - 1, columns - 1) bool inside tiles; the static mesh excludes them."""
        cells = np.zeros([size - 1 for size in self.fine.level.shape], bool)
        for tile in self.tiles:
            row, column = (first * self.finer for first in tile)
            cells[row : row + self.side - 1, column : column + self.side - 1] = True
        return cells

    def show(self, level: np.ndarray) -> list[int]:
        """Set the levels (rows, columns) of a time; return the indices of the tiles with a changed mesh."""
        change = np.zeros_like(self._change)
        change[1:-1, 1:-1] = np.round((self._settled(level) - self.lattice.level) / _STEP) * _STEP
        differs = change != self._change
        changed = []
        for number, (row, column) in enumerate(self.tiles):
            window = differs[row : row + TILE + 3, column : column + TILE + 3]
            if window.any() or self._printed[row // TILE, column // TILE]:
                changed.append(number)
        self._change = change
        self._printed[:] = False
        return changed

    def stamp(self, rows: slice, columns: slice, depth: np.ndarray, where: np.ndarray) -> None:
        """Write marks, metres above the ground, into a window of fine nodes (rows, columns) where `where` is true."""
        window = self.marks[1 + rows.start : 1 + rows.stop, 1 + columns.start : 1 + columns.stop]
        window[where] = depth[where]
        side = TILE * self.finer
        top, bottom = max(rows.start - 1, 0) // side, rows.stop // side + 1
        left, right = max(columns.start - 1, 0) // side, columns.stop // side + 1
        self._printed[top:bottom, left:right] = True

    def mesh(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return vertices and unit normals (v, 3) of a tile, row by row."""
        row, column = self.tiles[number]
        nodes = self._change[row : row + TILE + 3, column : column + TILE + 3]
        w, d, cell = self._weights, self._derivative, self.lattice.cell
        top, left, fine = row * self.finer, column * self.finer, cell / self.finer
        window = (slice(top, top + self.side), slice(left, left + self.side))
        level, along_y, along_x = (field[window] for field in (self.fine.level, *self.fine.slopes))
        marks = self.marks[top : top + self.side + 2, left : left + self.side + 2].astype(float)
        z = level + w @ nodes @ w.T + marks[1:-1, 1:-1]
        slope_y = along_y + d @ nodes @ w.T / cell + (marks[2:, 1:-1] - marks[:-2, 1:-1]) / (2 * fine)
        slope_x = along_x + w @ nodes @ d.T / cell + (marks[1:-1, 2:] - marks[1:-1, :-2]) / (2 * fine)
        y, x = np.meshgrid(
            self.lattice.y0 + cell * (row + np.arange(self.side) / self.finer),
            self.lattice.x0 + cell * (column + np.arange(self.side) / self.finer),
            indexing="ij",
        )
        normals = np.stack([-slope_x, -slope_y, np.ones_like(z)], axis=-1).reshape(-1, 3)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return np.stack([x, y, z], axis=-1).reshape(-1, 3), normals

    def _settled(self, level: np.ndarray) -> np.ndarray:
        """Return the levels after all soil inside the tiles has settled; levels outside the tiles are unchanged."""
        moved = np.abs(level - self.lattice.level) > 0
        if not moved.any():
            return level
        rows, columns = np.flatnonzero(moved.any(axis=1)), np.flatnonzero(moved.any(axis=0))
        part = (
            slice(max(rows[0] - _MARGIN, 0), rows[-1] + _MARGIN + 1),
            slice(max(columns[0] - _MARGIN, 0), columns[-1] + _MARGIN + 1),
        )
        ground = make_soil_ground(self.lattice.level[part], self.lattice.cell)
        ground.owner[self._bound[part]] = ROCK
        ground.state[..., LEVEL] = level[part]
        settle(ground, SETTLE_DEG)
        settled = level.copy()
        settled[part] = ground.level
        settled[self._bound] = self.lattice.level[self._bound]
        return settled


def spline_weights(cells: int, finer: int) -> tuple[np.ndarray, np.ndarray]:
    """Return weights of a uniform cubic B-spline from nodes -1 ... cells + 1 to fine nodes 0, 1/finer ... cells.

    Returns values and derivatives, two arrays (cells finer + 1, cells + 3); derivatives are in units of 1 / cell.
    """
    steps = np.arange(cells * finer + 1) / finer
    first = np.minimum(np.floor(steps).astype(int), cells - 1)
    u = steps - first
    values = np.stack([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3], axis=1) / 6
    slopes = np.stack([-((1 - u) ** 2), 3 * u**2 - 4 * u, -3 * u**2 + 2 * u + 1, u**2], axis=1) / 2
    weights, derivative = np.zeros((len(steps), cells + 3)), np.zeros((len(steps), cells + 3))
    for k in range(4):
        np.put_along_axis(weights, (first + k)[:, None], values[:, k : k + 1], axis=1)
        np.put_along_axis(derivative, (first + k)[:, None], slopes[:, k : k + 1], axis=1)
    return weights, derivative


def tile_faces(side: int) -> np.ndarray:
    """Return the faces (2 (side - 1)^2, 3) of a tile of side^2 vertices; normals point up."""
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]))
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _touched(near: np.ndarray, whole: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the first node (row, column) of each complete tile with a node near a change."""
    return [
        (row * TILE, column * TILE)
        for row in range(whole[0])
        for column in range(whole[1])
        if near[row * TILE : (row + 1) * TILE + 1, column * TILE : (column + 1) * TILE + 1].any()
    ]


def _inside(tiles: list[tuple[int, int]], shape: tuple[int, ...]) -> np.ndarray:
    """Return the nodes (rows, columns) bool two or more cells inside the tiles.

    Levels closer to the border of the tiles must not change.
    """
    covered = np.zeros(shape, bool)
    for row, column in tiles:
        covered[row : row + TILE + 1, column : column + TILE + 1] = True
    return np.asarray(ndimage.binary_erosion(covered, np.ones((3, 3), bool), iterations=2, border_value=False))


@dataclass(frozen=True)
class GrouserMark:
    """Time, position (2,) and heading (2,) of the wheel at a groove."""

    time_s: float
    position: np.ndarray
    ahead: np.ndarray


@dataclass(frozen=True)
class Tread:
    """Grousers of a wheel; metres."""

    grousers: int
    radius: float
    width: float

    @property
    def spacing(self) -> float:
        """Distance between marks of a wheel without slip."""
        return 2 * np.pi * self.radius / self.grousers


def marks_of(
    time_s: np.ndarray, spin: np.ndarray, centres: np.ndarray, quaternions: np.ndarray, soil: np.ndarray, grousers: int
) -> list[GrouserMark]:
    """Return the marks of a wheel with rotation angles `spin` (n,), radians, at times (n,) when it touches soil (n,).

    The pose of the wheel is centres (n, 3) and quaternions (n, 4) w, x, y, z; the axle is the y axis.
    """
    strikes = spin * grousers / (2 * np.pi)
    axle = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]]).apply([0.0, 1, 0])
    ahead = np.stack([axle[:, 1], -axle[:, 0]], axis=1)  # horizontal cross product of axle and up
    marks = []
    for row in np.flatnonzero(np.floor(strikes[1:]) != np.floor(strikes[:-1])):
        if not soil[row]:
            continue
        whole = max(np.floor(strikes[row]), np.floor(strikes[row + 1]))
        share = (whole - strikes[row]) / (strikes[row + 1] - strikes[row])
        position = centres[row, :2] + share * (centres[row + 1, :2] - centres[row, :2])
        direction = ahead[row] / max(np.linalg.norm(ahead[row]), 1e-9)
        marks.append(GrouserMark(float(time_s[row] + share * (time_s[row + 1] - time_s[row])), position, direction))
    return marks


def stamp_marks(tracks: WheelTracks, marks: Sequence[GrouserMark], tread: Tread) -> None:
    """Write marks into the tracks, in the given order."""
    lattice, fine, shape = tracks.lattice, tracks.fine.cell, np.array(tracks.fine.level.shape)
    reach = np.hypot(tread.spacing, tread.width) / 2 + fine
    for mark in marks:
        centre = (mark.position[::-1] - [lattice.y0, lattice.x0]) / fine  # row, column
        low = np.clip(np.floor(centre - reach / fine).astype(int), 0, shape)
        high = np.clip(np.ceil(centre + reach / fine).astype(int) + 1, 0, shape)
        if (high <= low).any():
            continue
        rows, columns = slice(low[0], high[0]), slice(low[1], high[1])
        y, x = np.meshgrid(
            (np.arange(low[0], high[0]) - centre[0]) * fine,
            (np.arange(low[1], high[1]) - centre[1]) * fine,
            indexing="ij",
        )
        along = x * mark.ahead[0] + y * mark.ahead[1]
        across = np.abs(y * mark.ahead[0] - x * mark.ahead[1])
        fade = np.clip((tread.width / 2 - across) / _MARK_EDGE_M, 0, 1)
        depth = -DEPTH_M * np.exp(-0.5 * (along / SD_M) ** 2) * fade * fade * (3 - 2 * fade)
        where = (np.abs(along) <= tread.spacing / 2) & (across <= tread.width / 2)
        tracks.stamp(rows, columns, depth.astype(np.float32), where)
