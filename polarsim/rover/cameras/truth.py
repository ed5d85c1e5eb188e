"""What is to be seen in each picture of a drive: boxes and masks of rocks and shadows, and where the camera stood.

A frame's labels are those of all its models and exposures under one Sun. They lie in one file a frame, so that a
stopped run goes on; tables and COCO files are made of them at the end.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.errors import PolarsimError
from polarsim.formats import coco, rle, tables, yolo
from polarsim.formats.files import read_json, write_text
from polarsim.geometry.poses import Pose
from polarsim.photo import BOX_CLASSES
from polarsim.rover.cameras.layout import POSE_COLUMNS, TRUTH_COLUMNS
from polarsim.rover.world.surface import World


@dataclass(frozen=True)
class Truth:
    """The labels of one frame of a view under one Sun; rocks bear the world's numbers."""

    frame: int
    time_s: float
    labels: tuple[coco.Annotation, ...]


def write_truth(folder: Path, truth: Truth, size: tuple[int, int], identity: str) -> None:
    """Write `NNNNN.txt`, boxes as YOLO has them in a picture of `size` (width, height), and then `NNNNN.json`."""
    yolo.write_boxes(
        folder / f"{truth.frame:05d}.txt",
        np.array([BOX_CLASSES.index(label.kind) for label in truth.labels], int),
        np.array([label.box for label in truth.labels], float),
        size,
    )
    rows = [
        {
            "kind": label.kind,
            "rock": label.rock,
            "box": label.box.tolist(),
            "counts": label.mask.counts if label.mask else "",
        }
        for label in truth.labels
    ]
    content = {"identity": identity, "time_s": truth.time_s, "size": list(size), "labels": rows}
    write_text(folder / f"{truth.frame:05d}.json", json.dumps(content) + "\n")


def read_truth(folder: Path, frame: int, identity: str | None = None) -> Truth | None:
    """Read what `write_truth` wrote; None where it is not there, or of another identity."""
    path = folder / f"{frame:05d}.json"
    if not path.is_file() or not path.with_suffix(".txt").is_file():
        return None
    try:
        content = read_json(path)
        if identity is not None and content["identity"] != identity:
            return None
        width, height = content["size"]
        labels = [_label(row, height, width) for row in content["labels"]]
        return Truth(frame, float(content["time_s"]), tuple(labels))
    except (PolarsimError, KeyError, TypeError, ValueError):
        return None  # broken: made anew


def truth_table(truths: Sequence[Truth], world: World, cameras: Mapping[int, Pose]) -> pd.DataFrame:
    """A row a label, `TRUTH_COLUMNS`; distances along the ground from the camera at its frame to the rock's middle."""
    rocks = {row["rock"]: row for row in world.rocks.to_dict("records")}
    rows = []
    for truth in truths:
        place = cameras[truth.frame].translation
        for label in truth.labels:
            rock = rocks[label.rock]
            distance = float(np.hypot(rock["x_m"] - place[0], rock["y_m"] - place[1]))
            pixels = label.mask.area if label.mask else 0
            own = (truth.frame, truth.time_s, label.kind, label.rock, *label.box.tolist(), pixels)
            rows.append((*own, distance, float(rock["height_m"])))
    table = pd.DataFrame(rows, columns=list(TRUTH_COLUMNS))
    for name in ("frame", "rock", "pixels"):
        table[name] = table[name].astype("int64")
    for name in ("time_s", "x0", "y0", "x1", "y1", "distance_m", "height_m"):
        table[name] = table[name].astype("float64")
    table["kind"] = table["kind"].astype("str")
    return table


def pose_table(cameras: Mapping[int, Pose], times: np.ndarray) -> pd.DataFrame:
    """A row a frame, `POSE_COLUMNS`: `world_from_camera`, x right, y down, z forward."""
    rows = []
    for frame, pose in sorted(cameras.items()):
        x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat(canonical=True)
        rows.append((frame, float(times[frame]), *pose.translation.tolist(), w, x, y, z))
    return pd.DataFrame(rows, columns=list(POSE_COLUMNS))


def write_tables(
    folder: Path, sun: str, truths: Sequence[Truth], world: World, cameras: Mapping[int, Pose], size: tuple[int, int]
) -> None:
    """`<Sun>_truth.parquet` and `<Sun>_coco.json` of a view."""
    tables.write_parquet(folder / f"{sun}_truth.parquet", truth_table(truths, world, cameras))
    pictures: list[tuple[Mapping[str, Any], Sequence[coco.Annotation]]] = [
        (
            {"id": truth.frame + 1, "file_name": f"{truth.frame:05d}.png", "width": size[0], "height": size[1]},
            truth.labels,
        )
        for truth in truths
    ]
    coco.write_pictures(folder / f"{sun}_coco.json", pictures, "Rocks and shadows on a drive, rendered by polarsim")


def _label(row: Mapping[str, Any], height: int, width: int) -> coco.Annotation:
    mask = rle.Rle(height, width, row["counts"]) if row["counts"] else None
    return coco.Annotation(str(row["kind"]), int(row["rock"]), np.array(row["box"], float), mask, "rendered")
