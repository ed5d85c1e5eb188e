"""Rocks of a terrain from detections alone: diameters on level ground, merged over photos."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.errors import DetectError
from polarsim.formats.tables import read_parquet, typed, write_parquet
from polarsim.geometry.ground_diameters import ground_diameters
from polarsim.photo import ROCK, PhotoKey, Terrain
from polarsim.run_files.rigs import LocalisedRig, read_all_localised
from polarsim.schemas.detect import ROCK_DIAMETERS

log = logging.getLogger("polarsim")
MIN_CONFIDENCE = 0.25
MERGED_DISTANCE = 0.5  # maximum distance of the centres of boxes of a rock, as a share of the larger diameter
MIN_SHARE = 0.2  # exceeded share of the photos of a view in which a rock is detected
COLUMNS = ("key", "kind", "confidence", "x0", "y0", "x1", "y1")


def measure_diameters(*, predictions: Path, cameras: Mapping[Terrain, Path], diameters: Path) -> None:
    """Write the rocks of all terrains from the predictions of a detector on photos, see `ROCK_DIAMETERS`.

    `cameras`: folder of the camera poses of each terrain. The ground is level at z = 0 of the sandbox frame: on the
    analog, median errors of diameters are 16 %.
    """
    table = read_parquet(predictions, COLUMNS)
    table = table[(table["kind"] == ROCK) & (table["confidence"] >= MIN_CONFIDENCE)]
    if not len(table):
        raise DetectError(f"no rock with a confidence of at least {MIN_CONFIDENCE}", path=predictions)
    keys = {name: PhotoKey.parse(name) for name in table["key"].unique()}
    table = table.assign(terrain=[keys[name].terrain for name in table["key"]])
    rows: list[dict[str, object]] = []
    for terrain, folder in sorted(cameras.items()):
        of_terrain = table[table["terrain"] == terrain]
        detections = _boxes_on_ground(of_terrain, keys, read_all_localised(folder))
        rows += [{"terrain": terrain, "rock": number, **row} for number, row in enumerate(merge_boxes(detections), 1)]
    write_parquet(diameters, typed(rows, ROCK_DIAMETERS).round(4))


def _boxes_on_ground(
    table: pd.DataFrame, keys: Mapping[str, PhotoKey], localised: Mapping[str, LocalisedRig]
) -> pd.DataFrame:
    """Return centres, diameters, confidences and views of the boxes of a terrain that are on the ground."""
    parts = [pd.DataFrame(columns=["x", "y", "diameter_m", "confidence", "key", "view"])]
    views = [(keys[name].position, keys[name].camera) for name in table["key"]]
    for (position, camera), part in table.groupby(pd.Series(views, index=table.index), sort=True):
        if position not in localised:
            log.warning("position %s has no camera pose: its detections are excluded", position)
            continue
        boxes = part[["x0", "y0", "x1", "y1"]].to_numpy(float)
        centre, diameter = ground_diameters(localised[position].camera(camera), boxes)
        detections = part[["confidence", "key"]].assign(
            x=centre[:, 0], y=centre[:, 1], diameter_m=diameter, view=position + camera
        )
        parts.append(detections[np.isfinite(diameter)])
    return pd.concat(parts[1:] or parts, ignore_index=True)


def merge_boxes(detections: pd.DataFrame) -> list[dict[str, object]]:
    """Return a row per rock, the most confident first: x, y, diameter_m, confidence, photos.

    `detections` has a row per box of all photos: centre x, y and diameter_m on the ground, metres; confidence, key of
    the photo and view (position and camera).

    A box belongs to the rock whose first box is nearest and closer than `MERGED_DISTANCE`. Position and diameter are
    medians over boxes. Rocks in few photos of every view are false positives and are excluded.
    """
    photos = detections.groupby("view")["key"].nunique()
    detections = detections.sort_values(["confidence", "key", "x", "y"], ascending=[False, True, True, True])
    centres, diameters = detections[["x", "y"]].to_numpy(float), detections["diameter_m"].to_numpy(float)
    first: list[int] = []
    members: list[list[int]] = []
    for number in range(len(detections)):
        nearest = _nearest(centres, diameters, first, number)
        if nearest is None:
            first.append(number)
            members.append([number])
        else:
            members[nearest].append(number)
    rows: list[dict[str, object]] = []
    for rock in members:
        boxes = detections.iloc[rock]
        share = (boxes.groupby("view")["key"].nunique() / photos).max()
        if share > MIN_SHARE:
            middle = boxes[["x", "y", "diameter_m"]].median()
            rows.append({**middle, "confidence": float(boxes["confidence"].max()), "photos": boxes["key"].nunique()})
    return rows


def _nearest(centres: np.ndarray, diameters: np.ndarray, first: Sequence[int], number: int) -> int | None:
    """Return the index in `first` of the nearest box of the same rock as the box `number`; None without one.

    `centres` (n, 2) and `diameters` (n,) of all boxes, metres; `first`: numbers of the first boxes of rocks.
    """
    if not first:
        return None
    distances = np.linalg.norm(centres[first] - centres[number], axis=1)
    nearest = int(distances.argmin())
    return nearest if distances[nearest] < MERGED_DISTANCE * max(diameters[first[nearest]], diameters[number]) else None
