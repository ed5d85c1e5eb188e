"""Write the images and labels of a drive, for each view, Sun, model, exposure and picture time.

Below a drive's folder: `<view>/<Sun>_<model>_<exposure>/NNNNN.png`, `<view>/<Sun>_labels/NNNNN.txt` and `.json`,
`<view>/<Sun>_truth.parquet`, `<view>/<Sun>_coco.json`, `<view>/poses.parquet`. All models and exposures of a frame
share the labels of the Sun. Each frame has a separate label file, so that an interrupted run can be resumed; tables and
COCO files are made from the label files at the end.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.errors import PolarsimError
from polarsim.formats import coco, png, rle, tables, yolo
from polarsim.formats.files import read_json, write_text
from polarsim.geometry.poses import Pose
from polarsim.photo import BOX_CLASSES
from polarsim.progress import track
from polarsim.provenance import identity as identity_of
from polarsim.render.ground_truth import annotate_ids
from polarsim.render.olat import Rendering
from polarsim.render.options import Model, RenderOptions
from polarsim.rover.cameras.layout import POSE_COLUMNS, TRUTH_COLUMNS, labels_folder, picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions, rover_render
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import TRACE, TRACKS, WORLD, read_trace
from polarsim.rover.vehicle.table import Vehicle
from polarsim.rover.world.surface import World

log = logging.getLogger("polarsim.rover")


@dataclass(frozen=True)
class Truth:
    """Labels of a frame of a view under a Sun; `rock` is the number in the world's table."""

    frame: int
    time_s: float
    labels: tuple[coco.Annotation, ...]


def write_frame_truth(folder: Path, truth: Truth, size: tuple[int, int], identity: str) -> None:
    """Write `NNNNN.txt`, YOLO boxes in an image of `size` (width, height), and then `NNNNN.json`."""
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


def read_frame_truth(folder: Path, frame: int, identity: str | None = None) -> Truth | None:
    """Read a frame written by `write_frame_truth`; None if it is missing, broken or has another identity."""
    path = folder / f"{frame:05d}.json"
    if not path.is_file() or not path.with_suffix(".txt").is_file():
        return None
    try:
        content = read_json(path)
        if identity is not None and content["identity"] != identity:
            return None
        width, height = content["size"]
        labels = [_annotation(row, height, width) for row in content["labels"]]
        return Truth(frame, float(content["time_s"]), tuple(labels))
    except (PolarsimError, KeyError, TypeError, ValueError):
        return None  # broken file: the frame is rendered again


def truth_table(truths: Sequence[Truth], world: World, cameras: Mapping[int, Pose]) -> pd.DataFrame:
    """Return a row per label, `TRUTH_COLUMNS`.

    Distances are horizontal, from the camera to the centre of the rock.
    """
    rocks = {row["rock"]: row for row in world.rocks.to_dict("records")}
    rows = []
    for truth in truths:
        eye = cameras[truth.frame].translation
        for label in truth.labels:
            rock = rocks[label.rock]
            distance = float(np.hypot(rock["x_m"] - eye[0], rock["y_m"] - eye[1]))
            pixels = label.mask.area if label.mask else 0
            label_values = (truth.frame, truth.time_s, label.kind, label.rock, *label.box.tolist(), pixels)
            rows.append((*label_values, distance, float(rock["height_m"])))
    dtypes = {"kind": "str", **dict.fromkeys(("frame", "rock", "pixels"), "int64")}
    table = pd.DataFrame(rows, columns=list(TRUTH_COLUMNS))
    return table.astype({name: dtypes.get(name, "float64") for name in TRUTH_COLUMNS})


def pose_table(cameras: Mapping[int, Pose], times: np.ndarray) -> pd.DataFrame:
    """Return a row per frame, `POSE_COLUMNS`: `world_from_camera`, x right, y down, z forward."""
    rows = []
    for frame, pose in sorted(cameras.items()):
        x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat(canonical=True)
        rows.append((frame, float(times[frame]), *pose.translation.tolist(), w, x, y, z))
    return pd.DataFrame(rows, columns=list(POSE_COLUMNS))


def write_tables(
    folder: Path,
    sun: str,
    truths: Sequence[Truth],
    world: World,
    cameras: Mapping[int, Pose],
    size: tuple[int, int],
    pictures_in: str,
) -> None:
    """Write `<Sun>_truth.parquet` and `<Sun>_coco.json` of a view.

    The COCO file names the images of the folder `pictures_in`. The labels are valid for all models and exposures.
    """
    tables.write_parquet(folder / f"{sun}_truth.parquet", truth_table(truths, world, cameras))
    pictures: list[tuple[Mapping[str, Any], Sequence[coco.Annotation]]] = [
        (
            {
                "id": truth.frame + 1,
                "file_name": f"{pictures_in}/{truth.frame:05d}.png",
                "width": size[0],
                "height": size[1],
            },
            truth.labels,
        )
        for truth in truths
    ]
    coco.write_coco_images(folder / f"{sun}_coco.json", pictures, "Rocks and shadows on a drive, rendered by polarsim")


