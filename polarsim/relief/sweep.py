"""Plane sweep: heights of the ground at which the orthophotos of several views agree.

At each height above a start surface, all photos are resampled at the cells of a grid. Where the height is right, photos
under the same Sun lamp show the same pattern of relief, albedo and shadows, from left and right and from all positions.
The correlations of all pairs of views are summed, aggregated over the grid (`aggregation`), and the best height of each
cell is kept if the correlation supports it. The sweep is repeated with finer cells and smaller ranges of heights.

The sweep was tuned on the analog's terrains 3 and 11 and on six published terrains; the analog's terrains 1 and 6 were
tests.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from polarsim.errors import ReconstructionError
from polarsim.geometry.aggregation import aggregate, minima
from polarsim.geometry.casters import make_caster
from polarsim.geometry.contrast import blurred, local_contrast
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.rays import Caster
from polarsim.photo import PhotoKey, photo_scale
from polarsim.relief.feet import MAX_CUT_M, foot_cells, foot_offset, foot_offsets
from polarsim.relief.heights import INVENTED, MEASURED, HeightMap, PhotoView
from polarsim.relief.pairs import Group
from polarsim.relief.plate import plate_filled
from polarsim.relief.views import (
    PixelsByHeight,
    cell_points,
    orthophoto,
    reduced,
    unobstructed,
)
from polarsim.rocks.folder import height_mesh
from polarsim.rocks.heights import FloorGrid, smoothed

FLOOR = 0.03  # log units: contrast of grain and noise, below which a pattern has little weight
DARK = 0.001  # share of the 99th percentile that is added to all pixels: limits the noise of shadows in logarithms
SMALL_STEP, LARGE_STEP = 0.1, 1.0  # costs of neighbouring cells that differ by one candidate, and by more
MIN_CORRELATION = 0.3  # of a measured cell
MIN_SUPPORT = 0.45  # minimum correlation of a measured cell and its neighbours, Gaussian mean
SUPPORT_CELLS = 4.0  # standard deviation of this mean, cells
MIN_EVIDENCE = 0.2  # minimum contrast of a comparable cell: twice the number of pairs times their squared contrast
SPECKLE_M2 = 0.05  # measured areas up to this size that are separated by steps are rejected
# Share of the comparable cells, bare and with contrast in several views, that must be measured. Six published terrains
# with the right photo at C: 0.31 to 0.78, but 0.14 under Suns 30 and 180. With the photo of other sand: up to 0.13.
# Terrains 1 and 3 show the same sand 11 cm apart, 11 and 12 the same crater 26 cm apart: 0.21 for the photo of 3 on 1,
# 0.14 for 12 on 11, and 0.37 for 1 on 3, whose heights contradict the feet of the rocks.
MIN_SHARE = 0.25
GROUND_DROP = 0.01  # metres by which the ground is lowered as an occluder of its own cells
# Size of a pixel of photos of the reference width on the ground, across the line of sight: POLAR's, 3.5 m / 2,070 px.
PIXEL_M = 0.0017
SD_SCALE = 0.5  # standard deviation by `_deviation`, in units of the formula; fitted to the analog's terrain 3


@dataclass(frozen=True)
class Level:
    """One sweep: cells and candidate heights."""

    cell_m: float
    reach_m: float  # maximum height above and below the start surface
    step_m: float  # between candidates
    contrast_cells: float  # standard deviation of the window of `local_contrast`

    @property
    def candidates(self) -> np.ndarray:
        """Heights (k,) above the start surface, metres."""
        count = round(self.reach_m / self.step_m)
        return np.arange(-count, count + 1) * self.step_m


# Craters are up to 0.35 m deep. A step moves patterns of different positions by about one cell.
LEVELS = (
    Level(0.03, 0.40, 0.015, 4.0),
    Level(0.02, 0.15, 0.0075, 5.0),
    Level(0.01, 0.025, 0.0025, 6.0),
    Level(0.005, 0.008, 0.001, 6.0),
)


@dataclass(frozen=True)
class Trust:
    """Window and costs, which depend on the number of pairs of views."""

    window_cells: float  # standard deviation of the window of the correlation
    level_cost: float  # cost per 0.1 m of height above the start surface: decides between equal correlations


SINGLE_PAIR, SEVERAL_PAIRS = Trust(4.0, 0.1), Trust(2.5, 0.03)


@dataclass(frozen=True)
class SweptScene:
    """Photos, comparable views, and meshes that hide the ground from cameras and lamps."""

    views: Sequence[PhotoView]
    groups: Sequence[Group]
    rocks: Mesh
    walls: Mesh
    feet: Sequence[np.ndarray] = ()  # (n, 3) points of the foot of each published rock, on the start surface

    @property
    def trust(self) -> Trust:
        """The window and costs for the number of pairs."""
        pairs = sum(len(group.signs) * (len(group.signs) - 1) // 2 for group in self.groups)
        return SINGLE_PAIR if pairs == 1 else SEVERAL_PAIRS


def sweep_ground(start: HeightMap, scene: SweptScene) -> HeightMap:
    """Return the heights of a start surface, replaced where photos measure them.

    Cells without measurement keep the start surface plus a thin plate through the offsets of measured cells.

    Raises
    ------
    ReconstructionError
        No comparable views, too few cells at which they agree, or heights that contradict the feet of rocks: photos of
        another scene, or wrong poses.
    """
    if not scene.groups:
        raise ReconstructionError("no two photos from different cameras under the same, a similar or an opposite Sun")
    grid = start.grid
    above: np.ndarray = np.zeros(start.height_m.shape)
    for level in LEVELS:
        if level.cell_m < start.grid.cell - 1e-9:
            break
        finer = FloorGrid(start.grid.extent, level.cell_m)
        points = finer.centres().reshape(-1, 2)
        base = start.grid.sample(start.height_m, points).reshape(finer.shape)
        above = grid.sample(above, points).reshape(finer.shape)
        own = [height_mesh(finer, base + above - GROUND_DROP)] if level is not LEVELS[0] else []
        offset, deviation, known, comparable = _sweep(
            finer, base + above, level, scene, join_meshes([scene.walls, *own])
        )
        if not known.any():
            break
        above, grid = _filled(finer, above + offset, known, scene.feet), finer
    _check_agreement(known, comparable)
    _check_feet(foot_offsets(grid, above, known, scene.feet))
    points = start.grid.centres().reshape(-1, 2)
    above, deviation = (grid.sample(values, points).reshape(start.grid.shape) for values in (above, deviation))
    measured = (grid.sample(known.astype(float), points) > 0.5).reshape(start.grid.shape)
    return HeightMap(
        start.grid,
        start.height_m + above,
        np.where(measured, deviation, np.inf),
        np.where(measured, MEASURED, INVENTED).astype(np.uint8),
    )


def _check_agreement(known: np.ndarray, comparable: np.ndarray) -> None:
    share = known.sum() / max(comparable.sum(), 1)
    if share < MIN_SHARE:
        raise ReconstructionError(
            f"photos agree on {share:.0%} of the ground that they show with contrast, expected {MIN_SHARE:.0%} or more"
        )


def _check_feet(offsets: np.ndarray) -> None:
    """Refuse ground that is far from the feet of published rocks, by the offsets (n,) of the ground at rocks."""
    off = float(np.median(offsets)) if len(offsets) else 0.0
    if abs(off) > MAX_CUT_M:
        raise ReconstructionError(
            f"the ground on which photos agree is {1000 * abs(off):.0f} mm {'above' if off > 0 else 'below'} the feet "
            f"of the rocks, expected {1000 * MAX_CUT_M:.0f} mm or less"
        )


def _filled(grid: FloorGrid, offset: np.ndarray, known: np.ndarray, feet: Sequence[np.ndarray]) -> np.ndarray:
    """Return offsets (rows, columns) from the start surface, with those of feet at unmeasured cells, and a plate."""
    cells = np.unique(np.concatenate([np.zeros(0, int), *foot_cells(grid, feet)]))
    given, fixed = offset.copy(), known.copy()
    cells = cells[~known.ravel()[cells]]
    given.ravel()[cells], fixed.ravel()[cells] = foot_offset(grid, offset, known, feet), True
    return plate_filled(grid, given, fixed)


def _sweep(
    grid: FloorGrid, base: np.ndarray, level: Level, scene: SweptScene, others: Mesh
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return offset from the base surface, standard deviation, and whether measured and comparable: (rows, columns)."""
    bare = ~below_rocks(grid, scene.rocks)
    correlation, evidence = _correlations(grid, base, level, scene, others, bare)
    candidates = level.candidates
    prior = (scene.trust.level_cost / 0.1) * np.abs(candidates).astype(np.float32)
    best = minima(aggregate((1 - correlation) * np.minimum(evidence, 1) + prior, SMALL_STEP, LARGE_STEP))
    nearest = np.clip(np.rint(best), 1, len(candidates) - 2).astype(int)[..., None]
    reached, contrast = (np.take_along_axis(part, nearest, axis=2)[..., 0] for part in (correlation, evidence))
    support = ndimage.gaussian_filter(reached, SUPPORT_CELLS)
    comparable = bare & (contrast > MIN_EVIDENCE)
    known = comparable & (reached > MIN_CORRELATION) & (support > MIN_SUPPORT)
    known &= (best > 0.5) & (best < len(candidates) - 1.5)
    offset = ndimage.median_filter(np.interp(best, np.arange(len(candidates)), candidates), 5)
    known = _without_speckles(base + offset, known, level)
    offset = smoothed(offset, np.where(known, np.maximum(reached, 0.05), 0.0), 1.5)
    known &= np.isfinite(offset)
    return np.nan_to_num(offset), _deviation(correlation, nearest, level.step_m), known, comparable


