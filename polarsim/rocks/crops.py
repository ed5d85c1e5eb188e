"""Combination of detected regions with cuboids and ids of the override file, and assignment of points to rocks."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from scipy import ndimage

from polarsim.rocks.ground import FOOT_MARGIN, SandSurface
from polarsim.rocks.heights import filled
from polarsim.rocks.overrides import Cuboid, Overrides
from polarsim.rocks.regions import WALL_CLEARANCE, RockRegion, measure_mask, number_regions
from polarsim.rocks.scans import ScanPoints
from polarsim.rocks.splitting import is_upright

log = logging.getLogger("polarsim")
CUBOID_BELOW = 0.010  # metres from the lowest ground at a rock down to the bottom of its cuboid
CUBOID_ABOVE = 0.005  # metres from the highest point of a rock up to the top of its cuboid
LEANING_HEIGHT = 0.03  # minimum height above the ground of objects that lean on the border, metres
POSITION_REACH = 0.03  # maximum distance between a region and the position at which it keeps an id, metres
LOWEST_POINT = 0.001  # minimum height above the ground of a rock's points, metres


@dataclass(frozen=True)
class CroppedRock:
    """Rock of a terrain: region, cropping cuboid, and source (`scan` or `override`)."""

    region: RockRegion
    cuboid: Cuboid
    source: str


def crop_rocks(
    sand: SandSurface, regions: Sequence[RockRegion], overrides: Overrides, foot: float, half: np.ndarray
) -> tuple[SandSurface, dict[int, CroppedRock]]:
    """Return rocks by id after the overrides, and the sand with everything else as ground.

    `half` (2,): half the width of the sand along X and Y, metres.
    """
    finds = _keep_ids(sand, regions, overrides.positions, half)
    for rock in overrides.drop:
        if finds.pop(rock, None) is None:
            log.warning("rock %d cannot be dropped: no detected rock has this id", rock)
    sand = _without_ground(sand, overrides.cuboids)
    rocks: dict[int, CroppedRock] = {}
    for rock, cuboid in overrides.cuboids.items():
        region = _cropped(sand, cuboid, foot)
        if region is None:
            log.warning("rock %d: its cuboid contains nothing above the ground", rock)
        else:
            rocks[rock] = CroppedRock(region, cuboid, "override")
    finds = {n: r for n, r in finds.items() if not any(_is_inside(r, c) for c in overrides.cuboids.values())}
    for number, region in _renumber(finds, overrides.cuboids).items():
        rocks[number] = CroppedRock(region, _around(sand, region), "scan")
    return _with_rest_as_ground(sand, [rock.region for rock in rocks.values()]), dict(sorted(rocks.items()))


def number_rocks(sand: SandSurface, regions: Sequence[RockRegion]) -> tuple[SandSurface, dict[int, CroppedRock]]:
    """Return rocks numbered from 1 in the order of regions, and the sand with everything else as ground."""
    rocks = {number: CroppedRock(region, _around(sand, region), "scan") for number, region in enumerate(regions, 1)}
    return _with_rest_as_ground(sand, regions), rocks


def rock_of_points(sand: SandSurface, rocks: dict[int, CroppedRock], scans: ScanPoints, foot: float) -> np.ndarray:
    """Return the id (n,) of the rock of each point; 0 for all other points.

    Points in cells next to a rock belong to it if they are higher than the foot height, because its flank overhangs
    these cells. Lower points are sand.
    """
    owner = np.zeros(sand.surface.size, np.int64)
    for rock, crop in rocks.items():
        owner[crop.region.seen] = rock
    distance, nearest = ndimage.distance_transform_edt((owner == 0).reshape(sand.surface.shape), return_indices=True)
    owner = owner.reshape(sand.surface.shape)[tuple(nearest)]
    owner[(distance > FOOT_MARGIN) | sand.is_ground] = 0
    cells = sand.grid.cell_of(scans.points)
    rock_of_point = np.where(cells >= 0, owner.ravel()[cells], 0)
    above = scans.points[:, 2] - sand.grid.sample(sand.ground, scans.points)
    beside = (distance > 0).ravel()[cells]
    rock_of_point[above < np.where(beside, foot, LOWEST_POINT)] = 0
    for rock, crop in rocks.items():
        if crop.source == "override":
            outside = ((scans.points < crop.cuboid.low) | (scans.points > crop.cuboid.high)).any(axis=1)
            rock_of_point[outside & (rock_of_point == rock)] = 0
    return rock_of_point


def _keep_ids(
    sand: SandSurface, regions: Sequence[RockRegion], positions: Mapping[int, np.ndarray], half: np.ndarray
) -> dict[int, RockRegion]:
    """Return regions by id: regions at the given positions (2,) keep the given ids, the rest is renumbered."""
    finds, kept, cells = number_regions(regions, half), {}, sand.grid.centres().reshape(-1, 2)
    for rock, position in positions.items():
        gaps = {
            number: np.linalg.norm(cells[region.footprint] - position, axis=1).min() for number, region in finds.items()
        }
        nearest = min(gaps, key=lambda number: (gaps[number], number), default=None)
        if nearest is None or gaps[nearest] > POSITION_REACH:
            log.warning("rock %d: no detected rock at %.3f, %.3f", rock, *position)
        else:
            kept[rock] = finds.pop(nearest)
    return dict(sorted((kept | _renumber(finds, positions)).items()))


def _renumber(finds: Mapping[int, RockRegion], taken: Collection[int]) -> dict[int, RockRegion]:
    """Return regions by unique id: a region with an id in `taken` gets the next free number."""
    free = count(max([*finds, *taken, 0]) + 1)
    return {next(free) if number in taken else number: region for number, region in finds.items()}


def _is_inside(region: RockRegion, cuboid: Cuboid) -> bool:
    return bool((region.centre > cuboid.low[:2]).all() and (region.centre < cuboid.high[:2]).all())


def _cells_of(sand: SandSurface, cuboid: Cuboid) -> np.ndarray:
    """Return a mask (rows, columns) of the cells with a surface in a cuboid."""
    nodes = sand.grid.centres()
    inside = ((nodes > cuboid.low[:2]) & (nodes < cuboid.high[:2])).all(axis=-1)
    heights = np.nan_to_num(sand.surface, nan=np.inf)
    return inside & (heights > cuboid.low[2]) & (heights < cuboid.high[2])


def _without_ground(sand: SandSurface, cuboids: dict[int, Cuboid]) -> SandSurface:
    """Return the sand without ground inside cuboids."""
    if not cuboids:
        return sand
    is_ground = sand.is_ground.copy()
    for cuboid in cuboids.values():
        is_ground &= ~_cells_of(sand, cuboid)
    return replace(sand, is_ground=is_ground, ground=filled(np.nan_to_num(sand.surface), is_ground))


def _cropped(sand: SandSurface, cuboid: Cuboid, foot: float) -> RockRegion | None:
    mask = _cells_of(sand, cuboid) & (sand.above > foot)
    if not mask.any():
        return None
    return measure_mask(sand, mask)


def _around(sand: SandSurface, region: RockRegion) -> Cuboid:
    """Return the cuboid of a region, rounded outwards to the millimetre."""
    nodes = sand.grid.centres().reshape(-1, 2)[region.footprint]
    margin = sand.grid.cell * (0.5 + FOOT_MARGIN)
    bottom = sand.ground.ravel()[region.footprint].min() - CUBOID_BELOW
    top = np.nanmax(sand.surface.ravel()[region.seen]) + CUBOID_ABOVE
    low = np.array([*(nodes.min(axis=0) - margin), bottom])
    high = np.array([*(nodes.max(axis=0) + margin), top])
    return Cuboid(np.floor(low * 1000) / 1000, np.ceil(high * 1000) / 1000)


def _leaning_objects(sand: SandSurface) -> np.ndarray:
    """Return a mask (rows, columns) of objects above the sand that reach the border, such as cloth or a board."""
    standing, _ = ndimage.label(sand.above > LEANING_HEIGHT, np.ones((3, 3)))
    inner = np.zeros(standing.shape, bool)
    margin = round(WALL_CLEARANCE / sand.grid.cell)
    inner[margin:-margin, margin:-margin] = True
    return np.isin(standing, np.setdiff1d(standing[~inner], 0))


def _upright_objects(sand: SandSurface, taken: np.ndarray) -> np.ndarray:
    """Return a mask (rows, columns) of upright objects outside the cells that are taken."""
    above = np.where(taken | sand.is_ground, 0.0, sand.above)
    parts, _ = ndimage.label(above > LEANING_HEIGHT / 2, np.ones((3, 3)))
    upright = [
        number
        for number, box in enumerate(ndimage.find_objects(parts), 1)
        if is_upright(above[box][parts[box] == number].max(), max(parts[box].shape) * sand.grid.cell)
    ]
    return np.isin(parts, upright)


def _with_rest_as_ground(sand: SandSurface, regions: Sequence[RockRegion]) -> SandSurface:
    """Mark pebbles, ripples and steep sand as ground: all scanned cells without rocks, leaning and upright objects."""
    taken = np.zeros(sand.surface.shape, bool)
    for region in regions:
        taken.ravel()[region.footprint] = True
    taken |= _leaning_objects(sand) | _upright_objects(sand, taken)
    taken = ndimage.binary_dilation(taken, np.ones((3, 3), bool), iterations=FOOT_MARGIN)
    is_ground = np.isfinite(sand.surface) & ~taken | sand.is_ground
    return replace(sand, is_ground=is_ground, ground=filled(np.nan_to_num(sand.surface), is_ground))
