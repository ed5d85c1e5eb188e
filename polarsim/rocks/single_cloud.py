"""Detection and measurement of rocks in a single point cloud, without rig and photos (`polarsim rocks`).

Steps: `upright_points` (axis up, ground level), `stray_points`, `check_density`, then the steps of `find.py` without
seed boxes, `check_ground`, `is_free`, and sizes by `geometry.rock_axes`. All lengths of the stage are for rocks from
35 mm; for other minimum sizes the cloud is scaled, and the results are scaled back.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import ndimage
from scipy.spatial import KDTree

from polarsim.errors import FormatError, ReconstructionError, with_path
from polarsim.formats.clouds import read_any_cloud
from polarsim.formats.tables import typed
from polarsim.geometry.planes import PlanAxis, level_from, robust_plane
from polarsim.geometry.rock_axes import exposed_points, exposed_sizes, plan_sides
from polarsim.rocks.clouds import voxel_means
from polarsim.rocks.crops import CroppedRock, number_rocks, rock_of_points
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.find import CONFIRMING_IOU, detect_regions
from polarsim.rocks.ground import GROUND_CELL, SandSurface, find_ground
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.regions import RockRegion
from polarsim.rocks.scans import Extent, ScanPoints
from polarsim.schemas.stages import CLOUD_ROCKS

log = logging.getLogger("polarsim")
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}  # metres
UP_AXES = ("z", "-z", "y", "-y", "x", "-x")
MAX_TILT = np.radians(45)  # maximum inclination of the ground: a larger one is another axis
MAX_SPACING = 1.5 * GROUND_CELL  # maximum median distance of neighbouring points in plan, metres at 35 mm
MIN_SIDE = 0.2  # minimum side of the ground, metres at 35 mm
MIN_POINTS = round((MIN_SIDE / MAX_SPACING) ** 2)  # of the smallest ground at the largest spacing
MAX_CELLS = 30_000_000  # of the grid of the ground, 20 times the sandbox; about 5 GB of memory
OUTSIDE = 0.002  # share of the points that may be outside the examined rectangle on each side
SECTORS = 36  # directions around a rock
GROUND_AROUND = 0.05  # metres at 35 mm around a rock in which ground is expected, in addition to the size
MIN_SURROUNDED, MIN_SURROUNDED_ROUND = 0.6, 0.4  # minimum share of directions with ground; of round objects
ROUND = 0.5  # minimum width over length of round objects; walls are longer
MIN_GROUND = 0.5  # minimum share of the cells with points in the largest connected ground
NEIGHBOURS, STRAY_SPACING = 8, 1.5  # neighbours of a point, and maximum spacing over that of the neighbours
SAMPLE = 20_000  # points that determine plane and spacing


@dataclass(frozen=True)
class CloudRocks:
    """Rocks of a cloud in metres; the ground is level at z = 0."""

    table: pd.DataFrame  # columns of `CLOUD_ROCKS`
    heights: np.ndarray  # (rows, columns) of the surface above the level plane; NaN without points
    rock_of_cell: np.ndarray  # (rows, columns) number of the rock, 0 for ground
    axes: tuple[PlanAxis, PlanAxis]  # of columns and rows
    area_m2: float  # cells with points
    spacing: float  # median distance of neighbouring points
    tilt: float  # inclination of the ground from the axis up, radians


def find_rocks_in_cloud(path: Path, *, unit: str, up: str, min_size_mm: float) -> CloudRocks:
    """Find and measure the rocks of a cloud.

    `unit`: key of `UNITS`. `up`: one of `UP_AXES`. `min_size_mm`: minimum longest horizontal side of rocks.
    """
    options = RocksOptions()
    scale = min_size_mm / options.min_size_mm  # metres per metre of the options
    with with_path(path):
        points = UNITS[unit] * read_any_cloud(path)
        if len(points) < MIN_POINTS:
            raise FormatError(f"too few points for rocks and ground: {len(points)}, expected at least {MIN_POINTS}")
        centre = np.median(points, axis=0)  # coordinates of maps have seven digits before the decimal point
        upright, tilt = upright_points((points - centre) / scale, up)
        kept = ~stray_points(upright)
        points, upright = points[kept], upright[kept]
        if strays := int((~kept).sum()):
            log.info("%s: %d of %d points are farther apart than their neighbours, excluded", path, strays, len(kept))
        extent = _extent(upright)
        spacing = scale * check_density(upright, extent, scale, unit)
        if tilt > np.radians(1):
            log.info("%s: the ground is inclined by %.0f degrees and made level", path, np.degrees(tilt))
        level = ScanPoints(upright, np.tile([0.0, 0.0, 1.0], (len(upright), 1)), np.ones(len(upright)))
        level = level.select(extent.contains(upright))
        sand = find_ground(level, extent, GROUND_CELL)
        check_ground(sand)
        sand, regions, limits = detect_regions(sand, Evidence({}, {}, CONFIRMING_IOU), options)
        sand, cropped = number_rocks(sand, [region for region in regions if is_free(sand, region)])
        owner = rock_of_points(sand, cropped, level, limits.foot)
        file_points = points[extent.contains(upright)]
        axes = _plan_axes(points / UNITS[unit], scale / UNITS[unit] * upright, up, scale / UNITS[unit], extent)
    rows = []
    for rock, crop in cropped.items():
        chosen = owner == rock
        try:
            row = _row(sand, crop, level.select(chosen), options.rock_cell_mm / 1000, scale)
        except ReconstructionError as error:
            log.warning("%s: rock %d has no axes: %s", path, rock, error)
            continue
        at = file_points[chosen].mean(axis=0) / UNITS[unit]
        rows.append({"rock": rock, "x": at[0], "y": at[1], "z": at[2], **row})
    table = typed(rows, CLOUD_ROCKS)
    digits = {name: 6 for name, kind in CLOUD_ROCKS.dtypes.items() if kind == "float64"}
    rock_of_cell = np.zeros(sand.surface.shape, np.int64)
    for rock, crop in cropped.items():
        rock_of_cell.ravel()[crop.region.footprint] = rock
    return CloudRocks(
        table=table.round({**digits, "volume_m3": 9}),
        heights=scale * sand.surface,
        rock_of_cell=rock_of_cell,
        axes=axes,
        area_m2=float((sand.is_ground | (rock_of_cell > 0)).sum() * (scale * sand.grid.cell) ** 2),
        spacing=spacing,
        tilt=tilt,
    )


def upright_points(points: np.ndarray, up: str) -> tuple[np.ndarray, float]:
    """Return points (n, 3) with the z axis perpendicular to the ground and the ground at z = 0, and the inclination.

    The inclination of the ground from the axis `up` is in radians. An inclination above `MAX_TILT` is an error.
    """
    axis, sign = "xyz".index(up[-1]), -1 if up.startswith("-") else 1
    turned = np.roll(points, 2 - axis, axis=1) * ([1, 1, 1] if sign > 0 else [1, -1, -1])
    sample = turned[:: max(1, len(turned) // SAMPLE)]
    start = np.median(sample, axis=0)
    spread = float(np.quantile(np.abs(sample[:, 2] - start[2]), 0.9))
    plane = robust_plane(sample, max(0.02, spread / 10), rounds=30)
    tilt = float(np.arctan(np.hypot(*plane[:2])))
    if tilt > MAX_TILT:
        raise FormatError(
            f"the ground is inclined by {np.degrees(tilt):.0f} degrees from the axis {up}; choose another axis with "
            f"--up: {', '.join(UP_AXES)}"
        )
    return level_from(plane).apply(turned), tilt


def stray_points(points: np.ndarray) -> np.ndarray:
    """Return a mask (n,) of points (n, 3) that are farther apart than their neighbours are.

    Beams that hit an edge return points between both surfaces (mixed pixels), which would join rocks and ground. On
    single scans of the analog this reduces false rocks from 9 to 6.
    """
    distance, near = map(np.asarray, KDTree(points).query(points, k=min(NEIGHBOURS + 1, len(points))))
    spacing = distance[:, 1:].mean(axis=1)
    return np.asarray(spacing > STRAY_SPACING * np.median(spacing[near], axis=1))


def check_density(points: np.ndarray, extent: Extent, scale: float, unit: str) -> float:
    """Return the spacing of points (n, 3); raise a FormatError for a wrong unit or size.

    The points are too sparse, or the ground is too small or too large. Points are scaled for rocks from 35 mm; messages
    state metres (`scale` metres per metre).
    """
    sides = np.array([extent.x1 - extent.x0, extent.y1 - extent.y0])
    size = f"{scale * sides[0]:.3g} m x {scale * sides[1]:.3g} m"
    rocks = f"rocks from {1000 * scale * RocksOptions().min_size_mm / 1000:.3g} mm"
    advice = f"set the unit of the file with --unit (now {unit}), or --min-size-mm"
    if sides.min() < MIN_SIDE:
        raise FormatError(f"the cloud measures {size}, too small for {rocks}: {advice}")
    spacing = _spacing(points, extent)
    if spacing > MAX_SPACING:
        raise FormatError(
            f"the cloud measures {size} and has a point every {1000 * scale * spacing:.3g} mm, {rocks} require a point "
            f"every {1000 * scale * MAX_SPACING:.3g} mm: {advice}"
        )
    if np.prod(sides / GROUND_CELL) > MAX_CELLS:
        raise FormatError(f"the cloud measures {size}, too large for {rocks}: {advice}, or cut the cloud")
    return spacing


def check_ground(sand: SandSurface) -> None:
    """Raise a ReconstructionError if the cloud has no connected ground, for example if it consists of rocks only."""
    parts, count = ndimage.label(sand.is_ground)
    largest = np.bincount(parts.ravel())[1:].max(initial=0) if count else 0
    share = largest / max(1, np.isfinite(sand.surface).sum())
    if share < MIN_GROUND:
        raise ReconstructionError(
            f"the largest connected level surface has {100 * share:.0f} % of the points in plan, at least "
            f"{100 * MIN_GROUND:.0f} % must be ground: use a cloud that contains the ground"
        )


def is_free(sand: SandSurface, region: RockRegion) -> bool:
    """Return whether an object stands on the ground like a rock, unlike walls and objects at the border."""
    nodes = sand.grid.centres().reshape(-1, 2)[region.footprint]
    try:
        length, width = plan_sides(nodes)
    except ReconstructionError:  # cells in a row
        return False
    least = MIN_SURROUNDED_ROUND if width >= ROUND * length else MIN_SURROUNDED
    return surrounded_share(sand, region) >= least


def surrounded_share(sand: SandSurface, region: RockRegion) -> float:
    """Return the share of directions from the centre of a region in which there is ground within its size.

    Walls, cliffs and objects at the border of the cloud have ground on one side only. Behind a rock that was scanned
    from one side, ground is hidden.
    """
    grid, reach = sand.grid, region.size + GROUND_AROUND
    low, high = region.centre - reach, region.centre + reach
    corner = np.array([grid.extent.x0, grid.extent.y0])
    (column0, row0), (column1, row1) = np.maximum((np.stack([low, high]) - corner) / grid.cell, 0).astype(int)
    window = (slice(row0, row1 + 1), slice(column0, column1 + 1))
    away = grid.centres()[window][sand.is_ground[window]] - region.centre
    away = away[np.linalg.norm(away, axis=1) < reach]
    sector = (np.arctan2(away[:, 1], away[:, 0]) / (2 * np.pi) * SECTORS).astype(int) % SECTORS
    return len(np.unique(sector)) / SECTORS


def _spacing(points: np.ndarray, extent: Extent) -> float:
    """Return the median distance in plan of points (n, 3) from their nearest neighbour in a central part."""
    inside = points[extent.contains(points), :2]
    middle = np.median(inside, axis=0)
    order = np.argsort(np.abs(inside - middle).max(axis=1), kind="stable")[:SAMPLE]
    return float(np.median(np.asarray(KDTree(inside[order]).query(inside[order], k=2)[0])[:, 1]))


def _extent(points: np.ndarray) -> Extent:
    """Return the rectangle in plan that contains nearly all points (n, 3)."""
    low, high = np.quantile(points[:, :2], [OUTSIDE, 1 - OUTSIDE], axis=0)
    return Extent(*low.tolist(), *high.tolist())


def _row(sand: SandSurface, crop: CroppedRock, points: ScanPoints, cell: float, scale: float) -> dict[str, object]:
    """Return the sizes of a rock by column of `CLOUD_ROCKS`, in metres."""
    means = voxel_means(points, cell).points
    if not len(means):
        raise ReconstructionError("no point above the ground")
    exposed = exposed_sizes(*exposed_points(means, means[:, 2] - sand.grid.sample(sand.ground, means)))
    a, b, c = (scale * exposed.axes.lengths).tolist()
    return {
        "a_m": a, "b_m": b, "c_m": c,
        "a_azimuth_deg": np.degrees(exposed.axes.trend), "a_plunge_deg": np.degrees(exposed.axes.plunge),
        "height_m": scale * exposed.height, "volume_m3": scale**3 * crop.region.volume,
        "length_m": scale * exposed.length, "width_m": scale * exposed.width, "diameter_m": scale * exposed.diameter,
        "points": len(points), "visible_share": len(crop.region.seen) / len(crop.region.footprint),
    }  # fmt: skip


def _plan_axes(
    points: np.ndarray, upright: np.ndarray, up: str, scale: float, extent: Extent
) -> tuple[PlanAxis, PlanAxis]:
    """Return the axes of the grid for points (n, 3) in file coordinates and after `upright_points`, in the same unit.

    `scale` converts the rectangle `extent` and cells of `GROUND_CELL` to this unit.
    """
    axis, sign = "xyz".index(up[-1]), -1 if up.startswith("-") else 1

    def plan_axis(column: int, direction: int, low: float) -> PlanAxis:
        source = (column + axis + 1) % 3  # column of the file, as rotated by `upright_points`
        offset = float(np.median(points[:, source] - direction * upright[:, column]))
        return PlanAxis("xyz"[source], offset + direction * scale * low, direction * scale * GROUND_CELL)

    return plan_axis(0, 1, extent.x0), plan_axis(1, sign, extent.y0)
