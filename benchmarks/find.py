"""Speed and memory of `polarsim detect` on photos of 1936 x 1216 pixels.

    python benchmarks/find.py PICTURE ... [--threads 2] [--weights DETECTOR.pt] [--precision P] [--no-draw]

Each picture is processed four times under different names; the first pass includes start-up and is ignored. Wall time
depends on other processes; CPU seconds are the cost of a photo.

Last metrics (AMD EPYC, Zen 4, two cores, otherwise idle, eight cover photos, packaged detector, with output images):
two threads 7.81 and 7.84 photos/s, 0.25 CPU seconds per photo, 0.54 GB. The previous packaged detector with an
inference width of 1,792 px: 5.94 and 6.30 photos/s, 0.32 and 0.30 CPU seconds, 0.61 GB; one thread 3.35 photos/s,
0.51 GB.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import sys
import tempfile
import time
from pathlib import Path

from polarsim.annotate.detections import draw_detections
from polarsim.detect.detect_pictures import detect_in_images, prediction_options
from polarsim.detect.options import PACKAGED

REPEATS = 4


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", type=Path, nargs="+")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--weights", type=Path, default=PACKAGED)
    parser.add_argument("--precision", choices=["float32", "bfloat16"], default="float32")
    parser.add_argument("--draw", action=argparse.BooleanOptionalAction, default=True)
    given = parser.parse_args()
    root = Path(tempfile.mkdtemp())
    try:
        for number in range(REPEATS):
            for path in given.pictures:
                shutil.copy(path, root / f"{path.stem}_{number}{path.suffix}")
        paths = sorted(root.iterdir())
        options = prediction_options([], [], "cpu", precision=given.precision)
        spent: list[tuple[float, float]] = []
        for name, some in (("first", paths[:1]), ("all", paths)):
            start = time.perf_counter(), time.process_time()
            detect_in_images(
                pictures=some, weights=[given.weights], out=root / name, options=options, threads=given.threads,
                draw=draw_detections if given.draw else None,
            )  # fmt: skip
            spent.append((time.perf_counter() - start[0], time.process_time() - start[1]))
        wall_s, cpu_s = spent[1]
        memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        sys.stdout.write(
            f"{given.threads} threads, {len(paths)} photos: {len(paths) / wall_s:.2f} photos/s, "
            f"{cpu_s / len(paths):.3f} CPU s a photo, {cpu_s / wall_s:.2f} cores, {memory_mb:.0f} MB\n"
        )
    finally:
        shutil.rmtree(root)


if __name__ == "__main__":
    main()
