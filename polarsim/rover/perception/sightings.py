"""Detected and missed rocks of a drive, and false stops."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from polarsim.geometry import boxes
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import Pose
from polarsim.photo import ROCK
from polarsim.rover.cameras.layout import BOX
from polarsim.rover.perception.ground_view import HeightFunction, estimate, plane_under
from polarsim.rover.vehicle.mounts import levelled

HEIGHTS_M = (0.05, 0.10)  # height thresholds of the metrics
FARTHEST_M = 6.0  # maximum distance of counted rocks from the camera
_MATCH_IOU = 0.5  # minimum IoU of a detected rock and its label
# Rover at the paper's speed: time from a picture to the brake, and deceleration.
_REACTION_S, _BRAKE_M_S2 = 1.0, 0.3
_STOP_HEIGHT_M = 0.10  # minimum estimated height of a rock that stops the rover
STABLE_FRAMES = 3  # number of consecutive pictures with a detection that make it stable
FALSE_OVERLAP = 0.1  # a predicted rock is false if it covers less than this share of each rock's box
DISTANCE_BIN_M = 0.5  # width of the bins of distance
MAP_NEAREST_M, MAP_FARTHEST_M = 0.8, 3.0  # range of mapped ground from the camera
_SIDE_M = 0.1  # margin at the sides of the wheels in which a rock stops the rover


@dataclass(frozen=True)
class FrontCameraDrive:
    """Front camera of a recorded drive."""

    frames: list[int]  # in order of time
    cameras: Mapping[int, Camera]  # by frame, in the world frame
    base_from_camera: Pose
    ground_m: float  # height of the ground in base_link
    front_m: float  # distance from the camera to the front of the wheels
    half_width_m: float  # from the centre to the outer side of the wheels
    wheel_paths: np.ndarray  # (p, 2) positions of all wheels, m
    wheel_half_m: float  # half the width of a wheel
    length_m: float  # length of the drive
    speed_m_s: float
    surveyed: HeightFunction | None = None  # surveyed ground; None: the plane under the wheels

    def base(self, frame: int) -> Pose:
        """Return `world_from_base`."""
        return self.cameras[frame].world_from_camera @ self.base_from_camera.inverse()

    def ground(self, frame: int) -> HeightFunction:
        """Return the ground on which boxes are located."""
        return self.surveyed or plane_under(self.base(frame), self.ground_m)

    @property
    def stopping_m(self) -> float:
        """Distance from the camera at which the front of the wheels comes to rest after a detection."""
        return self.front_m + self.speed_m_s * _REACTION_S + self.speed_m_s**2 / (2 * _BRAKE_M_S2)


def sightings(truth: pd.DataFrame, detections: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """Return a row per rock and frame in which it is labelled: frame, rock, distance_m, height_m, detected.

    Predicted rocks of at least `confidence` and labels are matched one to one with an IoU of at least 0.5.
    """
    rocks = truth[(truth["kind"] == ROCK) & (truth["distance_m"] <= FARTHEST_M)]
    by_frame = rows_by_frame(confident_rocks(detections, confidence))
    detected, of_row = np.zeros(len(rocks), bool), rocks["frame"].to_numpy()
    for frame in np.unique(of_row).tolist():
        rows = np.flatnonzero(of_row == frame)
        if frame in by_frame:
            overlap = boxes.iou(rocks[BOX].to_numpy()[rows], by_frame[frame][BOX].to_numpy())
            detected[rows[boxes.match_by_iou(overlap, _MATCH_IOU)[0]]] = True
    return rocks[["frame", "rock", "distance_m", "height_m"]].assign(detected=detected).reset_index(drop=True)


def recall_by_distance(seen: pd.DataFrame) -> pd.DataFrame:
    """Return rows of height_m (minimum height of the rocks), from_m, to_m, rocks (labels of rocks), detected."""
    rows = []
    edges = np.arange(0, FARTHEST_M + 1e-9, DISTANCE_BIN_M)
    for height in HEIGHTS_M:
        high = seen[seen["height_m"] > height]
        for low, end in pairwise(edges):
            inside = high[(high["distance_m"] > low) & (high["distance_m"] <= end)]
            rows.append((height, low, end, len(inside), int(inside["detected"].sum())))
    return pd.DataFrame(rows, columns=["height_m", "from_m", "to_m", "rocks", "detected"])


def first_stable(seen: pd.DataFrame, frames: list[int]) -> pd.DataFrame:
    """Return a row per rock: rock, height_m, first_visible_m (farthest label), first_stable_m (NaN: never).

    Stable: detected in `STABLE_FRAMES` consecutive frames; the distance is that of the last of these frames.
    """
    index = {frame: number for number, frame in enumerate(frames)}
    rows = []
    in_order = seen.sort_values("frame", kind="stable")
    for rock in np.unique(seen["rock"]).tolist():
        labels = in_order[in_order["rock"] == rock]
        number = np.array([index[frame] for frame in labels["frame"]])
        streak, stable = 0, np.nan
        for k, hit in enumerate(labels["detected"]):
            follows = k > 0 and number[k] == number[k - 1] + 1
            streak = (streak + 1 if follows else 1) if hit else 0
            if streak >= STABLE_FRAMES:
                stable = float(labels["distance_m"].iloc[k])
                break
        rows.append((rock, float(labels["height_m"].iloc[0]), float(labels["distance_m"].max()), stable))
    return pd.DataFrame(rows, columns=["rock", "height_m", "first_visible_m", "first_stable_m"])


def miss_distance(stable: pd.DataFrame, rocks: pd.DataFrame, ride: FrontCameraDrive, height_m: float) -> float:
    """Return the minimum gap, m, from a wheel's side to a rock above `height_m` without a stable detection; inf: none.

    Rocks behind or next to the rover in the first picture are excluded. The gap is negative if a wheel hit a rock.
    """
    detected = set(stable.loc[stable["first_stable_m"].notna(), "rock"])
    start = ride.cameras[ride.frames[0]].world_from_camera
    ahead = start.rotation[:2, 2] / np.linalg.norm(start.rotation[:2, 2])
    minimum = np.inf
    for row in rocks[rocks["height_m"] > height_m].to_dict("records"):
        position = np.array([row["x_m"], row["y_m"]], float)
        if row["rock"] in detected or (position - start.translation[:2]) @ ahead <= ride.front_m:
            continue
        gap = np.linalg.norm(ride.wheel_paths - position, axis=1).min()
        minimum = min(minimum, float(gap) - float(row["radius_m"]) - ride.wheel_half_m)
    return minimum


def false_stops(truth: pd.DataFrame, detections: pd.DataFrame, ride: FrontCameraDrive, confidence: float) -> int:
    """Return the number of stops for false rocks.

    The rover stops if an estimated rock of at least `_STOP_HEIGHT_M` is in the path for `STABLE_FRAMES` consecutive
    frames. The stop is false if none of these rocks covers at least `FALSE_OVERLAP` of a labelled rock.
    """
    labels = rows_by_frame(truth[truth["kind"] == ROCK])
    predicted = rows_by_frame(confident_rocks(detections, confidence))
    streak = stops = 0
    for frame in ride.frames:
        streak = streak + 1 if _false_positive(frame, labels.get(frame), predicted.get(frame), ride) else 0
        stops += streak == STABLE_FRAMES
    return stops


def _false_positive(
    frame: int, labels: pd.DataFrame | None, predicted: pd.DataFrame | None, ride: FrontCameraDrive
) -> bool:
    if predicted is None:
        return False
    false = predicted[BOX].to_numpy(float)
    if labels is not None:
        false = false[boxes.largest_covered_share(false, labels[BOX].to_numpy(float)) < FALSE_OVERLAP]
    rock = estimate(false, ride.cameras[frame], ride.ground(frame))
    level = np.column_stack([rock.near, np.zeros(len(false))])
    ahead, left, _ = levelled(ride.base(frame)).inverse().apply(level).T
    in_path = np.abs(left) - rock.width / 2 < ride.half_width_m + _SIDE_M
    near = ahead - ride.base_from_camera.translation[0] <= MAP_FARTHEST_M
    return bool((in_path & near & (rock.height >= _STOP_HEIGHT_M)).any())


def rows_by_frame(table: pd.DataFrame) -> dict[int, pd.DataFrame]:
    """Return the rows of each frame."""
    return {int(str(frame)): rows for frame, rows in table.groupby("frame")}


def confident_rocks(detections: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """Return the boxes of rocks with at least this confidence."""
    return detections[(detections["kind"] == ROCK) & (detections["confidence"] >= confidence)]
