"""Videos of a drive, `[view]_[Sun]_[BRDF]_[exposure].webm` as in the paper, in the open codec AV1.

The encoder is SVT-AV1 with one thread per video, so that equal pictures give equal bytes. It is part of PyAV, which
only this module imports.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.errors import RoverError
from polarsim.formats import png, tables
from polarsim.formats.files import writing
from polarsim.photo import BLACK_LEVEL, COLOURS, WHITE_LEVEL
from polarsim.progress import track
from polarsim.render.options import Model
from polarsim.rover.cameras.layout import BOX, DETECTION_COLUMNS, frame_files, picture_folder
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import read_trace
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.table import Vehicle
from polarsim.run_files.picture_sets import exposure_name
from polarsim.tone import to_8bit

_PRESET, _QUALITY = "10", "32"  # SVT-AV1: fast preset; constant quality, 0 (best) to 63
SPEED = 0.5  # playback speed relative to real time, as in the paper
_BRDF = {"principled": "default"}  # name in the paper


def video_name(view: str, sun: str, model: Model, exposure_ms: float) -> str:
    """Return the file name of a video, as in the paper except for the container."""
    return f"{view}_{sun}_{_BRDF.get(model, model)}_{exposure_name(exposure_ms)}.webm"


def write_videos(folder: Path, vehicle: Vehicle, options: CameraSuiteOptions, seed: int, threads: int = 1) -> None:
    """Write the videos of a drive's pictures into `videos/`; front camera videos with detections, if there are any.

    `threads`: number of videos encoded in parallel. Does not affect the output.
    """
    suite = CameraSuite(read_trace(folder), vehicle, options, seed=seed)
    rate = frame_rate(np.asarray(suite.trace.tracks.time)[suite.frames], SPEED)

    def write(view: str, sun: str, model: Model, exposure_ms: float) -> None:
        pictures = picture_folder(folder, view, sun, model, exposure_ms)
        files = frame_files(pictures, suite.frames)
        detections = pictures / "detections.parquet"
        boxes = tables.read_parquet(detections, DETECTION_COLUMNS) if view == FRONT and detections.is_file() else None
        shown = _shown(files, suite.frames, boxes, options.onboard.confidence)
        write_video(folder / "videos" / video_name(view, sun, model, exposure_ms), shown, rate)

    with ThreadPoolExecutor(max(1, threads)) as pool:
        jobs = [
            pool.submit(write, view, sun, *what)
            for view, sun, what in product(options.views, suite.suns, options.pictures)
        ]
        try:
            for job in track(jobs, f"videos in {folder}"):
                job.result()
        finally:
            for job in jobs:
                job.cancel()


def frame_rate(times: np.ndarray, speed: float) -> Fraction:
    """Return the frame rate, 1/s, at which pictures with times (n,) play at a speed."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return Fraction(speed / step).limit_denominator(1000)


def write_video(path: Path, pictures: Iterable[np.ndarray], rate: Fraction) -> None:
    """Encode pictures (h, w, 3) uint8, RGB, of equal size; odd sides lose a pixel."""
    import av  # an optional dependency

    os.environ.setdefault("SVT_LOG", "1")  # errors only; otherwise the encoder prints its settings
    with writing(path) as temporary, av.open(str(temporary), "w", options={"fflags": "+bitexact"}) as container:
        stream: Any = None
        for picture in pictures:
            height, width = (side // 2 * 2 for side in picture.shape[:2])
            if stream is None:
                stream = container.add_stream("libsvtav1", rate=rate)
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                stream.codec_context.flags |= 1 << 23  # AV_CODEC_FLAG_BITEXACT: no program names in the file
                stream.options = {"preset": _PRESET, "crf": _QUALITY, "svtav1-params": "lp=1"}
                with _priority_kept():
                    stream.codec_context.open()
            image = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture[:height, :width]), format="rgb24")
            container.mux(stream.encode(image))
        if stream is None:
            raise RoverError("a video needs at least one picture", path=path)
        container.mux(stream.encode())


@contextmanager
def _priority_kept() -> Iterator[None]:
    """Restore the scheduling of all threads: as root, SVT-AV1 gives its threads and the caller real-time priority.

    These threads, and all later child processes of the caller, would block other processes of the machine.
    """
    if not hasattr(os, "sched_setscheduler"):  # only Linux has this function
        yield
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        yield
    finally:
        for thread in Path("/proc/self/task").iterdir():
            with suppress(ProcessLookupError):  # the thread has ended
                os.sched_setscheduler(int(thread.name), policy, parameters)


def with_boxes(picture: np.ndarray, boxes: pd.DataFrame) -> np.ndarray:
    """Return the picture (h, w, 3) with boxes, columns kind, confidence and corners: rocks yellow, shadows blue."""
    import cv2

    picture = picture.copy()
    width = max(1, round(picture.shape[1] / 640))
    for row in boxes.to_dict("records"):
        colour = COLOURS[str(row["kind"])]
        x0, y0, x1, y1 = (round(float(row[corner])) for corner in BOX)
        cv2.rectangle(picture, (x0, y0), (x1, y1), colour, width)
        content = f"{row['confidence']:.2f}"
        cv2.putText(picture, content, (x0, max(y0 - 2 * width, 8)), cv2.FONT_HERSHEY_SIMPLEX, 0.25 * width, colour, 1)
    return picture


def _shown(paths: list[Path], frames: list[int], boxes: pd.DataFrame | None, confidence: float) -> Iterator[np.ndarray]:
    for path, frame in zip(paths, frames, strict=True):
        picture = to_8bit(png.read_png(path), WHITE_LEVEL - BLACK_LEVEL)  # full range, the same for all frames
        if boxes is not None:
            selected = boxes[(boxes["frame"] == frame) & (boxes["confidence"] >= confidence)]
            picture = with_boxes(picture, selected[["kind", "confidence", *BOX]])
        yield picture
