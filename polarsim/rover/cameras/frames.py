"""The pictures of a drive as files: every view, Sun, model and exposure at every picture time, with what is in them.

Below a drive's folder: `<view>/<Sun>_<model>_<exposure>/NNNNN.png`, `<view>/<Sun>_labels/NNNNN.txt` and `.json`,
`<view>/<Sun>_truth.parquet`, `<view>/<Sun>_coco.json`, `<view>/poses.parquet`.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from polarsim.detect.parts import digest
from polarsim.digest import code_digest
from polarsim.formats import png, tables
from polarsim.progress import track
from polarsim.render.ground_truth import annotations_of
from polarsim.render.olat import Rendering
from polarsim.render.options import Model
from polarsim.rover.cameras.layout import labels_folder, picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.cameras.truth import Truth, pose_table, read_truth, write_tables, write_truth
from polarsim.rover.drive.trace import DRIVE, TRACE, TRACKS, WORLD, read_trace
from polarsim.rover.vehicle.table import Vehicle

log = logging.getLogger("polarsim.rover")


def render_frames(folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, seed: int, threads: int = 1) -> int:
    """Render what is not there yet of a drive's pictures and labels; how many pictures were made.

    Pictures made with other options or code, or of another drive, are made anew. Their bytes depend neither on
    `threads` nor on where an earlier run stopped.

    Raises
    ------
    PolarsimError
        No drive in the folder, an unknown camera, a full disk.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    identity = _identity(folder, vehicle, options, seed)
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
    log.info("%s: %d pictures made", folder, made)
    return made


def _complete(folder: Path, view: str, sun: str, frame: int, options: CameraSuiteOptions, identity: str) -> bool:
    if read_truth(labels_folder(folder, view, sun), frame, identity) is None:
        return False
    return all(
        (picture_folder(folder, view, sun, model, exposure) / f"{frame:05d}.png").is_file()
        for model in options.models
        for exposure in options.exposures_ms
    )


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
    """Write a frame's pictures under a Sun, and then its labels: where these are, the pictures are."""
    options = suite.options

    def write(what: tuple[Model, float]) -> None:
        path = picture_folder(folder, view, sun, *what) / f"{frame:05d}.png"
        png.write(path, suite.exposed(rendering, view, sun, *what))

    wanted = [(model, exposure) for model in options.models for exposure in options.exposures_ms]
    list(pool.map(write, wanted))
    write_truth(labels_folder(folder, view, sun), truth_of(suite, rendering, sun, frame), _size(suite, view), identity)
    return len(wanted)


def truth_of(suite: CameraSuite, rendering: Rendering, sun: str, frame: int) -> Truth:
    """Labels of a frame as the renderer makes them; its rocks are places in the world's table, those here are rocks."""
    numbers = suite.trace.world.rocks["rock"].to_numpy()
    found = annotations_of(rendering.ids[sun], suite.render_options)
    labels = [
        type(label)(label.kind, int(numbers[label.rock - 1]), label.box, label.mask, label.source) for label in found
    ]
    return Truth(frame, float(suite.trace.tracks.time[frame]), tuple(labels))


def _write_tables(folder: Path, suite: CameraSuite, view: str) -> None:
    cameras = {frame: suite.camera(view, frame).world_from_camera for frame in suite.frames}
    tables.write_parquet(folder / view / "poses.parquet", pose_table(cameras, np.asarray(suite.trace.tracks.time)))
    for sun in suite.suns:
        truths = [read_truth(labels_folder(folder, view, sun), frame) for frame in suite.frames]
        there: Sequence[Truth] = [truth for truth in truths if truth is not None]
        write_tables(folder / view, sun, there, suite.trace.world, cameras, _size(suite, view))


def _size(suite: CameraSuite, view: str) -> tuple[int, int]:
    lens = suite.mounts[view].lens
    return lens.width, lens.height


def _identity(folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, seed: int) -> str:
    """Digest of all that decides a drive's pictures, code included; which views, Suns, exposures there are does not."""
    which = {"views", "suns", "exposures_ms", "every", "onboard", "videos", "video_speed"}
    names = (TRACE, TRACKS, DRIVE, f"{WORLD}/ground.npz", f"{WORLD}/rocks.npz", f"{WORLD}/rocks.parquet")
    chosen = options.model_dump_json(exclude=which)
    return digest(
        (folder / name for name in names), code_digest(__name__), vehicle.model_dump_json(), chosen, str(seed)
    )
