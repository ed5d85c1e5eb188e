"""When rocks are detected on a drive, which are missed, and false stops."""

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
from polarsim.rover.perception.ground_view import Heights, estimate, plane_under
from polarsim.rover.vehicle.mounts import levelled

HEIGHTS_M = (0.05, 0.10)  # rocks above each of these are counted
FARTHEST_M = 6.0  # from the camera: farther rocks are not counted
_MATCH_IOU = 0.5  # of a detected rock and its label
# A rover at the paper's speed: time from a picture to the brake, and deceleration.
_REACTION_S, _BRAKE_M_S2 = 1.0, 0.3
_STOP_HEIGHT_M = 0.10  # rocks that are taken for this high or more stop the rover
STABLE_FRAMES = 3  # detections in so many pictures in a row are stable
FALSE_OVERLAP = 0.1  # a predicted rock is false if it covers less than this share of each rock's box
DISTANCE_BIN_M = 0.5  # width of the bins of distance
MAP_NEAREST_M, MAP_FARTHEST_M = 0.8, 3.0  # ground before the camera that is mapped
_SIDE_M = 0.1  # beyond the wheels, of the corridor in which a rock makes the rover stop


@dataclass(frozen=True)
class FrontCameraDrive:
    """The front camera of a recorded drive."""

    frames: list[int]  # in order
    cameras: Mapping[int, Camera]  # by frame, in the rover's world
    base_from_camera: Pose
    ground_m: float  # height of the ground in base_link
    front_m: float  # how far the wheels reach beyond the camera
    half_width_m: float  # from the centre to the wheels' outer side
    wheel_paths: np.ndarray  # (p, 2) positions of all wheels, m
    wheel_half_m: float  # half a wheel's width
    length_m: float  # driven
    speed_m_s: float
    surveyed: Heights | None = None  # the ground ahead, if the rover knows it; None: the plane under its wheels

    def base(self, frame: int) -> Pose:
        """`world_from_base`."""
        return self.cameras[frame].world_from_camera @ self.base_from_camera.inverse()

    def ground(self, frame: int) -> Heights:
        """Return the ground on which boxes are located."""
        return self.surveyed or plane_under(self.base(frame), self.ground_m)

    @property
    def stopping_m(self) -> float:
        """From the camera to where the foremost part of the wheels comes to rest."""
        return self.front_m + self.speed_m_s * _REACTION_S + self.speed_m_s**2 / (2 * _BRAKE_M_S2)


