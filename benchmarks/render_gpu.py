"""The photo grid of `render.py` on GPU and CPU, without PNG: `python -m benchmarks.render_gpu [--json FILE]`.

    --device cuda|vulkan|cpu    Taichi's device; default: the first GPU. cpu is for tests.
    --threads 2                 of the CPU's renderer; the device's photos are exposed on all cores
    --samples 4 --cells 500 --scale 1

Without a GPU it prints "skipped: no GPU" and exits with 0. Both renderers compute the same 252 photos of 1936 x 1216
pixels in memory: rays, shadows and reflectance of ten OLAT images per camera, sums, 12 bits. The measurement excludes
the build of the trees and the compilation of kernels (`ready_s`), labels, and PNG files, which the CPU writes in both
cases: `png_bound_photos_per_s` is the rate of all its cores. `ratio` is the ratio of the rates without PNG.

The images of both must be equal except for pixels at edges, where float32 rays of two trees may hit different faces.

On an NVIDIA H100 with 16 cores (776,482 triangles): 450 photos/s without PNG, two threads of the CPU 34.6; OLAT images
17.8 times as fast; 5 of 100,000 pixels differ, brightness by 5e-7. With 16 threads and `--samples 16`: 391 and 51.7.
Sixteen cores write 2,128 PNG files per second.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.render import MODELS, grid_keys
from polarsim.formats import png
from polarsim.formats.files import write_json
from polarsim.photo import PhotoKey
from polarsim.render.gain import default_gain
from polarsim.render.lamps import lamps_of_rig, lamps_on
from polarsim.render.olat import render_view
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose
from polarsim.render.surfaces import Surfaces, build_surfaces
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import polar
from tests.support.made_terrain import made_terrain, surveyed_rig

CAMERAS = ("L", "R")
PNGS = 8  # number of written files for the time per file
FAINT = 1e-3  # minimum difference, relative to an OLAT image's maximum
MAX_DIFFERENT = 5e-3  # maximum share of different pixels of an OLAT image, at edges
MAX_BRIGHTNESS_ERROR = 1e-3  # maximum difference, relative to the mean brightness of an OLAT image

OlatImages = Mapping[tuple[Model, str], np.ndarray]


class Grid:
    """Grid of photos on a device."""

    def __init__(self, mesh: TerrainMesh, options: RenderOptions, scale: float, threads: int, cores: int) -> None:
        """`threads` render, `cores` expose."""
        self.options, self.threads, self.cores, self.scale = options, threads, cores, scale
        self.rig = surveyed_rig()
        self.lamps = lamps_of_rig(
            {name: np.array(lamp.point) for name, lamp in polar().lamps.items()}, self.rig, polar()
        )
        self.surfaces: Surfaces = build_surfaces(mesh, options)
        start = time.perf_counter()
        self.surfaces.prepare(shadows=False)
        self.olat_images("L")  # compiles kernels and copies triangles to the device
        self.ready_s = time.perf_counter() - start

    def olat_images(self, camera: str) -> OlatImages:
        view = self.rig.camera(camera).scaled(self.scale)
        return render_view(self.surfaces, view, self.lamps, MODELS, None, self.options, self.threads).olat_images

    def photos(self, olat_images: OlatImages, keys: Sequence[PhotoKey]) -> list[np.ndarray]:
        """Return the photos of a camera in both models."""
        sets = sorted({(model, key.bracket) for key in keys for model in MODELS}, key=str)

        def exposed(model_and_set: tuple[Model, tuple[object, ...]]) -> list[np.ndarray]:
            model, bracket = model_and_set
            own = [key for key in keys if key.bracket == bracket]
            radiance = np.sum([olat_images[model, name] for name in lamps_on(own[0])], axis=0)
            gain = default_gain(model, self.options, polar())
            return [expose(radiance, key.exposure_ms * gain, self.options) for key in own]

        with ThreadPoolExecutor(self.cores) as pool:
            return [photo for found in pool.map(exposed, sets) for photo in found]

    def timed(self) -> dict[str, Any]:
        """Return the seconds of all photos, the last camera's OLAT images, and some photos."""
        keys, olat_images_s, photos_s, cpu = grid_keys(), 0.0, 0.0, time.process_time()
        for camera in CAMERAS:
            start = time.perf_counter()
            olat_images = self.olat_images(camera)
            between = time.perf_counter()
            photos = self.photos(olat_images, [key for key in keys if key.camera == camera])
            olat_images_s, photos_s = olat_images_s + between - start, photos_s + time.perf_counter() - between
        number = len(keys) * len(MODELS)
        rate = number / (olat_images_s + photos_s)
        return {
            "photos": number,
            "photos_per_s": rate,
            "layers_s": olat_images_s,
            "exposing_s": photos_s,
            "cpu_s": time.process_time() - cpu,
            "layers": olat_images,
            "some": photos[:: max(1, len(photos) // PNGS)],
        }


def find_device() -> str | None:
    """Return the first available GPU of Taichi."""
    from polarsim.geometry.taichi_device import device_available

    return next((device for device in ("cuda", "vulkan") if device_available(device)), None)  # type: ignore[arg-type]


def compare(cpu: OlatImages, device: OlatImages) -> dict[str, float]:
    """Return the maximum over OLAT images of the share of different pixels, and of the mean brightness difference."""
    different = [
        np.mean(np.abs(device[key] - olat_image) > FAINT * olat_image.max()) for key, olat_image in cpu.items()
    ]
    off = [abs(device[key].mean(dtype=float) / olat_image.mean(dtype=float) - 1) for key, olat_image in cpu.items()]
    return {"different_pixels": float(max(different)), "mean_off": float(max(off))}


def png_seconds(photos: Sequence[np.ndarray]) -> float:
    """Return the CPU seconds per written photo."""
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        for number, photo in enumerate(photos):
            png.write_png(Path(folder) / f"{number}.png", photo)
        return (time.process_time() - start) / len(photos)


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--device", choices=("cuda", "vulkan", "cpu"))
    asked.add_argument("--threads", type=int, default=2, help="of the CPU's renderer")
    asked.add_argument("--samples", type=int, default=4, help="rays per pixel")
    asked.add_argument("--cells", type=int, default=500, help="cells along a side of the ground")
    asked.add_argument("--scale", type=float, default=1, help="scale of the photos' sides")
    asked.add_argument("--json", type=Path, help="output file of the metrics")
    args = asked.parse_args()
    device = args.device or find_device()
    if device is None:
        print("skipped: no GPU")
        return
    mesh, cores = made_terrain(args.cells), os.cpu_count() or 1
    options = RenderOptions(samples=args.samples, falloff=True)
    on_device = RenderOptions(**options.model_dump() | {"engine": "taichi", "device": device})
    cpu = Grid(mesh, options, args.scale, args.threads, args.threads)
    cpu_found = cpu.timed()
    gpu = Grid(mesh, on_device, args.scale, args.threads, cores)
    gpu_found = gpu.timed()
    png_s = png_seconds(gpu_found.pop("some"))
    same = compare(cpu_found.pop("layers"), gpu_found.pop("layers"))
    result: dict[str, Any] = {
        "device": device,
        "samples": args.samples,
        "triangles": len(mesh.faces),
        "threads": args.threads,
        "cores": cores,
        **{f"cpu_{name}": value for name, value in cpu_found.items() if name != "some"},
        "cpu_ready_s": cpu.ready_s,
        **{f"device_{name}": value for name, value in gpu_found.items()},
        "device_ready_s": gpu.ready_s,
        "ratio": gpu_found["photos_per_s"] / cpu_found["photos_per_s"],
        "ratio_of_layers": cpu_found["layers_s"] / gpu_found["layers_s"],
        "png_cpu_s": png_s,
        "png_bound_photos_per_s": cores / png_s,
        **same,
    }
    for name, value in result.items():
        print(f"{name:24s} {value:.4g}" if isinstance(value, float) else f"{name:24s} {value}")
    if args.json:
        write_json(args.json, result)
    if same["different_pixels"] > MAX_DIFFERENT or same["mean_off"] > MAX_BRIGHTNESS_ERROR:
        raise SystemExit("the device's images differ from the CPU's images")


if __name__ == "__main__":
    main()
