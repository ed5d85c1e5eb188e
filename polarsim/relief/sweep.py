"""Plane sweep: heights of the ground at which the orthophotos of several views agree.

At each height above a start surface, all photos are resampled at the cells of a grid. Where the height is right, photos
under the same Sun lamp show the same pattern of relief, albedo and shadows, from left and right and from all positions.
The correlations of all pairs of views are summed, aggregated over the grid (`aggregation`), and the best height of each
cell is kept if the correlation supports it. The sweep is repeated with finer cells and smaller ranges of heights.

The sweep was tuned on the analog's terrain 3 and on published cover photos; terrains 1, 6 and 11 were tests.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.relief.aggregation import aggregate, minima
from polarsim.relief.heights import INVENTED, MEASURED, HeightMap, PhotoView
from polarsim.relief.pairs import Group
from polarsim.relief.views import PixelsByHeight, cell_points, local_contrast, orthophoto, reduced, unobstructed
from polarsim.rocks.folder import height_mesh
from polarsim.rocks.heights import FloorGrid, filled, smoothed

log = logging.getLogger("polarsim")
FLOOR = 0.03  # log units: contrast of grain and noise, below which a pattern has little weight
DARK = 0.004  # share of the brightest percentile that is added to all pixels: limits the noise of shadows in logarithms
LEVEL_COST = 0.03  # cost per 0.1 m of height above the start surface: decides between equal correlations
SMALL_STEP, LARGE_STEP = 0.1, 1.0  # costs of neighbouring cells that differ by one candidate, and by more
MIN_CORRELATION = 0.3  # of a measured cell
MIN_SUPPORT = 0.4  # minimum correlation of a measured cell and its neighbours, Gaussian mean
SUPPORT_CELLS = 4.0  # standard deviation of this mean, cells
SPECKLE_M2 = 0.01  # measured areas up to this size that are separated by steps are rejected
GROUND_DROP = 0.01  # metres by which the ground is lowered as an occluder of its own cells
PIXEL_M = 0.0017  # size of a pixel on the ground, across the line of sight


@dataclass(frozen=True)
class Level:
    """One sweep: cells and candidate heights."""

    cell_m: float
    reach_m: float  # maximum height above and below the start surface
    step_m: float  # between candidates
    contrast_cells: float  # standard deviation of the window of `local_contrast`
    window_cells: float = 2.5  # standard deviation of the window of the correlation

    @property
    def candidates(self) -> np.ndarray:
        """Heights (k,) above the start surface, metres."""
        count = round(self.reach_m / self.step_m)
        return np.arange(-count, count + 1) * self.step_m


# Craters are up to 0.35 m deep. A step moves patterns of different positions by about one cell.
LEVELS = (
    Level(0.03, 0.40, 0.015, 4.0),
    Level(0.02, 0.06, 0.005, 5.0),
    Level(0.01, 0.025, 0.0025, 6.0),
    Level(0.005, 0.008, 0.001, 6.0),
)


def sweep_ground(
    start: HeightMap, views: Sequence[PhotoView], groups: Sequence[Group], rocks: Mesh, walls: Mesh
) -> HeightMap:
    """Return the heights of a start surface, replaced where photos measure them.

    Cells without measurement keep the start surface plus the offset of measured cells around them, as a membrane.

    Parameters
    ----------
    views : sequence of PhotoView
        Photos of a single terrain.
    groups : sequence of Group
        Views whose patterns are compared (`pairs.comparable_groups`).
    rocks, walls : Mesh
        Hide the ground from cameras, sandbox frame. Ground below rocks is not measured.
    """
    grid, above, known = start.grid, np.zeros(start.height_m.shape), np.zeros(start.height_m.shape, bool)
    quality = np.zeros(start.height_m.shape)
    levels = [level for level in LEVELS if level.cell_m >= start.grid.cell - 1e-9 or level is LEVELS[0]]
    for number, level in enumerate(levels):
        finer = FloorGrid(start.grid.extent, level.cell_m)
        points = finer.centres().reshape(-1, 2)
        base = start.grid.sample(start.height_m, points).reshape(finer.shape)
        above = grid.sample(above, points).reshape(finer.shape)
        own = [height_mesh(finer, base + above - GROUND_DROP)] if number else []
        offset, quality, known = _sweep(finer, base + above, level, views, groups, rocks, join_meshes([walls, *own]))
        above = filled(np.where(known, above + offset, 0.0), known)
        grid = finer
    points = start.grid.centres().reshape(-1, 2)
    above, quality = (grid.sample(values, points).reshape(start.grid.shape) for values in (above, quality))
    measured = (grid.sample(known.astype(float), points) > 0.5).reshape(start.grid.shape)
    return HeightMap(
        start.grid,
        start.height_m + above,
        np.where(measured, quality, start.sd_m),
        np.where(measured, MEASURED, start.kind).astype(np.uint8),
    )


def _sweep(
    grid: FloorGrid,
    base: np.ndarray,
    level: Level,
    views: Sequence[PhotoView],
    groups: Sequence[Group],
    rocks: Mesh,
    others: Mesh,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return offset from the base surface, standard deviation, and whether measured; each (rows, columns)."""
    import cv2

    points = cell_points(grid, base)
    views = reduced(views, 3 * PIXEL_M / level.cell_m)
    both = join_meshes([rocks, others])
    caster = make_caster(both.vertices, both.faces)
    bare = ~below_rocks(grid, rocks)
    cameras = {view.key.view: view.camera for view in views}
    pixels = {key: PixelsByHeight(camera, points, level.reach_m) for key, camera in cameras.items()}
    visible = {key: unobstructed(points, camera.centre, caster) & bare for key, camera in cameras.items()}
    logs = {view.key: _logarithm(view.picture) for view in views}
    shown = {view.key: visible[view.key.view] for view in views}
    for view in views:
        if any(view.key in group.shadows_hidden for group in groups):
            shown[view.key] = shown[view.key] & _lit(points, view.lamp_m, caster)

    def contrast(view: PhotoView, above: float, at: np.ndarray) -> np.ndarray:
        values = np.where(shown[view.key], orthophoto(logs[view.key], at), np.nan)
        return local_contrast(values, level.contrast_cells, FLOOR)

    candidates = level.candidates
    correlation, evidence = (np.empty((*grid.shape, len(candidates)), np.float32) for _ in range(2))
    for number, above in enumerate(candidates.tolist()):
        at = {key: moved.at(above) for key, moved in pixels.items()}
        patterns = {view.key: contrast(view, above, at[view.key.view]) for view in views}
        product, norm = _products(patterns, groups, grid.shape)
        norm = cv2.GaussianBlur(norm, (0, 0), level.window_cells)
        correlation[..., number] = cv2.GaussianBlur(product, (0, 0), level.window_cells) / np.maximum(norm, 1e-3)
        evidence[..., number] = norm
    cost = (1 - correlation) * np.minimum(evidence, 1) + LEVEL_COST * np.abs(candidates / 0.1).astype(np.float32)
    best = minima(aggregate(cost, SMALL_STEP, LARGE_STEP))
    nearest = np.clip(np.rint(best), 0, len(candidates) - 1).astype(int)[..., None]
    reached = np.take_along_axis(correlation, nearest, axis=2)[..., 0]
    support = cv2.GaussianBlur(reached, (0, 0), SUPPORT_CELLS)
    known = bare & (reached > MIN_CORRELATION) & (support > MIN_SUPPORT)
    known &= np.take_along_axis(evidence, nearest, axis=2)[..., 0] > 0.2
    known &= (best > 0.5) & (best < len(candidates) - 1.5)
    offset = ndimage.median_filter(np.interp(best, np.arange(len(candidates)), candidates), 5)
    known = _without_speckles(base + offset, known, level)
    offset = smoothed(offset, np.where(known, np.maximum(reached, 0.05), 0.0), 1.5)
    known &= np.isfinite(offset)
    return np.nan_to_num(offset), level.step_m * np.sqrt(np.maximum(1 - reached, 0.05)), known


