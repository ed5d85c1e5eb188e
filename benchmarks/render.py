"""Photos per second of the renderer, from files to files, compared with Mitsuba 3 in the same run.

`python -m benchmarks.render [--threads 2] [--samples 4] [--cells 500] [--json FILE]`

Ours: the full photo grid of one terrain and position, 2 cameras x (4 Suns x 2 lights + only rover light) x 7 exposures
x 2 models = 252 photos of 1936 x 1216 pixels, with PNGs, boxes, ids, COCO and tables: `render_twins` as the workflow
calls it, from OBJ meshes on disk. Mitsuba (skipped with a message if it is not installed): photos of the left camera in
sequence, with its fastest CPU variant on this machine, the `direct` integrator, the principled model, the same number
of samples per pixel and of threads; scenes are built and kernels are compiled before the measurement, and no file is
written.

Last metrics (AMD EPYC of Zen 4 with AVX-512, `--threads 1` on two cores at a load of 10, 776,482 triangles): 15.0 CPU
seconds, before compiled loops 22.7; Mitsuba 3.9.1, `llvm_ad_mono`, 0.94 per photo: ours is 15.8 times as fast by CPU
time, 13.9 times by wall time. On two such cores, otherwise idle (`--threads 2`): 31.2 to 32.8 photos/s in six runs, 14
CPU seconds, 1.0 GB. Earlier (two runs, AMD EPYC with AVX2, otherwise idle, two threads): 28.5 and 32.6 CPU seconds,
14.9 and 12.8 photos/s, 12.2 and 12.4 times as fast as Mitsuba, by CPU time 14.5 and 14.8.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.formats import obj
from polarsim.formats.files import write_json
from polarsim.photo import NO_ROCK, PhotoKey
from polarsim.render.lamps import lamps_of_rig, lamps_on
from polarsim.render.options import Model, RenderOptions
from polarsim.render.surfaces import build_surfaces
from polarsim.render.twins import LabelPaths, render_twins
from polarsim.run_files.rigs import write_localised
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import polar
from tests.support.made_terrain import made_terrain, surveyed_rig

SUN_LAMPS = {name: np.array(lamp.point) for name, lamp in polar().lamps.items()}
TERRAIN, POSITION = 4, "A"
EXPOSURES_MS = tuple(2**step for step in range(5, 12))  # of NASA: 32 to 2048
MODELS: tuple[Model, ...] = ("principled", "hapke")


def grid_keys() -> list[PhotoKey]:
    """Return every photo of one terrain and position with light."""
    lights = [("off", sun) for sun in polar().suns] + [("on", sun) for sun in polar().suns] + [("on", "no")]
    return [
        PhotoKey(TERRAIN, POSITION, light, azimuth, camera, exposure)
        for light, azimuth in lights
        for camera in "LR"
        for exposure in EXPOSURES_MS
    ]


def write_terrain(folder: Path, mesh: TerrainMesh) -> None:
    """Write the meshes of ground and rocks."""
    obj.write_obj(folder / obj.ground_name(TERRAIN), mesh.part(NO_ROCK), "ground")
    for rock in mesh.rocks:
        obj.write_obj(folder / obj.rock_name(TERRAIN, rock), mesh.part(rock), f"rock{rock}")


def ours(mesh: TerrainMesh, keys: Sequence[PhotoKey], options: RenderOptions, threads: int) -> dict[str, float]:
    """Return the seconds of the entire stage."""
    with tempfile.TemporaryDirectory() as name:
        out = Path(name)
        for folder in ("cameras", "meshes"):
            (out / folder).mkdir()
        write_localised(out / "cameras" / f"Pos{POSITION}.json", surveyed_rig())
        write_terrain(out / "meshes", mesh)
        wall, cpu = time.perf_counter(), time.process_time()
        render_twins(
            site=polar(),
            terrain=TERRAIN,
            keys=keys,
            cameras=out / "cameras",
            meshes=out / "meshes",
            photos=None,
            twins={model: out / model for model in MODELS},
            labels=LabelPaths(out / "boxes", out / "instances", out / "coco.json", out / "labels.parquet"),
            options=options,
            threads=threads,
        )
        seconds = {"wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
        written = sum(1 for model in MODELS for _ in (out / model).glob("*.png"))
        if written != len(keys) * len(MODELS):
            raise SystemExit(f"{written} photos written, {len(keys) * len(MODELS)} expected")
        return seconds


def mitsuba(mesh: TerrainMesh, options: RenderOptions, threads: int) -> dict[str, Any]:
    """Return Mitsuba's seconds per photo, the mean over nine illuminations; empty without Mitsuba."""
    try:
        import mitsuba as mi
    except ImportError:
        print("Mitsuba is not installed (pip install polarsim[mitsuba]): no comparison")
        return {}
    import drjit as dr

    from tests.support.mitsuba_scene import emitter, mitsuba_scene, variant

    mi.set_variant(name := variant())
    dr.set_thread_count(threads)
    rig = surveyed_rig()
    lens = replace(rig.rig.left, fy=rig.rig.left.fx, distortion=(0.0,) * 5)
    surfaces, lamps = build_surfaces(mesh, options), lamps_of_rig(SUN_LAMPS, rig, polar())
    scenes = []
    for lit in sorted({lamps_on(key) for key in grid_keys()}):
        first, *others = (lamps[lamp] for lamp in lit)
        scene = mitsuba_scene(surfaces, rig.sandbox_from_left, lens, first, options.parameters("principled"))
        scenes.append(mi.load_dict(scene | {f"lamp{number}": emitter(lamp) for number, lamp in enumerate(others)}))
    pictures = [np.array(mi.render(scene, spp=options.samples)) for scene in scenes]
    wall, cpu = time.perf_counter(), time.process_time()
    for scene in scenes:
        np.array(mi.render(scene, spp=options.samples))
    wall_s, cpu_s = (
        (clock - start) / len(scenes) for clock, start in ((time.perf_counter(), wall), (time.process_time(), cpu))
    )
    if not all(picture.any() for picture in pictures):
        raise SystemExit("Mitsuba rendered a black photo")
    return {
        "mitsuba_variant": name,
        "mitsuba_version": mi.__version__,
        "mitsuba_photos_per_s": 1 / wall_s,
        "mitsuba_cpu_s_per_photo": cpu_s,
    }


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--threads", type=int, default=2)
    asked.add_argument("--samples", type=int, default=4, help="rays per pixel")
    asked.add_argument("--cells", type=int, default=500, help="cells along a side of the ground")
    asked.add_argument("--json", type=Path, help="output file of the metrics")
    args = asked.parse_args()
    mesh = made_terrain(args.cells)
    keys = grid_keys()
    options = RenderOptions(samples=args.samples, falloff=True)
    found = ours(mesh, keys, options, args.threads)
    photos = len(keys) * len(MODELS)
    result: dict[str, Any] = {
        "photos": photos,
        "samples": args.samples,
        "threads": args.threads,
        "triangles": len(mesh.faces),
        "photos_per_s": photos / found["wall_s"],
        **found,
        "cpu_s_per_photo": found["cpu_s"] / photos,
        "max_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }
    theirs = mitsuba(mesh, options, args.threads)
    if theirs:
        result |= theirs | {"ratio": result["photos_per_s"] / theirs["mitsuba_photos_per_s"]}
        result["cpu_ratio"] = theirs["mitsuba_cpu_s_per_photo"] / result["cpu_s_per_photo"]
    for name, value in result.items():
        print(f"{name:24s} {value:.4g}" if isinstance(value, float) else f"{name:24s} {value}")
    if args.json:
        write_json(args.json, result)


if __name__ == "__main__":
    main()
