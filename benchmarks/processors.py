"""Pixels of a view that depend on the processor: `python -m benchmarks.processors [--cells 300] [--engine numba]`.

A view of three lamps with 4 rays per pixel is rendered twice in separate processes: with all features of this
processor, and without AVX-512, which is disabled in NumPy, OpenBLAS, Numba and Embree. For every OLAT image, its photo
at 256 ms and every image of ids, the script prints the number of different pixels and their difference. The content of
PNG files is compared, not the bytes, because ISA-L writes them and cannot be configured.

Last metrics: see "Renderer" in docs/notes/render.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from polarsim.geometry import embree_library
from polarsim.geometry.camera import Camera
from polarsim.render.gain import default_gain
from polarsim.render.lamps import lamps_of_rig
from polarsim.render.olat import render_view
from polarsim.render.options import Model, RenderOptions
from polarsim.render.sensor import expose
from polarsim.render.surfaces import build_surfaces
from polarsim.site import polar
from tests.support.made_terrain import made_terrain, surveyed_rig

SUN_LAMPS = {name: np.array(lamp.point) for name, lamp in polar().lamps.items()}
LAMPS, EXPOSURE_MS = ("30", "180", "rover"), 256
MODELS: tuple[Model, ...] = ("principled", "hapke")
WITHOUT_AVX512 = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "+avx2,+fma,+bmi,+bmi2,+f16c,+popcnt,+sse4.2",
}


def render(out: Path, cells: int, options: RenderOptions) -> None:
    """Write all images of the view to an NPZ file."""
    rig = surveyed_rig()
    camera = Camera(rig.sandbox_from_left, rig.rig.left)
    lamps = {name: lamp for name, lamp in lamps_of_rig(SUN_LAMPS, rig, polar()).items() if name in LAMPS}
    view = render_view(build_surfaces(made_terrain(cells), options), camera, lamps, MODELS, LAMPS[:2], options)
    pictures = {f"ids {name}": ids for name, ids in view.ids.items()}
    for (model, name), image in view.olat_images.items():
        pictures[f"OLAT {model} {name}"] = image
        pictures[f"photo {model} {name}"] = expose(image, EXPOSURE_MS * default_gain(model, options, polar()), options)
    np.savez(out, **pictures)  # type: ignore[arg-type]


def difference(name: str, here: np.ndarray, there: np.ndarray) -> str:
    """Return a line of the table."""
    differ = here != there
    apart = np.abs(here[differ].astype(float) - there[differ])
    largest = np.maximum(here[differ], there[differ]).astype(float)
    most = f"at most {apart.max():.3g}, {(apart / largest).max():.2g} of the value" if len(apart) else ""
    return f"{name:24s} {differ.sum():8d} of {differ.size} pixels differ {most}"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("--cells", type=int, default=300, help="cells along a side of the ground")
    asked.add_argument("--engine", default="numba", help="engine of the reflectance")
    asked.add_argument("--out", type=Path, help=argparse.SUPPRESS)
    asked.add_argument("--isa", help=argparse.SUPPRESS)
    args = asked.parse_args()
    if args.out:
        if args.isa:
            embree_library._ONE_THREAD += f",max_isa={args.isa}".encode()
        render(args.out, args.cells, RenderOptions(samples=4, falloff=True, engine=args.engine))
        print(f"Embree in packets of {embree_library.packet_size()}")
        return
    again = [
        sys.executable,
        "-m",
        "benchmarks.processors",
        "--cells",
        str(args.cells),
        "--engine",
        args.engine,
        "--out",
    ]
    with tempfile.TemporaryDirectory() as folder:
        here, there = Path(folder) / "here.npz", Path(folder) / "there.npz"
        subprocess.run([*again, str(here)], check=True)
        subprocess.run([*again, str(there), "--isa", "avx2"], check=True, env=os.environ | WITHOUT_AVX512)
        first, second = np.load(here), np.load(there)
        for name in first.files:
            print(difference(name, first[name], second[name]))


if __name__ == "__main__":
    main()
