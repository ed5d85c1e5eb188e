"""All scans of a terrain brought together: each levelled on its sand, pairs found by relief, aligned, and balanced."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from polarsim.cameras.heightmaps import agreement, turned_and_shifted
from polarsim.cameras.icp import Alignment, Thinned, align
from polarsim.cameras.options import CamerasOptions
from polarsim.cameras.planes import level_from, tracked_plane
from polarsim.cameras.surveyed import surveyed_pose
from polarsim.errors import RegistrationError
from polarsim.geometry.poses import Pose, looking
from polarsim.survey import NOMINAL_PITCH_DEG

SAND_REACH = 1.6  # metres about the centre where a scan shows sand and rocks only, for all errors of the survey
SAND_SCALES = [0.4, 0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.06, 0.06]  # metres: what belongs to the sand, ever closer
MIN_SAND_POINTS = 1000
AGREE = 0.015  # metres between heights of one cell in two scans


@dataclass(frozen=True)
class Pair:
    """Two scans laid on each other."""

    fixed: str
    moving: str
    alignment: Alignment
    agreement: float  # part of the shared ground whose heights agree


@dataclass(frozen=True)
class Network:
    """Scans in one level frame; `level_from_left` of every position that has one."""

    level_from_left: dict[str, Pose]
    pairs: list[Pair]
    points: dict[str, np.ndarray]  # (n, 3) thinned, in the level frame


def register_scans(scans: Mapping[str, np.ndarray], options: CamerasOptions) -> Network:
    """Lay the scans of a terrain on each other.

    Parameters
    ----------
    scans : position -> (n, 3) float
        Points in the left camera's frame of their position, metres.

    Raises
    ------
    RegistrationError
        A scan shows no sand where the survey has it, or two scans disagree however they are laid.
    """
    level = {position: level_pose(position, points) for position, points in sorted(scans.items())}
    thinned = {position: _thin(scans[position], level[position], options) for position in level}
    reference = max(level, key=lambda position: len(thinned[position].points()))
    pairs = []
    moves = {reference: Pose.identity()}
    for position in level:
        if position != reference:
            pair = _find(reference, position, thinned, options)
            moves[position] = pair.alignment.fixed_from_moving
            pairs.append(pair)
    for fixed, moving in combinations([position for position in level if position != reference], 2):
        start = moves[fixed].inverse() @ moves[moving]
        pairs.append(_measured(fixed, moving, align(thinned[fixed], thinned[moving], start, slice(-2, None), options.tukey_mm / 1000), thinned, options))
    moves = balance(moves, pairs, thinned)
    return Network(
        {position: moves[position] @ level[position] for position in level},
        pairs,
        {position: moves[position].apply(thinned[position].points()) for position in level},
    )


def level_pose(position: str, points: np.ndarray) -> Pose:
    """Near-sandbox frame from a scan's left frame: survey for place and heading, the sand for tilt and height."""
    guess = surveyed_pose(position) or looking(np.array([3.6, 0, 1.55]), np.pi, np.radians(NOMINAL_PITCH_DEG))
    seen = guess.apply(points)
    sand = seen[(np.abs(seen[:, :2]) < SAND_REACH).all(axis=1)]
    if len(sand) < MIN_SAND_POINTS:
        raise RegistrationError(f"the scan of position {position} has {len(sand)} points where the sand should be")
    thin = sand[:: max(1, len(sand) // 100_000)]
    return level_from(tracked_plane(thin, np.array([0, 0, np.median(thin[:, 2])]), SAND_SCALES)) @ guess


def _thin(points: np.ndarray, level_from_left: Pose, options: CamerasOptions) -> Thinned:
    near = level_from_left.apply(points)
    near = near[(np.abs(near) < [options.scan_radius_m, options.scan_radius_m, 1.0]).all(axis=1)]
    return Thinned.of(near, level_from_left.translation, options.voxel_mm / 1000)


def _find(fixed: str, moving: str, thinned: Mapping[str, Thinned], options: CamerasOptions) -> Pair:
    """The best of several candidates, each tried on the coarse grids."""
    reach, step, tukey = options.scan_radius_m, options.map_step_mm / 1000, options.tukey_mm / 1000
    turn = np.radians(options.scan_yaw_range_deg)
    yaws = np.linspace(-turn, turn, 2 * round(options.scan_yaw_range_deg / options.scan_yaw_step_deg) + 1)
    starts = turned_and_shifted(
        thinned[fixed].points(-2), thinned[moving].points(-2), reach, step, yaws, options.scan_candidates
    )
    tried = [align(thinned[fixed], thinned[moving], start, slice(0, -1), tukey) for start in starts]
    coarse = [_measured(fixed, moving, one, thinned, options) for one in tried]
    best = max(coarse, key=lambda pair: pair.agreement)
    fine = align(thinned[fixed], thinned[moving], best.alignment.fixed_from_moving, slice(-1, None), tukey)
    pair = _measured(fixed, moving, fine, thinned, options)
    if pair.agreement < options.min_fitness:
        raise RegistrationError(
            f"the scans of positions {fixed} and {moving} agree on {pair.agreement:.2f} of the ground that both show, "
            f"{options.min_fitness:g} needed"
        )
    return pair


def _measured(
    fixed: str, moving: str, alignment: Alignment, thinned: Mapping[str, Thinned], options: CamerasOptions
) -> Pair:
    moved = alignment.fixed_from_moving.apply(thinned[moving].points())
    share, _ = agreement(thinned[fixed].points(), moved, options.scan_radius_m, options.map_step_mm / 1000, AGREE)
    return Pair(fixed, moving, alignment, share)


def balance(moves: Mapping[str, Pose], pairs: list[Pair], thinned: Mapping[str, Thinned]) -> dict[str, Pose]:
    """All positions in one pose graph, so that the errors of the pairs are shared out (Open3D, Levenberg-Marquardt)."""
    import open3d as o3d

    if len(pairs) < len(moves):  # a tree: nothing to balance
        return dict(moves)
    registration = o3d.pipelines.registration
    names = sorted(moves)
    graph = registration.PoseGraph()
    for name in names:
        graph.nodes.append(registration.PoseGraphNode(moves[name].matrix))
    for pair in pairs:
        matrix = pair.alignment.fixed_from_moving.matrix
        information = registration.get_information_matrix_from_point_clouds(
            thinned[pair.moving].clouds[-1], thinned[pair.fixed].clouds[-1], 2 * thinned[pair.fixed].voxels[-1], matrix
        )
        graph.edges.append(
            registration.PoseGraphEdge(names.index(pair.moving), names.index(pair.fixed), matrix, information, False)
        )
    fixed = next(name for name in names if np.array_equal(moves[name].matrix, np.eye(4)))
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        registration.global_optimization(
            graph,
            registration.GlobalOptimizationLevenbergMarquardt(),
            registration.GlobalOptimizationConvergenceCriteria(),
            registration.GlobalOptimizationOption(
                max_correspondence_distance=0.01, edge_prune_threshold=0.0, reference_node=names.index(fixed)
            ),
        )
    return {name: Pose(n.pose[:3, :3].copy(), n.pose[:3, 3].copy()) for name, n in zip(names, graph.nodes, strict=True)}
