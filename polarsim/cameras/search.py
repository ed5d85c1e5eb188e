"""Search for the pose of a view from boxes and meshes without a start.

From a given position and with a level camera, exactly one yaw and pitch projects the centre of a rock onto the centre
of a box. Therefore a coarse grid of positions, times all pairs of rock and box, contains a hypothesis near the true
pose. Its score is the number of other rocks that coincide with a box of their size. Directions and sizes are compared
on a plane at distance 1, without distortion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.photo import photo_scale
from polarsim.site_parts import Sandbox, Tripod

DISTANCE_STEP, HEIGHT_STEP = 0.3, 0.2  # metres: grid of tried positions
AZIMUTH_RANGE_DEG, AZIMUTH_STEP_DEG = 12.0, 4.0  # of the search about the surveyed azimuth
SEARCH_SD_PX = 40.0  # tolerance of box centres: about their displacement by a step
# Tried positions of a camera: horizontal distance from the origin and height above the median rock, metres. The ranges
# include all tripods of the site with these margins.
NEAREST, BEYOND_SAND, DISTANCE_MARGIN = 1.0, 5.0, 0.5
HEIGHT_RANGE, HEIGHT_MARGINS = (0.8, 2.0), (0.7, 0.45)
STARTS = 25  # maximum number of hypotheses that are refined
SIZE_SD = 0.5  # tolerance of log width and log height
PITCH = np.radians([2.0, 60.0])  # minimum and maximum, downwards
YAW_OFF_ORIGIN = np.radians(25.0)  # maximum angle between the optical axis and the terrain's centre, or ...
YAW_MARGIN = np.radians(15.0)  # ... this angle beyond the surveyed heading
DUPLICATE_DISTANCE, DUPLICATE_ANGLE = 0.35, 0.05  # metres, radians: nearer hypotheses are duplicates
MAX_PER_POSITION = 20  # maximum number of hypotheses of a position


@dataclass(frozen=True)
class Hypothesis:
    """Level camera, and about how many rocks coincide with boxes."""

    centre: np.ndarray  # (3,) metres
    yaw: float
    pitch: float
    score: float

    @property
    def sandbox_from_left(self) -> Pose:
        return camera_pose(self.centre, self.yaw, self.pitch)


@dataclass(frozen=True)
class SearchRanges:
    """Ranges of tried positions: distance from the origin and height above the median rock, metres."""

    distance: tuple[float, float]
    height: tuple[float, float]

    @classmethod
    def of(cls, sandbox: Sandbox, tripods: Mapping[str, Tripod]) -> SearchRanges:
        """Return the ranges of a site."""
        near, far, (low, high) = NEAREST, max(sandbox.half_width_m) + BEYOND_SAND, HEIGHT_RANGE
        for tripod in tripods.values():
            distance, height = float(np.hypot(*tripod.camera_m[:2])), tripod.camera_m[2]
            near, far = min(near, distance - DISTANCE_MARGIN), max(far, distance + DISTANCE_MARGIN)
            low, high = min(low, height - HEIGHT_MARGINS[0]), max(high, height + HEIGHT_MARGINS[1])
        return cls((max(near, DISTANCE_STEP), far), (low, high))


def candidate_centres(azimuth: float | None, level: float, ranges: SearchRanges) -> np.ndarray:
    """Return positions (n, 3) to try.

    `azimuth`: azimuth of the tripod from the origin, radians; None tries the full circle.
    `level`: height of the scene, metres.
    """
    distances = _steps(*ranges.distance, DISTANCE_STEP)
    heights = level + _steps(*ranges.height, HEIGHT_STEP)
    if azimuth is None:
        azimuths = np.radians(np.arange(0, 360, AZIMUTH_STEP_DEG))
    else:
        azimuths = azimuth + np.radians(_steps(-AZIMUTH_RANGE_DEG, AZIMUTH_RANGE_DEG, AZIMUTH_STEP_DEG))
    grid = np.stack(np.meshgrid(distances, azimuths, heights, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.stack([grid[:, 0] * np.cos(grid[:, 1]), grid[:, 0] * np.sin(grid[:, 1]), grid[:, 2]], axis=1)


def search_pose(
    outlines: Outlines, boxes: np.ndarray, lens: Lens, centres: np.ndarray, surveyed: Pose | None
) -> list[Hypothesis]:
    """Return the best distinct hypotheses at positions (n, 3), metres, for rock boxes (b, 4), px, best first.

    The optical axes are near the terrain's centre; `surveyed` widens their range if its axis is not.
    """
    normalised = _NormalisedBoxes.of(boxes, lens, SEARCH_SD_PX * photo_scale(lens.width))
    thin, off_origin = outlines.thinned(26), max(YAW_OFF_ORIGIN, _yaw_off_origin(surveyed) + YAW_MARGIN)
    hypotheses = [
        hypothesis for centre in centres for hypothesis in _hypotheses_at(centre, thin, normalised, off_origin)
    ]
    kept: list[Hypothesis] = []
    for hypothesis in sorted(hypotheses, key=lambda hypothesis: -hypothesis.score):
        if len(kept) < STARTS and not any(_is_duplicate(hypothesis, other) for other in kept):
            kept.append(hypothesis)
    return kept


@dataclass(frozen=True)
class _NormalisedBoxes:
    """Boxes on the plane at distance 1: centres (b, 2), log sizes (b, 2), and the tolerance on the plane."""

    centre: np.ndarray
    log_size: np.ndarray
    sd: float

    @classmethod
    def of(cls, boxes: np.ndarray, lens: Lens, sd_px: float) -> _NormalisedBoxes:
        centre_px = (boxes[:, :2] + boxes[:, 2:]) / 2
        half_px = (boxes[:, 2:] - boxes[:, :2]) / 2
        across, down = half_px * [1, 0], half_px * [0, 1]
        width = lens.directions(centre_px + across)[:, 0] - lens.directions(centre_px - across)[:, 0]
        height = lens.directions(centre_px + down)[:, 1] - lens.directions(centre_px - down)[:, 1]
        return cls(lens.directions(centre_px)[:, :2], np.log(np.stack([width, height], axis=1)), sd_px / lens.fx)

    def features(self) -> np.ndarray:
        """Return (b, 4) features, scaled so that squared distances are the chi squared of the search."""
        return np.concatenate([self.centre / self.sd, self.log_size / SIZE_SD], axis=1)


def _yaw_off_origin(surveyed: Pose | None) -> float:
    """Return the angle between the heading of a pose and the direction to the origin, radians; 0 without a pose."""
    if surveyed is None:
        return 0.0
    off = yaw_pitch_roll(surveyed)[0] - np.arctan2(*-surveyed.translation[1::-1])
    return abs(float((off + np.pi) % (2 * np.pi) - np.pi))


def _hypotheses_at(
    centre: np.ndarray, outlines: Outlines, normalised: _NormalisedBoxes, off_origin: float
) -> list[Hypothesis]:
    yaw_home = float(np.arctan2(-centre[1], -centre[0]))
    pitch_home = float(np.arctan2(centre[2] - np.median(outlines.centres[:, 2]), np.hypot(centre[0], centre[1])))
    home = camera_pose(centre, yaw_home, pitch_home)
    directions, log_size = _rocks_from(home, outlines)
    with np.errstate(invalid="ignore"):
        rock, box = np.nonzero((np.abs(log_size[:, None] - normalised.log_size[None]) < SIZE_SD).all(axis=-1))
    yaw, pitch = _aim(directions[rock], normalised.centre[box])
    off = (yaw - yaw_home + np.pi) % (2 * np.pi) - np.pi
    with np.errstate(invalid="ignore"):
        good = (pitch > PITCH[0]) & (pitch < PITCH[1]) & (np.abs(off) < off_origin)
    yaw, pitch = yaw[good], pitch[good]
    if not len(yaw):
        return []
    score = _scores(yaw, pitch, directions, log_size, normalised)
    best = np.argsort(-score, kind="stable")[:MAX_PER_POSITION]
    return [Hypothesis(centre, float(yaw[k]), float(pitch[k]), float(score[k])) for k in best]


def _rocks_from(home: Pose, outlines: Outlines) -> tuple[np.ndarray, np.ndarray]:
    """Return sandbox directions (m, 3) of the centres of the rocks' boxes, and log sizes (m, 2) as if on the axis."""
    upper, whole = (home.inverse().apply(points) for points in (outlines.upper, outlines.whole))
    x, y = upper[..., 0] / upper[..., 2], whole[..., 1] / whole[..., 2]
    low, high = np.stack([x.min(1), y.min(1)], axis=1), np.stack([x.max(1), y.max(1)], axis=1)
    centre = np.column_stack([(low + high) / 2, np.ones(len(low))])
    front = (upper[..., 2] > 0.1).all(axis=1) & (whole[..., 2] > 0.1).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        log_size = np.log(high - low) - _log_stretch(centre)[:, None]
    log_size[~front] = np.inf
    return home.rotate(centre / np.linalg.norm(centre, axis=1, keepdims=True)), log_size