def sightings(truth: pd.DataFrame, found: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """A row for every rock in every frame that shows it: frame, rock, distance_m, height_m, detected.

    Predicted rocks from `confidence` on and labels are matched one to one, from an IoU of 0.5 on.
    """
    rocks = truth[(truth["kind"] == ROCK) & (truth["distance_m"] <= FARTHEST_M)]
    by_frame = of_frames(sure_rocks(found, confidence))
    detected, of_row = np.zeros(len(rocks), bool), rocks["frame"].to_numpy()
    for frame in np.unique(of_row).tolist():
        rows = np.flatnonzero(of_row == frame)
        if frame in by_frame:
            overlap = boxes.iou(rocks[BOX].to_numpy()[rows], by_frame[frame][BOX].to_numpy())
            detected[rows[boxes.match(overlap, _MATCH_IOU)[0]]] = True
    return rocks[["frame", "rock", "distance_m", "height_m"]].assign(detected=detected).reset_index(drop=True)


def recall_by_distance(seen: pd.DataFrame) -> pd.DataFrame:
    """Rows of height_m (rocks above it), from_m, to_m, rocks (labels of rocks), detected."""
    rows = []
    edges = np.arange(0, FARTHEST_M + 1e-9, DISTANCE_BIN_M)
    for height in HEIGHTS_M:
        high = seen[seen["height_m"] > height]
        for low, end in pairwise(edges):
            inside = high[(high["distance_m"] > low) & (high["distance_m"] <= end)]
            rows.append((height, low, end, len(inside), int(inside["detected"].sum())))
    return pd.DataFrame(rows, columns=["height_m", "from_m", "to_m", "rocks", "detected"])


def first_stable(seen: pd.DataFrame, frames: list[int]) -> pd.DataFrame:
    """A row a rock: rock, height_m, first_seen_m (farthest label), first_stable_m (NaN: never).

    Stable: detected in `STABLE_FRAMES` frames in a row; the distance is that of the last of them.
    """
    index = {frame: number for number, frame in enumerate(frames)}
    rows = []
    in_order = seen.sort_values("frame", kind="stable")
    for rock in np.unique(seen["rock"]).tolist():
        own = in_order[in_order["rock"] == rock]
        number = np.array([index[frame] for frame in own["frame"]])
        streak, stable = 0, np.nan
        for k, hit in enumerate(own["detected"]):
            follows = k > 0 and number[k] == number[k - 1] + 1
            streak = (streak + 1 if follows else 1) if hit else 0
            if streak >= STABLE_FRAMES:
                stable = float(own["distance_m"].iloc[k])
                break
        rows.append((rock, float(own["height_m"].iloc[0]), float(own["distance_m"].max()), stable))
    return pd.DataFrame(rows, columns=["rock", "height_m", "first_seen_m", "first_stable_m"])


def miss_distance(stable: pd.DataFrame, rocks: pd.DataFrame, ride: FrontCameraDrive, height_m: float) -> float:
    """Least gap, metres, of a wheel's side to a rock above `height_m` that was never stably detected; inf: none.

    Rocks that the rover had passed, or stood beside, in its first picture do not count. Below 0: it drove over one.
    """
    known = set(stable.loc[stable["first_stable_m"].notna(), "rock"])
    start = ride.cameras[ride.frames[0]].world_from_camera
    ahead = start.rotation[:2, 2] / np.linalg.norm(start.rotation[:2, 2])
    least = np.inf
    for row in rocks[rocks["height_m"] > height_m].to_dict("records"):
        position = np.array([row["x_m"], row["y_m"]], float)
        if row["rock"] in known or (position - start.translation[:2]) @ ahead <= ride.front_m:
            continue
        gap = np.linalg.norm(ride.wheel_paths - position, axis=1).min()
        least = min(least, float(gap) - float(row["radius_m"]) - ride.wheel_half_m)
    return least


def false_stops(truth: pd.DataFrame, found: pd.DataFrame, ride: FrontCameraDrive, confidence: float) -> int:
    """How often the rover would brake for what is no rock.

    It brakes where in `STABLE_FRAMES` frames in a row an estimated rock of `_STOP_HEIGHT_M` or more
    is in its way; these are false where none of them covers a labelled rock, at least by `FALSE_OVERLAP`.
    """
    labels = of_frames(truth[truth["kind"] == ROCK])
    predicted = of_frames(sure_rocks(found, confidence))
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
    own = predicted[BOX].to_numpy(float)
    if labels is not None:
        own = own[boxes.largest_covered_share(own, labels[BOX].to_numpy(float)) < FALSE_OVERLAP]
    rock = estimate(own, ride.cameras[frame], ride.ground(frame))
    level = np.column_stack([rock.near, np.zeros(len(own))])
    ahead, left, _ = levelled(ride.base(frame)).inverse().apply(level).T
    in_the_way = np.abs(left) - rock.width / 2 < ride.half_width_m + _SIDE_M
    near = ahead - ride.base_from_camera.translation[0] <= MAP_FARTHEST_M
    return bool((in_the_way & near & (rock.height >= _STOP_HEIGHT_M)).any())


def of_frames(table: pd.DataFrame) -> dict[int, pd.DataFrame]:
    """The rows of each frame that has some."""
    return {int(str(frame)): own for frame, own in table.groupby("frame")}


def sure_rocks(found: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """Return the boxes of rocks from a confidence on."""
    return found[(found["kind"] == ROCK) & (found["confidence"] >= confidence)]
