"""Cost of a frame of a drive: a view under one Sun, both models, three exposures, labels and files.

`python benchmarks/rover_frames.py [--drive results/RUN/rover/seed0] [--view CamBirdViewLeft] [--frames 5]`

CPU seconds of all threads by part, wall seconds, and maximum resident memory. Without `--drive`, a drive over synthetic
hills and rocks is used (`tests/rover/driven.py`).

Last metrics, a drive of 61 s over the demo's terrains 3, 1 and 11, two threads, otherwise idle; CPU s and wall s:
CamBirdViewLeft, 1920 x 1080, Sun 2 1.99 to 2.45, 1.15 to 1.43, six runs; of 1.99 ground 0.03, render 1.85, expose 0.01,
labels 0.02, files 0.07. front_end_cam, 1936 x 1216, Sun 2 2.09, 1.17, Sun 3 2.27, 1.31. 1.9 GiB. With `finer` 3 instead
of 4, 8 % less time and 1.2 GiB, with 2 17 % and 0.8 GiB. A virtual machine of the same type once needed 1.5 times as
long.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from polarsim.formats import png
from polarsim.rover.cameras.frames import labels_of, write_label_file
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.trace import Trace, read_trace
from polarsim.rover.vehicle.table import read_vehicle


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drive", type=Path, help="folder of a drive")
    parser.add_argument("--vehicle", type=Path, default=Path("config/viper.yaml"))
    parser.add_argument("--view", default="CamBirdViewLeft")
    parser.add_argument("--sun", default="2")
    parser.add_argument("--frames", type=int, default=5, help="number of frames, in the drive's second half")
    parser.add_argument("--threads", type=int, default=1)
    chosen = parser.parse_args()
    options = CameraSuiteOptions(views=(chosen.view,), suns=(chosen.sun,))
    suite = CameraSuite(_trace(chosen.drive), read_vehicle(chosen.vehicle), options)
    start = time.process_time()
    first = len(suite.frames) // 2
    suite.show(first)
    suite.render(chosen.view, [chosen.sun], chosen.threads)  # excludes set-up from the measurement
    print(f"start: {time.process_time() - start:.2f} s, {len(suite.rover_camera.scene.surfaces.faces):,} triangles")
    began = time.perf_counter()
    rows = [_frame(suite, chosen, first + 1 + number) for number in range(chosen.frames)]
    wall = (time.perf_counter() - began) / chosen.frames
    names = ("ground", "render", "expose", "labels", "files")
    median = np.median(rows, axis=0)
    parts = ", ".join(f"{name} {value:.2f}" for name, value in zip(names, median, strict=True))
    lens = suite.mounts[chosen.view].lens
    print(f"{chosen.view}, {lens.width} x {lens.height}, {len(rows)} frames, CPU s: {parts}; all {median.sum():.2f}")
    whole = np.sum(rows, axis=1)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"from {whole.min():.2f} to {whole.max():.2f}; {wall:.2f} s a frame by the clock; {memory:.2f} GiB")


def _frame(suite: CameraSuite, chosen: argparse.Namespace, frame: int) -> list[float]:
    """Return the CPU seconds of each part."""
    view, sun, options = chosen.view, chosen.sun, suite.options
    marks = [time.process_time()]
    suite.show(frame)
    marks.append(time.process_time())
    rendering = suite.render(view, [sun], chosen.threads)
    marks.append(time.process_time())
    pictures = [
        suite.exposed(rendering, view, sun, model, exposure)
        for model in options.models
        for exposure in options.exposures_ms
    ]
    marks.append(time.process_time())
    labels = labels_of(suite, rendering, sun)
    marks.append(time.process_time())
    with tempfile.TemporaryDirectory() as folder:
        for number, picture in enumerate(pictures):
            png.write_png(Path(folder) / f"{number}.png", picture)
        write_label_file(Path(folder) / "labels.txt", labels, pictures[0].shape[::-1])
    marks.append(time.process_time())
    return list(np.diff(marks))


def _trace(drive: Path | None) -> Trace:
    if drive is not None:
        return read_trace(drive)
    from tests.rover.driven import trace

    return trace(seconds=12, start=5.5)


if __name__ == "__main__":
    main()
