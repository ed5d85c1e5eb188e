"""What a view and a photo cost: `python benchmarks/render_costs.py [threads]` prints CPU and wall seconds.

Scene: 1.28 million triangles of ground (5 mm cells), 40 rocks, 1936 x 1216 pixels, five lamps, seen from A.
Last figures, CPU seconds on one thread (two cores shared with other work, which makes them longer; NumPy 2.4):

    build 7.8    five OLAT images of a view: lambert 4.8, principled 5.0, hapke 5.6, both of these 6.5, and ids as
    well 6.6 a photo, exposed and written 0.041

Ten OLAT images (five lamps, two models) through the lens, measured later on cores less shared, where both models
took 3.1: blur, halo and veiling glare 0.6, vignetting 0.4, lens flare 0.7.

So a terrain with 4 views and 96 photos in two models takes 35 CPU seconds, 8 of them for its PNG files.

Reflectance in nanoseconds a point, one thread, float32, NumPy / Taichi 1.7: Hapke 130 / 270, principled 50 / 53 where
all points are lit; 125 / 75 and 50 / 25 where half of them are not; Taichi needs 2 s more to load and compile. Later,
with AVX-512, Numba / NumPy: Hapke 11 / 82, principled 2.2 / 28, so Numba is the default engine.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from made_terrain import made_terrain, surveyed_rig

from polarsim.geometry.camera import Camera
from polarsim.photo import PhotoKey, by_bracket
from polarsim.render.gain import default_gain
from polarsim.render.ground_truth import boxes_of
from polarsim.render.lamps import lamps_of
from polarsim.render.olat import reflectance_engine, render_view
from polarsim.render.optics import through_lens
from polarsim.render.options import RenderOptions
from polarsim.render.surfaces import surfaces_of
from polarsim.render.twin_writer import write_photos
from polarsim.survey import SUN_LAMPS


def timed(text: str, work):  # type: ignore[no-untyped-def]
    start, cpu = time.perf_counter(), time.process_time()
    result = work()
    print(f"{text:56s} {time.process_time() - cpu:6.2f} s CPU {time.perf_counter() - start:6.2f} s wall")
    return result


def main() -> None:
    threads = int(sys.argv[1]) if len(sys.argv) > 1 else 1
    options = RenderOptions()
    rig = surveyed_rig()
    lens, pose = rig.rig.left, rig.sandbox_from_left
    surfaces = surfaces_of(made_terrain(cells=800), options)
    timed("build", lambda: surfaces.prepare(shadows=True))
    lamps = lamps_of(SUN_LAMPS, rig)
    for models in (["lambert"], ["principled"], ["hapke"]):
        olat_images = timed(
            f"five OLAT images of a view, {models[0]}",
            lambda models=models: (
                render_view(surfaces, Camera(pose, lens), lamps, models, None, options, threads).olat_images
            ),
        )
    models = ["principled", "hapke"]
    timed("both models", lambda: render_view(surfaces, Camera(pose, lens), lamps, models, None, options, threads))
    view = timed(
        "both, with ids",
        lambda: render_view(surfaces, Camera(pose, lens), lamps, models, list(lamps), options, threads),
    )
    for faults in ({"blur_px": 0.6, "bloom": 0.01, "veiling_glare": 0.01}, {"vignetting": True}, {"lens_flare": 0.001}):
        faulty = options.model_copy(update=faults)
        timed(
            f"ten OLAT images through a lens: {', '.join(faults)}",
            lambda faulty=faulty: through_lens(view.olat_images, lamps, surfaces, Camera(pose, lens), faulty, threads),
        )
    pictures = view.ids
    timed("boxes of five pictures of ids", lambda: [boxes_of(picture, options) for picture in pictures.values()])
    keys = [PhotoKey(4, "A", "on", azimuth, "L", 2**n) for azimuth in ("30", "180", "350") for n in range(5, 12)]
    by_lamp = {name: olat_image for (_, name), olat_image in olat_images.items()}
    with tempfile.TemporaryDirectory() as folder:
        gain = default_gain("hapke", options)
        timed(
            f"{len(keys)} photos, exposed and written",
            lambda: [
                write_photos(Path(folder), bracket, by_lamp, lens, gain, options)
                for bracket in by_bracket(keys).values()
            ],
        )
    vectors = np.random.default_rng(2).normal(size=(3, 400_000, 3)).astype(np.float32)
    vectors[:, :, 2] = np.abs(vectors[:, :, 2])
    vectors /= np.linalg.norm(vectors, axis=2, keepdims=True)
    for engine in ("numba", "numpy", "taichi"):
        reflectance = reflectance_engine(options.model_copy(update={"engine": engine}), threads)
        for model in ("principled", "hapke"):
            reflectance(options.parameters(model), *vectors)  # compiles
            timed(
                f"reflectance of 400,000 points, {model}, {engine}",
                lambda f=reflectance, m=model: f(options.parameters(m), *vectors),
            )


if __name__ == "__main__":
    main()