def _correlations(
    grid: FloorGrid, base: np.ndarray, level: Level, scene: SweptScene, others: Mesh, bare: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return correlation and contrast (rows, columns, k) of all pairs at each candidate height."""
    pixel_m = PIXEL_M / photo_scale(scene.views[0].camera.lens.width)
    points, views = cell_points(grid, base), reduced(scene.views, 3 * pixel_m / level.cell_m)
    solid = join_meshes([scene.rocks, others])
    caster = make_caster(solid.vertices, solid.faces)
    cameras = {view.key.view: view.camera for view in views}
    moving = {name: PixelsByHeight(camera, points, level.reach_m) for name, camera in cameras.items()}
    visible = {name: unobstructed(points, camera.centre, caster) & bare for name, camera in cameras.items()}
    unshaded = frozenset().union(*(group.shadows_hidden for group in scene.groups))
    shown = {
        view.key: visible[view.key.view] & (_lit(points, view.lamp_m, caster) if view.key in unshaded else True)
        for view in views
    }
    logs = {view.key: _logarithm(view.picture) for view in views}
    window = scene.trust.window_cells
    correlation, contrast = (np.empty((*grid.shape, len(level.candidates)), np.float32) for _ in range(2))
    for number, above in enumerate(level.candidates.tolist()):
        at = {name: pixels.at(above) for name, pixels in moving.items()}
        patterns = {}
        for key, values in logs.items():
            ortho = np.where(shown[key], orthophoto(values, at[key.view]), np.nan)
            patterns[key] = local_contrast(ortho, level.contrast_cells, FLOOR)
        product, norm = (blurred(part, window) for part in _products(patterns, scene.groups, grid.shape))
        correlation[..., number], contrast[..., number] = product / np.maximum(norm, 1e-3), norm
    return correlation, contrast


def _deviation(correlation: np.ndarray, nearest: np.ndarray, step: float) -> np.ndarray:
    """Return standard deviations (rows, columns) from the curvature of the correlation at its maximum.

    A flat maximum, as between left and right only, determines the height less than a sharp one.
    """
    left, middle, right = (np.take_along_axis(correlation, nearest + k, axis=2)[..., 0] for k in (-1, 0, 1))
    curvature = ndimage.gaussian_filter(np.maximum(2 * middle - left - right, 1e-4), SUPPORT_CELLS)
    missing = ndimage.gaussian_filter(np.clip(1 - middle, 0.02, 1.0), SUPPORT_CELLS)
    return np.asarray(SD_SCALE * step * np.sqrt(missing / curvature))


def _products(
    patterns: Mapping[PhotoKey, np.ndarray], groups: Sequence[Group], shape: tuple[int, int]
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


def _lit(points: np.ndarray, lamp: np.ndarray, caster: Caster) -> np.ndarray:
    """Return whether cells (rows, columns) are lit, without a margin along shadow edges."""
    return np.asarray(ndimage.binary_erosion(unobstructed(points, lamp, caster), iterations=2, border_value=1))


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