def _log_stretch(points: np.ndarray) -> np.ndarray:
    """Return the log of the magnification on the plane off the axis: mean of the radial and tangential stretch."""
    return np.asarray(0.75 * np.log(1 + (points[..., :2] ** 2).sum(axis=-1)))


def _aim(directions: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return yaw and pitch (n,) of the level camera that projects unit sandbox directions (n, 3) to centres (n, 2)."""
    reach = np.sqrt(1 + (centre**2).sum(axis=1))
    right, down, forward = centre[:, 0] / reach, centre[:, 1] / reach, 1 / reach
    with np.errstate(invalid="ignore"):  # NaN for directions that are too steep for any pitch
        pitch = np.arcsin(-directions[:, 2] / np.hypot(down, forward)) - np.arctan2(down, forward)
    ahead = np.cos(pitch) * forward - np.sin(pitch) * down
    return np.arctan2(directions[:, 1], directions[:, 0]) + np.arctan2(right, ahead), pitch


def _scores(
    yaw: np.ndarray, pitch: np.ndarray, directions: np.ndarray, log_size: np.ndarray, normalised: _NormalisedBoxes
) -> np.ndarray:
    """Return the sum (n,) over rocks of exp(-chi squared / 2) of the best box."""
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    right = np.stack([sy, -cy, np.zeros_like(sy)], axis=1)
    down = np.stack([-sp * cy, -sp * sy, -cp], axis=1)
    forward = np.stack([cp * cy, cp * sy, -sp], axis=1)
    depth = forward @ directions.T
    behind = (depth < 0.1) | ~np.isfinite(log_size[:, 0])
    depth = np.where(behind, 1, depth)
    projected = np.stack([right @ directions.T, down @ directions.T], axis=-1) / depth[..., None]
    size = np.where(np.isfinite(log_size), log_size, 0)[None] + _log_stretch(projected)[..., None]
    rocks = np.concatenate([projected / normalised.sd, size / SIZE_SD], axis=-1)  # (n, m, 4)
    boxes = normalised.features()
    # Squared distances by the binomial formula need only one matrix product.
    part = (boxes**2).sum(axis=1) - 2 * rocks.reshape(-1, 4) @ boxes.T
    chi2 = (rocks**2).sum(axis=-1) + part.min(axis=1).reshape(rocks.shape[:2])
    return np.where(behind, 0, np.exp(-chi2 / 2)).sum(axis=1)


def _is_duplicate(first: Hypothesis, second: Hypothesis) -> bool:
    yaw = (first.yaw - second.yaw + np.pi) % (2 * np.pi) - np.pi
    return (
        float(np.linalg.norm(first.centre - second.centre)) < DUPLICATE_DISTANCE
        and max(abs(yaw), abs(first.pitch - second.pitch)) < DUPLICATE_ANGLE
    )


def _steps(low: float, high: float, step: float) -> np.ndarray:
    """Return values from low to high inclusive."""
    return low + step * np.arange(int(np.floor((high - low) / step + 1e-9)) + 1)