def _annotation(row: Mapping[str, Any], height: int, width: int) -> coco.Annotation:
    mask = rle.Rle(height, width, row["counts"]) if row["counts"] else None
    return coco.Annotation(str(row["kind"]), int(row["rock"]), np.array(row["box"], float), mask, "rendered")


def render_frames(
    folder: Path,
    vehicle: Vehicle,
    options: CameraSuiteOptions,
    seed: int,
    threads: int = 1,
    *,
    render: RenderOptions,
) -> int:
    """Render the missing pictures and labels of a drive and return the number of rendered pictures.

    Pictures of other options, code or drives are rendered again. Their bytes depend neither on `threads` nor on the
    frame at which an earlier run stopped.

    Raises
    ------
    PolarsimError
        The folder contains no drive, a camera is unknown or the disk is full.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, render, seed=seed)
    identity = _identity(folder, vehicle, options, render, seed)
    made = 0
    with ThreadPoolExecutor(max(1, threads)) as pool:
        for frame in track(suite.frames, f"pictures in {folder}"):
            shown = False
            for view in options.views:
                missing = [sun for sun in suite.suns if not _complete(folder, view, sun, frame, options, identity)]
                if not missing:
                    continue
                if not shown:
                    suite.show(frame)
                    shown = True
                rendering = suite.render(view, missing, threads)
                for sun in missing:
                    made += _write(folder, suite, rendering, view, sun, frame, identity, pool)
    for view in options.views:
        _write_tables(folder, suite, view)
    log.info("%s: %d pictures rendered", folder, made)
    return made


def _complete(folder: Path, view: str, sun: str, frame: int, options: CameraSuiteOptions, identity: str) -> bool:
    if read_frame_truth(labels_folder(folder, view, sun), frame, identity) is None:
        return False
    return all((picture_folder(folder, view, sun, *what) / f"{frame:05d}.png").is_file() for what in options.pictures)


def _write(
    folder: Path,
    suite: CameraSuite,
    rendering: Rendering,
    view: str,
    sun: str,
    frame: int,
    identity: str,
    pool: ThreadPoolExecutor,
) -> int:
    """Write the pictures of a frame under a Sun, then its labels; the label file marks the frame as complete."""

    def write(what: tuple[Model, float]) -> None:
        path = picture_folder(folder, view, sun, *what) / f"{frame:05d}.png"
        png.write_png(path, suite.exposed(rendering, view, sun, *what))

    list(pool.map(write, suite.options.pictures))
    write_frame_truth(
        labels_folder(folder, view, sun), truth_of(suite, rendering, sun, frame), _size(suite, view), identity
    )
    return len(suite.options.pictures)


def truth_of(suite: CameraSuite, rendering: Rendering, sun: str, frame: int) -> Truth:
    """Return the labels of a frame; indices of the world's table of rocks become rock numbers."""
    numbers = suite.trace.world.rocks["rock"].to_numpy()
    annotations = annotate_ids(rendering.ids[sun], suite.rover_camera.render_options)
    labels = [replace(label, rock=int(numbers[label.rock - 1])) for label in annotations]
    return Truth(frame, float(suite.trace.tracks.time[frame]), tuple(labels))


def _write_tables(folder: Path, suite: CameraSuite, view: str) -> None:
    cameras = {frame: suite.camera(view, frame).world_from_camera for frame in suite.frames}
    tables.write_parquet(folder / view / "poses.parquet", pose_table(cameras, np.asarray(suite.trace.tracks.time)))
    for sun in suite.suns:
        truths = [read_frame_truth(labels_folder(folder, view, sun), frame) for frame in suite.frames]
        complete: Sequence[Truth] = [truth for truth in truths if truth is not None]
        first = picture_folder(folder, view, sun, *suite.options.pictures[0]).name
        write_tables(folder / view, sun, complete, suite.trace.world, cameras, _size(suite, view), first)


def _size(suite: CameraSuite, view: str) -> tuple[int, int]:
    lens = suite.mounts[view].lens
    return lens.width, lens.height


def _identity(folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, render: RenderOptions, seed: int) -> str:
    """Return the digest of all inputs of a picture, including code but not the choice of views, Suns and exposures."""
    which = {"views", "suns", "exposures_ms", "every", "onboard", "videos"}
    names = (TRACE, TRACKS, f"{WORLD}/ground.npz", f"{WORLD}/rocks.npz", f"{WORLD}/rocks.parquet")
    chosen = json.dumps([options.model_dump(mode="json", exclude=which), rover_render(render)])
    return identity_of(__name__, [folder / name for name in names], vehicle.model_dump_json(), chosen, str(seed))
