"""How time and memory of a view grow: `python benchmarks/render_growth.py` prints CPU seconds and peak memory.

A view of one lamp, the principled model, one ray a pixel, with 10^4 to 10^7 triangles; then of 1 to 8 lamps and of
1/16 to all of a photo's pixels, at 10^6. Each in a process of its own, since peak memory is a process's. The last lines
say whether one thread and four wrote the same bytes.

Last figures (AMD EPYC, one thread beside other work), CPU seconds of a view, and to get its scene ready:

    triangles    9.4e3: 1.1, 0.05    9.4e4: 1.2, 0.17    1.0e6: 1.0, 1.3    1.0e7: 1.8, 19 and 2.9 GB
    lamps        1: 1.1    2: 1.6    4: 2.5    8: 4.4
    pixels       147,136: 0.09    588,544: 0.35    2,354,176: 1.1
"""

from __future__ import annotations

import hashlib
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np
from made_terrain import made_terrain, surveyed_rig

from polarsim.geometry.camera import Camera
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import surfaces_of

ROCKS = 1  # of 6,962 triangles: the ground is what grows


@dataclass(frozen=True)
class Task:
    cells: int = 707
    lamps: int = 1
    scale: float = 1.0
    threads: int = 1


@dataclass(frozen=True)
class Cost:
    triangles: int
    pixels: int
    ready_s: float  # CPU seconds from a mesh in memory to the first ray
    view_s: float  # CPU seconds of the view
    peak_mb: int
    digest: str


def cost(task: Task) -> Cost:
    mesh = made_terrain(task.cells, ROCKS)
    start = time.process_time()
    surfaces = surfaces_of(mesh, RenderOptions())
    surfaces.prepare(shadows=False)
    ready = time.process_time()
    rig = surveyed_rig()
    lens = rig.rig.left.scaled(task.scale)
    lamps = {f"{angle:.2f}": Lamp(np.array([4 * np.cos(angle), 4 * np.sin(angle), 1.0])) for angle in range(task.lamps)}
    view = render_view(
        surfaces, Camera(rig.sandbox_from_left, lens), lamps, ["principled"], None, RenderOptions(), task.threads
    )
    digest = hashlib.sha256(b"".join(olat_image.tobytes() for olat_image in view.olat_images.values())).hexdigest()
    seconds = (ready - start, time.process_time() - ready)
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    return Cost(len(mesh.faces), lens.width * lens.height, *seconds, peak_mb, digest)


def measured(task: Task) -> Cost:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(cost, task).result()


def main() -> None:
    for name, tasks in (
        ("triangles", [Task(cells) for cells in (36, 210, 707, 2236)]),
        ("lamps", [Task(lamps=lamps) for lamps in (1, 2, 4, 8)]),
        ("pixels", [Task(scale=scale) for scale in (0.25, 0.5, 1.0)]),
    ):
        for task in tasks:
            found = measured(task)
            print(
                f"{name:10s} {found.triangles:9d} triangles {task.lamps} lamps {found.pixels:8d} pixels: "
                f"ready {found.ready_s:6.2f} s, view {found.view_s:5.2f} s, {found.peak_mb:5d} MB",
                flush=True,
            )
    alike = {measured(Task(threads=threads)).digest for threads in (1, 4)}
    print("threads    1 and 4 wrote", "the same bytes" if len(alike) == 1 else "DIFFERENT BYTES")


if __name__ == "__main__":
    main()
