"""Registration of all scans of a terrain: levelling on the sand, pairwise search by relief, joint alignment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from polarsim.cameras import icp
from polarsim.cameras.heightmaps import agreement, correlate_rotations, relief_correlation
from polarsim.cameras.search_area import SearchArea
from polarsim.errors import RegistrationError
from polarsim.geometry.planes import level_from, tracked_plane
from polarsim.geometry.poses import Pose

VOXEL = 0.012  # metres: grid of the thinned scans for the joint alignment
MAP_STEP = 0.02  # metres: grid of the correlated height maps
YAW_RANGE_DEG, YAW_STEP_DEG = 15.0, 1.0  # of the search between two scans; the survey is accurate to a few degrees
CANDIDATES = 5  # number of correlation peaks that are refined by ICP
SAME_SURFACE = 0.01  # metres: maximum distance between points of two scans on the same surface
MIN_FITNESS = 0.5  # part of the overlap that must agree between scans
MIN_RELIEF_CORRELATION = 0.5  # minimum correlation of relief between scans of the same terrain; 0.9 is usual
SAND_SCALES = [0.4, 0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.06, 0.06]  # metres: scales of the robust fit of the sand
MIN_SAND_POINTS = 1000
MIN_RELIEF = 0.005  # minimum standard deviation, metres: the relief of flatter scans cannot be compared
HEIGHT_REACH = 1.0  # metres from the sand's level; curtains and stands are higher
MAX_LEVEL_HEIGHT, MIN_FLAT_NORMAL = 0.2, 0.8  # sand near the walls: maximum |z|, metres, and minimum |z| of normals
COARSE_VOXELS = [0.04, 0.02]  # metres
AGREE = 0.015  # maximum height difference in a cell of two scans that agree, metres


@dataclass(frozen=True)
class Pair:
    """Two aligned scans."""

    fixed: str
    moving: str
    alignment: icp.Alignment
    agreement: float  # share of the common ground with equal heights


@dataclass(frozen=True)
class Network:
    """Scans in a common level frame; `level_from_left` of every registered position."""

    level_from_left: dict[str, Pose]
    pairs: list[Pair]
    covariances: dict[str, np.ndarray]  # (6, 6) rotation, translation; level frame, relative to the mean of the scans
    points: dict[str, np.ndarray]  # (n, 3) thinned, in the level frame
    normals: dict[str, np.ndarray]  # (n, 3)
    refused: list[RegistrationError]  # reasons for the scans that were excluded


@dataclass(frozen=True)
class _Levelled:
    """Scan near the sandbox frame, on grids from coarse to fine."""

    level_from_left: Pose
    coarse: list[icp.ScanSurface]
    fine: icp.ScanSurface
    area: SearchArea
    surveyed: bool  # whether the start is a surveyed pose

    def sand(self) -> icp.ScanSurface:
        """Return the fine grid without walls: they have two sides, and the cloth on them moves between scans."""
        points, normals = self.fine.points, self.fine.normals
        inside = (np.abs(points[:, :2]) < self.area.sand).all(axis=1)
        level = (np.abs(points[:, 2]) < MAX_LEVEL_HEIGHT) & (np.abs(normals[:, 2]) > MIN_FLAT_NORMAL)
        return self.fine.select(inside | level)


def register_scans(scans: Mapping[str, np.ndarray], stations: Mapping[str, Pose], area: SearchArea) -> Network:
    """Register the scans of a terrain, without scans that show no sand or another terrain than the majority.

    `scans`, position -> (n, 3): points in the left camera frame of each position, metres.
    `stations`, position -> Pose: surveyed `sandbox_from_left`; positions without a survey start from the same pose in
    front of the terrain.
    """
    for first, second in combinations(sorted(scans), 2):
        if np.array_equal(scans[first], scans[second]):
            raise RegistrationError(f"the scans of positions {first} and {second} have the same points: one is a copy")
    levelled, sandless = _level_all(scans, stations, area)
    reference, start, strange = _find_majority(levelled)
    levelled = {position: scan for position, scan in levelled.items() if position in start}
    sands = {position: scan.sand() for position, scan in levelled.items()}
    return _network(levelled, sands, icp.align_jointly(sands, start, reference), [*sandless, *strange])


def place_scans(scans: Mapping[str, np.ndarray], level_from_left: Mapping[str, Pose], area: SearchArea) -> Network:
    """Return the scans (n, 3) of positions with known poses in a nearly level frame; arguments as `register_scans`."""
    levelled = {
        position: _level_scan(position, points, level_from_left, area) for position, points in sorted(scans.items())
    }
    moves = {
        position: level_from_left[position] @ scan.level_from_left.inverse() for position, scan in levelled.items()
    }
    return _network(levelled, {position: scan.sand() for position, scan in levelled.items()}, moves, [])


def _network(
    levelled: Mapping[str, _Levelled],
    sands: Mapping[str, icp.ScanSurface],
    moves: Mapping[str, Pose],
    refused: list[RegistrationError],
) -> Network:
    """Return the network of scans; `moves`: common frame from the frame of each levelled scan."""
    pairs = [
        _measure_pair(fixed, moving, moves[fixed].inverse() @ moves[moving], levelled)
        for fixed, moving in combinations(levelled, 2)
    ]
    return Network(
        {position: moves[position] @ scan.level_from_left for position, scan in levelled.items()},
        pairs,
        icp.covariances(sands, moves),
        {position: moves[position].apply(scan.fine.points) for position, scan in levelled.items()},
        {position: moves[position].rotate(scan.fine.normals) for position, scan in levelled.items()},
        refused,
    )


def _level_all(
    scans: Mapping[str, np.ndarray], stations: Mapping[str, Pose], area: SearchArea
) -> tuple[dict[str, _Levelled], list[RegistrationError]]:
    """Level the scans, and return the scans that show sand and the reasons for the rest."""
    levelled, refused = {}, []
    for position, points in sorted(scans.items()):
        try:
            levelled[position] = _level_scan(position, points, stations, area)
        except RegistrationError as reason:
            refused.append(reason)
    if not levelled:
        raise refused[0]
    return levelled, refused


def _find_majority(levelled: Mapping[str, _Levelled]) -> tuple[str, dict[str, Pose], list[RegistrationError]]:
    """Return a reference, the poses `reference_from_own` of the scans that agree with it, and reasons for the rest.

    More than half of the scans must agree with the reference. Scans are tried in the order of their number of points.
    """
    first: RegistrationError | None = None
    for reference in sorted(levelled, key=lambda position: (-len(levelled[position].fine.points), position)):
        start, refused = {reference: Pose.identity()}, []
        for position in levelled:
            if position != reference:
                try:
                    start[position] = _align_pair(reference, position, levelled)
                except RegistrationError as reason:
                    refused.append(reason)
        if len(start) > len(levelled) / 2:
            return reference, start, refused
        first = first or refused[0]
    assert first is not None  # a single scan agrees with itself
    raise first


def level_pose(position: str, points: np.ndarray, stations: Mapping[str, Pose], area: SearchArea) -> Pose:
    """Return `level_from_left`: position and heading from the survey, tilt and height from the sand."""
    guess = stations.get(position) or area.start
    near = guess.apply(points)
    sand = near[(np.abs(near[:, :2]) < area.sand).all(axis=1)]
    if len(sand) < MIN_SAND_POINTS:
        raise RegistrationError(
            f"the scan of position {position} has {len(sand)} points within {_metres(area.sand)} of the centre, "
            f"{MIN_SAND_POINTS} needed: check its tripod, and that the points are in the frame of the camera"
        )
    thin = sand[:: max(1, len(sand) // 100_000)]
    return level_from(tracked_plane(thin, np.array([0, 0, np.median(thin[:, 2])]), SAND_SCALES)) @ guess


def _level_scan(position: str, points: np.ndarray, stations: Mapping[str, Pose], area: SearchArea) -> _Levelled:
    level_from_left = level_pose(position, points, stations, area)
    near = level_from_left.apply(points)
    reach = [*area.radius, HEIGHT_REACH]
    near = near[(np.abs(near) < reach).all(axis=1)]
    viewpoint = level_from_left.translation
    shown = _sand_area(icp.thin_to_planes(near, viewpoint, COARSE_VOXELS[0]), area)
    if shown < area.min_sand_area:
        raise RegistrationError(
            f"the scan of position {position} shows {shown:.1f} m2 of level sand within {_metres(area.sand)} of the "
            f"centre, {area.min_sand_area:g} m2 needed: walls do not suffice for a registration"
        )
    fine = icp.thin_to_planes(near, viewpoint, VOXEL)
    coarse = [icp.thin_to_planes(fine.points, viewpoint, voxel) for voxel in COARSE_VOXELS]
    return _Levelled(level_from_left, coarse, fine, area, position in stations)


def _metres(reach: np.ndarray) -> str:
    """Return a half side of a square or the half sides of a rectangle for a message."""
    return " x ".join(f"{side:g}" for side in dict.fromkeys(reach.tolist())) + " m"


def _sand_area(coarse: icp.ScanSurface, area: SearchArea) -> float:
    """Return the area of level surface near the centre, square metres, on the coarsest grid."""
    sand = (np.abs(coarse.points) < [*area.sand, MAX_LEVEL_HEIGHT]).all(axis=1) & (
        np.abs(coarse.normals[:, 2]) > MIN_FLAT_NORMAL
    )
    return float(sand.sum() * COARSE_VOXELS[0] ** 2)


def _align_pair(fixed: str, moving: str, levelled: Mapping[str, _Levelled]) -> Pose:
    """Return `fixed_from_moving`, the best of several candidates, each refined on the coarse grids."""
    first, second = levelled[fixed], levelled[moving]
    farthest = np.radians(YAW_RANGE_DEG)
    yaws = np.linspace(-farthest, farthest, 2 * round(YAW_RANGE_DEG / YAW_STEP_DEG) + 1)
    grids = first.coarse[-1].points, second.coarse[-1].points
    starts = correlate_rotations(*grids, first.area.radius, MAP_STEP, yaws, first.area.translation, CANDIDATES)
    tried = [icp.align_coarsely(first.coarse, second.coarse, COARSE_VOXELS, start) for start in starts]
    share = [_agreement(first, second, pose) for pose in tried]
    remedy = "" if first.surveyed and second.surveyed else "; state the tripods of both positions in the site"
    if max(share) < MIN_FITNESS:
        raise RegistrationError(
            f"the scans of positions {fixed} and {moving} agree on {max(share):.2f} of the ground that both show, "
            f"{MIN_FITNESS:g} needed{remedy}"
        )
    best = tried[int(np.argmax(share))]
    similarity = _relief_similarity(first, second, best)
    if similarity < MIN_RELIEF_CORRELATION:
        raise RegistrationError(
            f"the scans of positions {fixed} and {moving} show different terrains: their relief correlates by "
            f"{similarity:.2f}, {MIN_RELIEF_CORRELATION:g} needed{remedy}"
        )
    return best


def _measure_pair(fixed: str, moving: str, pose: Pose, levelled: Mapping[str, _Levelled]) -> Pair:
    alignment = icp.measure(levelled[fixed].fine, levelled[moving].fine, pose, SAME_SURFACE)
    return Pair(fixed, moving, alignment, _agreement(levelled[fixed], levelled[moving], pose))


def _relief_similarity(fixed: _Levelled, moving: _Levelled, fixed_from_moving: Pose) -> float:
    """Return the correlation of the sand's relief in both scans; 1 if the relief is too flat."""
    moved = fixed_from_moving.apply(moving.fine.points)
    return relief_correlation(fixed.fine.points, moved, fixed.area.sand, MAP_STEP, MIN_RELIEF)


def _agreement(fixed: _Levelled, moving: _Levelled, fixed_from_moving: Pose) -> float:
    moved = fixed_from_moving.apply(moving.fine.points)
    return agreement(fixed.fine.points, moved, fixed.area.radius, MAP_STEP, AGREE)[0]