def _products(
    patterns: Mapping[object, np.ndarray], groups: Sequence[Group], shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return sums (rows, columns) over all pairs of each group: products of patterns, and their norm."""
    product, norm = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    for group in groups:
        total, squares, count = (np.zeros(shape, np.float32) for _ in range(3))
        for key, sign in group.signs.items():
            pattern = patterns[key]
            total += np.float32(sign) * pattern
            squares += pattern**2
            count += pattern != 0
        product += total**2 - squares
        norm += np.maximum(count - 1, 0) * squares
    return product, norm


def _logarithm(picture: np.ndarray) -> np.ndarray:
    """Return the logarithm (h, w) of a picture, with a small constant that limits the noise of shadows."""
    bright = float(np.nanpercentile(picture, 99))
    return np.log(np.maximum(picture, 0) + max(DARK * bright, 1e-9)).astype(np.float32)


def _lit(points: np.ndarray, lamp: np.ndarray, caster: object) -> np.ndarray:
    """Return whether cells (rows, columns) are lit, without a margin along shadow edges."""
    return np.asarray(ndimage.binary_erosion(unobstructed(points, lamp, caster), iterations=2, border_value=1))  # type: ignore[arg-type]


def below_rocks(grid: FloorGrid, rocks: Mesh) -> np.ndarray:
    """Return whether cells (rows, columns) are below a rock."""
    if not len(rocks.faces):
        return np.zeros(grid.shape, bool)
    centres = grid.centres().reshape(-1, 2)
    high = np.column_stack([centres, np.full(len(centres), rocks.vertices[:, 2].max() + 1.0)])
    distance, _ = make_caster(rocks.vertices, rocks.faces).nearest(high, np.broadcast_to([0.0, 0.0, -1.0], high.shape))
    return np.isfinite(distance).reshape(grid.shape)


def _without_speckles(height: np.ndarray, known: np.ndarray, level: Level) -> np.ndarray:
    """Reject small known areas that are separated from others by steps of several candidates."""
    import cv2

    unit = level.step_m / 100
    steps = np.where(known, np.clip(np.rint(height / unit), -32000, 32000), 32767).astype(np.int16)
    cv2.filterSpeckles(steps, 32767, round(SPECKLE_M2 / level.cell_m**2), 300)
    return known & (steps != 32767)
