"""All scans of a terrain brought together: each levelled on its sand, pairs found by relief, then aligned jointly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from polarsim.cameras import icp
from polarsim.cameras.heightmaps import agreement, turned_and_shifted
from polarsim.cameras.options import CamerasOptions
from polarsim.cameras.surveyed import surveyed_pose
from polarsim.errors import RegistrationError
from polarsim.geometry.planes import level_from, tracked_plane
from polarsim.geometry.poses import Pose, looking
from polarsim.survey import NOMINAL_PITCH_DEG

SAND_REACH = 1.6  # metres about the centre where a scan shows sand and rocks only, for all errors of the survey
SAND_SCALES = [0.4, 0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.06, 0.06]  # metres: what belongs to the sand, ever closer
MIN_SAND_POINTS = 1000
HEIGHT_REACH = 1.0  # metres about the sand's level: above are curtains and stands
LEVEL, FLAT = 0.2, 0.8  # metres about the sand's level, and |z| of normals, of what counts as sand near the walls
COARSE_VOXELS = [0.04, 0.02]  # metres
AGREE = 0.015  # metres between heights of one cell in two scans
GUESSED_PLACE = np.array([3.6, 0.0, 1.55])  # metres: of a position that the survey does not have


@dataclass(frozen=True)
class Pair:
    """Two scans laid on each other."""

    fixed: str
    moving: str
    alignment: icp.Alignment
    agreement: float  # part of the shared ground whose heights agree


@dataclass(frozen=True)
class Network:
    """Scans in one level frame; `level_from_left` of every position that has one."""

    level_from_left: dict[str, Pose]
    pairs: list[Pair]
    covariances: dict[str, np.ndarray]  # (6, 6) of turn and shift in the level frame, the mean of all scans held
    points: dict[str, np.ndarray]  # (n, 3) thinned, in the level frame
    normals: dict[str, np.ndarray]  # (n, 3)


@dataclass(frozen=True)
class _Levelled:
    """A scan near the sandbox frame, on grids from coarse to fine."""

    level_from_left: Pose
    coarse: list[icp.Surface]
    fine: icp.Surface

    def sand(self) -> icp.Surface:
        """The fine grid without walls: they have two sides, and cloth on them hangs otherwise in every scan."""
        points, normals = self.fine.points, self.fine.normals
        inside = (np.abs(points[:, :2]) < SAND_REACH).all(axis=1)
        level = (np.abs(points[:, 2]) < LEVEL) & (np.abs(normals[:, 2]) > FLAT)
        return self.fine.select(inside | level)


def register_scans(scans: Mapping[str, np.ndarray], options: CamerasOptions) -> Network:
    """Lay the scans of a terrain on each other.

    Parameters
    ----------
    scans : position -> (n, 3) float
        Points in the left camera's frame of their position, metres.

    Raises
    ------
    RegistrationError
        A scan shows no sand where the survey has it, two scans are copies, or disagree however they are laid.
    """
    for one, other in combinations(sorted(scans), 2):
        if np.array_equal(scans[one], scans[other]):
            raise RegistrationError(f"the scans of positions {one} and {other} are copies: the same points in both")
    levelled = {position: _levelled(position, points, options) for position, points in sorted(scans.items())}
    reference = max(levelled, key=lambda position: len(levelled[position].fine.points))
    start = {reference: Pose.identity()}
    for position in levelled:
        if position != reference:
            start[position] = _found(reference, position, levelled, options)
    sands = {position: scan.sand() for position, scan in levelled.items()}
    moves = icp.align_jointly(sands, start, reference)
    pairs = [
        _measured(fixed, moving, moves[fixed].inverse() @ moves[moving], levelled, options)
        for fixed, moving in combinations(levelled, 2)
    ]
    return Network(
        {position: moves[position] @ scan.level_from_left for position, scan in levelled.items()},
        pairs,
        icp.covariances(sands, moves),
        {position: moves[position].apply(scan.fine.points) for position, scan in levelled.items()},
        {position: moves[position].rotate(scan.fine.normals) for position, scan in levelled.items()},
    )


def level_pose(position: str, points: np.ndarray) -> Pose:
    """Near-sandbox frame from a scan's left frame: survey for place and heading, the sand for tilt and height."""
    guess = surveyed_pose(position) or looking(GUESSED_PLACE, np.pi, np.radians(NOMINAL_PITCH_DEG))
    seen = guess.apply(points)
    sand = seen[(np.abs(seen[:, :2]) < SAND_REACH).all(axis=1)]
    if len(sand) < MIN_SAND_POINTS:
        raise RegistrationError(f"the scan of position {position} has {len(sand)} points where the sand should be")
    thin = sand[:: max(1, len(sand) // 100_000)]
    return level_from(tracked_plane(thin, np.array([0, 0, np.median(thin[:, 2])]), SAND_SCALES)) @ guess


def _levelled(position: str, points: np.ndarray, options: CamerasOptions) -> _Levelled:
    level_from_left = level_pose(position, points)
    near = level_from_left.apply(points)
    reach = [options.scan_radius_m, options.scan_radius_m, HEIGHT_REACH]
    near = near[(np.abs(near) < reach).all(axis=1)]
    viewpoint = level_from_left.translation
    fine = icp.surface(near, viewpoint, options.voxel_mm / 1000)
    return _Levelled(level_from_left, [icp.surface(fine.points, viewpoint, voxel) for voxel in COARSE_VOXELS], fine)


def _found(fixed: str, moving: str, levelled: Mapping[str, _Levelled], options: CamerasOptions) -> Pose:
    """`fixed_from_moving`: the best of several candidates, each tried on the coarse grids."""
    first, second = levelled[fixed], levelled[moving]
    turn = np.radians(options.scan_yaw_range_deg)
    yaws = np.linspace(-turn, turn, 2 * round(options.scan_yaw_range_deg / options.scan_yaw_step_deg) + 1)
    starts = turned_and_shifted(
        first.coarse[-1].points,
        second.coarse[-1].points,
        options.scan_radius_m,
        options.map_step_mm / 1000,
        yaws,
        options.scan_shift_m,
        options.scan_candidates,
    )
    tried = [icp.align_coarsely(first.coarse, second.coarse, COARSE_VOXELS, start) for start in starts]
    share = [_agreement(first, second, pose, options) for pose in tried]
    if max(share) < options.min_fitness:
        raise RegistrationError(
            f"the scans of positions {fixed} and {moving} agree on {max(share):.2f} of the ground that both show, "
            f"{options.min_fitness:g} needed"
        )
    return tried[int(np.argmax(share))]


def _measured(fixed: str, moving: str, pose: Pose, levelled: Mapping[str, _Levelled], options: CamerasOptions) -> Pair:
    alignment = icp.measure(levelled[fixed].fine, levelled[moving].fine, pose, options.same_surface_mm / 1000)
    return Pair(fixed, moving, alignment, _agreement(levelled[fixed], levelled[moving], pose, options))


def _agreement(fixed: _Levelled, moving: _Levelled, fixed_from_moving: Pose, options: CamerasOptions) -> float:
    moved = fixed_from_moving.apply(moving.fine.points)
    return agreement(fixed.fine.points, moved, options.scan_radius_m, options.map_step_mm / 1000, AGREE)[0]
