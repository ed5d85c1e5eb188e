"""Write the images and labels of a drive, for each view, Sun, model, exposure and picture time.

Below a drive's folder: `<view>/<Sun>_<model>_<exposure>/NNNNN.png`, `<view>/<Sun>_labels/NNNNN.txt`,
`<view>/<Sun>_truth.parquet`, `<view>/<Sun>_coco.json`, `<view>/poses.parquet`. All models and exposures of a frame
share the labels of the Sun.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from polarsim.formats import coco, png, tables, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.poses import Pose
from polarsim.photo import BOX_CLASSES
from polarsim.progress import track
from polarsim.provenance import identity, is_current, store_identity
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
POSES = "poses.parquet"  # written last
Labels = Mapping[int, Sequence[Annotation]]  # by frame; `rock` is the number in the world's table


def render_frames(
    folder: Path,
    vehicle: Vehicle,
    options: CameraSuiteOptions,
    seed: int,
    threads: int = 1,
    *,
    render: RenderOptions,
) -> int:
    """Render the pictures and labels of a drive and return the number of rendered pictures.

    A complete view of the same drive, options and code is kept. `threads` does not affect the output.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, render, seed=seed)
    made_with = _identity(folder, vehicle, options, render, seed)
    views = [view for view in options.views if not is_current(folder / view / POSES, made_with)]
    labels: dict[str, dict[str, dict[int, list[Annotation]]]] = {
        view: {sun: {} for sun in suite.suns} for view in views
    }
    with ExitStack() as stack:
        for view in views:
            stack.enter_context(store_identity(folder / view / POSES, made_with))
        pool = stack.enter_context(ThreadPoolExecutor(max(1, threads)))
        for frame in track(suite.frames if views else [], f"pictures in {folder}"):
            suite.show(frame)
            for view in views:
                rendering = suite.render(view, list(suite.suns), threads)
                for sun in suite.suns:
                    _write_pictures(folder, suite, rendering, view, sun, frame, pool)
                    labels[view][sun][frame] = found = labels_of(suite, rendering, sun)
                    size = suite.mounts[view].lens.shape[::-1]
                    write_label_file(labels_folder(folder, view, sun) / f"{frame:05d}.txt", found, size)
        for view in views:
            _write_tables(folder, suite, view, labels[view])
    made = len(views) * len(suite.frames) * len(suite.suns) * len(options.pictures)
    log.info("%s: %d pictures rendered", folder, made)
    return made


def _write_pictures(
    folder: Path, suite: CameraSuite, rendering: Rendering, view: str, sun: str, frame: int, pool: ThreadPoolExecutor
) -> None:
    def write(what: tuple[Model, float]) -> None:
        path = picture_folder(folder, view, sun, *what) / f"{frame:05d}.png"
        png.write_png(path, suite.exposed(rendering, view, sun, *what))

    list(pool.map(write, suite.options.pictures))


def write_label_file(path: Path, labels: Sequence[Annotation], size: tuple[int, int]) -> None:
    """Write the YOLO boxes of an image of `size` (width, height)."""
    classes = np.array([BOX_CLASSES.index(label.kind) for label in labels], int)
    yolo.write_boxes(path, classes, np.array([label.box for label in labels], float), size)


def labels_of(suite: CameraSuite, rendering: Rendering, sun: str) -> list[Annotation]:
    """Return the labels of an image; indices of the world's table of rocks become rock numbers."""
    numbers = suite.trace.world.rocks["rock"].to_numpy()
    annotations = annotate_ids(rendering.ids[sun], suite.rover_camera.render_options)
    return [replace(label, rock=int(numbers[label.rock - 1])) for label in annotations]


def _write_tables(folder: Path, suite: CameraSuite, view: str, by_sun: Mapping[str, Labels]) -> None:
    """Write `<Sun>_truth.parquet`, `<Sun>_coco.json`, and the poses.

    The COCO file names the images of the first set. The labels are valid for all models and exposures.
    """
    cameras = {frame: suite.camera(view, frame).world_from_camera for frame in suite.frames}
    times = np.asarray(suite.trace.tracks.time)
    height, width = suite.mounts[view].lens.shape
    for sun, labels in by_sun.items():
        truth = _truth_table(labels, suite.trace.world, cameras, times)
        tables.write_parquet(folder / view / f"{sun}_truth.parquet", truth)
        pictures = picture_folder(folder, view, sun, *suite.options.pictures[0]).name
        images = [
            ({"id": n + 1, "file_name": f"{pictures}/{n:05d}.png", "width": width, "height": height}, of_frame)
            for n, of_frame in labels.items()
        ]
        coco.write_coco_images(
            folder / view / f"{sun}_coco.json", images, "Rocks and shadows on a drive, rendered by polarsim"
        )
    tables.write_parquet(folder / view / POSES, pose_table(cameras, times))


def _truth_table(labels: Labels, world: World, cameras: Mapping[int, Pose], times: np.ndarray) -> pd.DataFrame:
    """Return a row per label, `TRUTH_COLUMNS`, with the horizontal distance of the camera from the rock's centre."""
    rocks = {row["rock"]: row for row in world.rocks.to_dict("records")}
    rows = []
    for frame, of_frame in labels.items():
        eye = cameras[frame].translation
        for label in of_frame:
            rock = rocks[label.rock]
            distance = float(np.hypot(rock["x_m"] - eye[0], rock["y_m"] - eye[1]))
            identified = (frame, float(times[frame]), label.kind, label.rock, *label.box.tolist())
            rows.append((*identified, label.mask.area if label.mask else 0, distance, float(rock["height_m"])))
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


def _identity(folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, render: RenderOptions, seed: int) -> str:
    """Return the digest of all inputs of the pictures of a view, including code but not the choice of views."""
    names = (TRACE, TRACKS, f"{WORLD}/ground.npz", f"{WORLD}/rocks.npz", f"{WORLD}/rocks.parquet")
    unused = {"views", "onboard", "videos"}
    chosen = json.dumps([options.model_dump(mode="json", exclude=unused), rover_render(render)])
    return identity(__name__, [folder / name for name in names], vehicle.model_dump_json(), chosen, str(seed))
