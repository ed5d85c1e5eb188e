"""Accuracy of materials fitted to the analog's photos: error of the albedo, and error on held-out photos.

`python benchmarks/materials.py RUN ANALOG [--terrains 3 11] [--held-out 30 180 270 350]`

RUN is the folder of a finished run (`results/demo`), ANALOG its raw data (`data/analog`); both are only read. Materials
are fitted again for every held-out azimuth. The true albedo is read from the analog's files, or computed from the
analog's terrain.

Last metrics (demo, estimated cameras and meshes of 10 mm ground, azimuth 30 held out; Hapke / Principled). Median error
of the albedo on the ground: terrain 1 4.5 / 4.9 %, 3 3.4 / 3.2 %, 11 3.0 / 4.2 %, with a constant albedo 8 to 9 %; on
rocks 7 to 24 %, because their scattering law differs from that of sand, with which they share parameters. Pixels of the
held-out azimuth, median stops without a fit, with a constant albedo, with all parameters: terrain 3 0.49, 0.31, 0.25 /
0.41, 0.35, 0.32; terrain 11 0.43, 0.21, 0.15 / 0.34, 0.29, 0.23. Most of the remaining error is due to slopes of sand
and grains, which an albedo cannot represent, and which matter most in low light. Lamp 180 is 6 times as bright as 30,
350 3.2 times; estimates 6.8 and 7.1 / 5.0 and 5.3, and 3.6 and 3.1 / 3.6 and 3.3. 47 to 77 CPU s per terrain.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import pandas as pd

from polarsim.analog.options import AnalogOptions
from polarsim.analog.terrain import build_terrain
from polarsim.analog.truth import AlbedoMap
from polarsim.analog.view import make_textures, render_gbuffer
from polarsim.formats.tables import read_parquet
from polarsim.photo import CAMERAS
from polarsim.randomness import generator
from polarsim.render.fitting.fit import fit_materials
from polarsim.render.options import FittingOptions, RenderOptions
from polarsim.run_files.materials import read_materials
from polarsim.run_files.scene import read_terrain
from polarsim.scoring.alignment import read_alignment
from polarsim.scoring.materials import ALBEDO_COLUMNS, albedo_metrics

MODELS = ("principled", "hapke")


def true_albedo(terrain: int, truth: Path, positions: list[str], options: AnalogOptions) -> pd.DataFrame:
    """Return the true albedo at the points that the photos of some positions show."""
    if (truth / "albedo.parquet").exists():
        return read_parquet(truth / "albedo.parquet", ALBEDO_COLUMNS)
    made, found = build_terrain(terrain, options), AlbedoMap()
    textures = make_textures(generator(options.seed, "textures", terrain))
    for position in positions:
        for camera in CAMERAS:
            found.add(render_gbuffer(made.scene, made.caster, textures, made.stations.camera(position, camera), 1))
    return found.table()


def measure(terrain: int, run: Path, analog: Path, held_out: list[str], photos: Path) -> None:
    """Print the metrics of a terrain."""
    name = f"Terrain{terrain:02d}"
    cameras, meshes, truth = run / "cameras" / name, run / "meshes" / name, analog / "truth" / name
    mesh = read_terrain(meshes, terrain)
    positions = sorted({key.split("_")[1] for key in read_parquet(photos, ["key"])["key"]})
    true = true_albedo(terrain, truth, positions, AnalogOptions())
    points = read_alignment(cameras, truth).inverse().apply(true[["x", "y", "z"]].to_numpy(float))
    for azimuth in held_out:
        with tempfile.TemporaryDirectory() as folder:
            start = time.process_time()
            fit_materials(
                terrain=terrain, cameras=cameras, meshes=meshes, photos=photos, light=None, domains=MODELS,
                materials=Path(folder) / "fit",
                options=RenderOptions(fitting=FittingOptions(held_out=azimuth)), threads=1,
            )  # fmt: skip
            seconds = time.process_time() - start
            found = read_materials(Path(folder) / "fit", mesh)
        print(f"{name}, {azimuth} held out: {seconds:.0f} CPU s")
        for metric in albedo_metrics(found, mesh, true, points):
            print(f"  {metric.subject}: {metric.metric} {100 * metric.value:.1f} % ({metric.n} points)")
        for model, fit in sorted(found.models.items()):
            print(f"  {model}: lamps over 30's { ({k: round(v / fit.lamps['30'], 3) for k, v in fit.lamps.items()}) }")
            for scale in ("pixels", "texels"):
                errors = {step: values for step, values in fit.check[scale].items() if step != "count"}
                stops = ", ".join(
                    f"{step} {v['median_stops']:.3f} ({v['rms_stops']:.3f})" for step, v in errors.items()
                )
                print(f"  {model}, {scale}: median (RMS) stops: {stops}", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("analog", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[1, 3, 11])
    parser.add_argument("--held-out", nargs="+", default=["30"])
    given = parser.parse_args()
    for number in given.terrains:
        index = given.run / "acquire" / f"Terrain{number:02d}" / "photos.parquet"
        measure(number, given.run, given.analog, given.held_out, index)
