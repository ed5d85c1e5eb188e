"""Time of a photo with two million triangles, one lamp, one ray per pixel, compared with Mitsuba 3.

`python -m benchmarks.single_photo`, with `--threads 2`, `--cells 1000` (along a side of the ground), `--json FILE`.
Prints CPU and wall seconds to prepare the scene, and for a photo: the median of five, and separately the first photo,
which loads compiled code.

Last metrics (AMD EPYC of Zen 4 with AVX-512, `--threads 1` on two cores at a load of 10, 2.3 million triangles), CPU
seconds: ours prepared in 2.2, a photo 0.47, before compiled loops 0.66; Mitsuba 3.9.1, `llvm_ad_mono`, prepared in 1.5,
a photo 0.41. Of ours, Embree needs 0.33. Earlier (AVX2, otherwise idle, two threads), two runs: ours prepared in 1.84
and 2.17, a photo 0.82 and 1.11; Mitsuba 3.9.1, `llvm_ad_mono`, prepared in 1.77 and 2.37, a photo 0.65 and 0.87. Our
rays need 0.34 to the surface and 0.21 to the lamp; 0.07 of this is Embree's robust traversal, without which 30 of 2.1
million pixels pass between two triangles at an edge.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TypeVar

import numpy as np

from polarsim.formats.files import write_json
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.render.lamps import lamps_of_rig
from polarsim.render.olat import render_view
from polarsim.render.options import RenderOptions
from polarsim.render.sensor import expose
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import polar
from tests.support.made_terrain import made_terrain, surveyed_rig

SUN_LAMPS = {name: np.array(lamp.point) for name, lamp in polar().lamps.items()}
T = TypeVar("T")
SUN, REPEATS = "30", 5
OPTIONS = RenderOptions(falloff=True, bounce=0)


class Clock:
    """Records CPU and wall seconds by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}

    def __call__(self, name: str, work: Callable[[], T]) -> T:
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        self._add(name, time.process_time() - cpu, time.perf_counter() - wall)
        return result

    def photos(self, name: str, work: Callable[[], object]) -> None:
        self(f"{name}_first", work)
        for _ in range(REPEATS):
            self(f"{name}_photo", work)

    def _add(self, name: str, cpu_s: float, wall_s: float) -> None:
        self.seconds.setdefault(f"{name}_cpu_s", []).append(cpu_s)
        self.seconds.setdefault(f"{name}_wall_s", []).append(wall_s)


def ours(mesh: TerrainMesh, lens: Lens, clock: Clock, threads: int) -> None:
    rig = surveyed_rig()
    surfaces = clock("ready", lambda: build_surfaces(mesh, OPTIONS))
    clock("tree", lambda: surfaces.prepare(shadows=False))
    lamps = {SUN: lamps_of_rig(SUN_LAMPS, rig, polar())[SUN]}

    def photo() -> np.ndarray:
        view = render_view(surfaces, Camera(rig.sandbox_from_left, lens), lamps, ["principled"], None, OPTIONS, threads)
        return expose(view.olat_images["principled", SUN], 1.0, OPTIONS)

    clock.photos("our", photo)


def mitsuba(mesh: TerrainMesh, lens: Lens, clock: Clock, threads: int) -> None:
    try:
        import mitsuba as mi
    except ImportError:
        print("Mitsuba is not installed (pip install polarsim[mitsuba]): no comparison")
        return
    import drjit as dr

    from tests.support.mitsuba_scene import mitsuba_scene, variant

    mi.set_variant(name := variant())
    dr.set_thread_count(threads)
    rig = surveyed_rig()
    surfaces, lamp = build_surfaces(mesh, OPTIONS), lamps_of_rig(SUN_LAMPS, rig, polar())[SUN]
    plan = mitsuba_scene(surfaces, rig.sandbox_from_left, lens, lamp, OPTIONS.principled)
    scene = clock("mitsuba_ready", lambda: mi.load_dict(plan))
    clock.photos("mitsuba", lambda: np.array(mi.render(scene, spp=1)))
    print(f"Mitsuba {mi.__version__}, {name}")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--threads", type=int, default=2)
    asked.add_argument("--cells", type=int, default=1000, help="cells along a side of the ground")
    asked.add_argument("--json", type=Path, help="output file of the metrics")
    args = asked.parse_args()
    mesh, clock = made_terrain(args.cells), Clock()
    lens = replace(surveyed_rig().rig.left, fy=surveyed_rig().rig.left.fx, distortion=(0.0,) * 5)
    ours(mesh, lens, clock, args.threads)
    mitsuba(mesh, lens, clock, args.threads)
    results = {"triangles": len(mesh.faces)} | {name: median(values) for name, values in clock.seconds.items()}
    for name, value in results.items():
        print(f"{name:24s} {value:.4g}")
    if args.json:
        write_json(args.json, results)


if __name__ == "__main__":
    main()
