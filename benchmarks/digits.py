"""How many digits of poses, rocks, labels and IPD hold where rounding differs: `python benchmarks/digits.py RUN WORK`.

RUN is the results' folder of an analog run with labels (`results/demo`), WORK a folder for what is made. Poses by
scans, rocks, labels on the run's meshes, detections and the IPD of one terrain are made again, each time by a process
of its own: as they are (the reference), with two threads, with the linear algebra, NumPy and Embree of a processor
without AVX-512, and `--repeats` times with every input moved up or down by one unit in the last place: points
of scans, the seeds' boxes, vertices of meshes, the cameras' focal lengths. The IPD is that of the packaged detector
between photos of the left camera in 8 bits and the same photos by a gamma curve, over the labels made here, in float32.

A digit holds where a value's distance from the reference, over the reference, is below its power of ten; positions of
cameras count by their distance over that of the camera from the origin, rotations by their angle in radians, boxes over
the photo's width. "All": every value is equal to the last bit.

Last figures: docs/notes/faults.md, "Significant digits".
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.cameras import locate
from polarsim.cameras.options import LocalisationOptions
from polarsim.detect import detect_pictures as detect
from polarsim.detect.ipd import instance_performance, instance_performance_difference, pair
from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.formats import png, tables
from polarsim.geometry import embree_library
from polarsim.geometry.poses import angle_between
from polarsim.labels import propagate
from polarsim.labels.options import LabelsOptions
from polarsim.labels.seeds import Annotated
from polarsim.photo import WIDTH, PhotoKey
from polarsim.rocks import find
from polarsim.rocks.options import RocksOptions
from polarsim.run_files import rigs

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
TWO_THREADS = {"OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
WITHOUT_AVX512 = {
    **ONE_THREAD,
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "OPENBLAS_CORETYPE": "Haswell",
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "+avx2,+fma,+bmi,+bmi2,+f16c,+popcnt,+sse4.2",
    "ATEN_CPU_CAPABILITY": "avx2",
    "ONEDNN_MAX_CPU_ISA": "AVX2",
}
PHOTOS = 6  # in which the detector looks
MOST = 16.0  # digits of a double


@dataclass(frozen=True)
class Run:
    """A terrain of a run, and where its work is done again."""

    results: Path
    terrain: int

    def at(self, name: str) -> Path:
        return self.results / name.format(f"Terrain{self.terrain:02d}")


def nudged(values: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Every float moved to its neighbour above or below."""
    values = np.asarray(values, float)
    return np.nextafter(values, np.where(rng.random(values.shape) < 0.5, -np.inf, np.inf))


def perturb_inputs(seed: int) -> None:
    """From now on the stages read inputs that are off by one unit in the last place."""
    rng = np.random.default_rng(seed)
    read_scan, read_rig = locate.read_scan, locate.read_rig
    read_terrain, read_drawings = propagate.read_terrain, propagate.read_drawings

    def rig(path: Path) -> object:
        found = read_rig(path)
        fx, fy = nudged([found.left.fx, found.left.fy], rng).tolist()
        return replace(found, left=replace(found.left, fx=fx, fy=fy))

    def drawings(seeds: Path, terrain: int) -> dict[PhotoKey, Annotated]:
        return {
            key: Annotated(nudged(own.rocks, rng), None if own.shadows is None else nudged(own.shadows, rng))
            for key, own in read_drawings(seeds, terrain).items()
        }

    def terrain(*arguments: object) -> object:
        mesh = read_terrain(*arguments)
        return replace(mesh, vertices=nudged(mesh.vertices, rng))

    def scan(*arguments: object) -> np.ndarray:
        return nudged(read_scan(*arguments), rng)

    for module, name, reader in (
        (locate, "read_scan", scan),
        (find, "read_scan", scan),
        (locate, "read_rig", rig),
        (propagate, "read_drawings", drawings),
        (propagate, "read_terrain", terrain),
    ):
        setattr(module, name, reader)


def work(run: Run, out: Path, threads: int) -> None:
    """Poses, rocks, labels, detections and the IPD, below `out`."""
    out.mkdir(parents=True)
    photos = run.at("acquire/{}/photos.parquet")
    index = pd.read_parquet(photos)
    keys = [PhotoKey.parse(key) for key in sorted(index["key"])]
    common = {
        "terrain": run.terrain,
        "inventory": run.at("acquire/{}/inventory.json"),
        "seeds": run.at("acquire/{}/seeds"),
    }
    locate.locate_cameras(
        **common,
        positions=sorted({key.position for key in keys}),
        calibration=run.at("acquire/{}/calibration.json"),
        cameras=out / "cameras",
        options=LocalisationOptions(),
        threads=threads,
    )
    names = ("rocks.parquet", "cuboids.yaml", "ids.yaml", "clouds")
    files = dict(zip(("rocks", "cuboids", "ids", "clouds"), (out / name for name in names), strict=True))
    find.find_rocks(**common, **files, cameras=out / "cameras", overrides=None, options=RocksOptions(rock_cell_mm=6))
    propagate.propagate_labels(
        **common,
        keys=keys,
        photos=photos,
        cameras=run.at("cameras/{}"),
        meshes=run.at("meshes/{}"),
        boxes=out / "boxes",
        table=out / "labels.parquet",
        options=LabelsOptions(),
    )
    lit = index[[key.azimuth != "no" and key.camera == "L" for key in map(PhotoKey.parse, index["key"])]]
    labels = tables.read_parquet(out / "labels.parquet", tables.LABEL_COLUMNS)
    labels = labels[labels["key"].isin(set(lit.head(PHOTOS)["key"]))]
    performances = [
        instance_performance(labels, detections(lit.head(PHOTOS), out / "detections", threads, gamma), 0.25)
        for gamma in (1.0, 2.2)
    ]
    pair(*performances).to_parquet(out / "ipd.parquet")
    found = instance_performance_difference(*performances)
    (out / "ipd.csv").write_text(f"ipd,ipd_abs\n{found.ipd!r},{found.ipd_abs!r}\n")


def detections(photos: pd.DataFrame, out: Path, threads: int, gamma: float) -> pd.DataFrame:
    """What the packaged detector finds in photos, through a tone curve."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    for key, path in zip(photos["key"], photos["path"], strict=True):
        pixels = png.read_photo(Path(path)) / 4095
        png.write(out / f"{key}.png", np.round(255 * np.clip(pixels, 0, 1) ** (1 / gamma)).astype(np.uint8))
    found = detect.find_in_pictures(
        pictures=[out],
        weights=[PACKAGED],
        out=out / "found",
        options=PredictionOptions(),
        threads=threads,
        draw=False,
    )
    return found.assign(key=found["picture"].str.removesuffix(".png"))


def digits(apart: np.ndarray) -> np.ndarray:
    """(n,) digits that hold, of relative distances (n,)."""
    with np.errstate(divide="ignore"):
        return np.minimum(-np.log10(np.abs(apart)), MOST)


def compared(reference: Path, other: Path) -> Iterator[tuple[str, np.ndarray, int]]:
    """What was compared, digits (n,) of its values, and how many things are in one of both alone."""
    ours, theirs = (rigs.read_all_localised(folder / "cameras") for folder in (reference, other))
    poses = [(ours[name].sandbox_from_left, theirs[name].sandbox_from_left) for name in sorted(set(ours) & set(theirs))]
    lost = len(set(ours) ^ set(theirs))
    moved = [np.linalg.norm(a.translation - b.translation) / np.linalg.norm(a.translation) for a, b in poses]
    yield "poses by scans, position", digits(np.array(moved)), lost
    yield "poses by scans, rotation", digits(np.array([angle_between(a, b) for a, b in poses])), lost
    for name, columns, on, scale in (
        ("rocks.parquet", ["x", "y", "z", "size_m", "height_m", "volume_m3"], ["rock"], None),
        ("labels.parquet", ["x0", "y0", "x1", "y1"], ["key", "kind", "rock", "number"], WIDTH),
    ):
        a, b = (pd.read_parquet(folder / name) for folder in (reference, other))
        if name == "labels.parquet":  # shadows whose rock nobody knows share a number
            a, b = (table.assign(number=table.groupby(["key", "kind", "rock"]).cumcount()) for table in (a, b))
        both = a.merge(b, on=on, how="outer", suffixes=("", "_other"), indicator="side")
        alone = int((both["side"] != "both").sum())
        both = both[both["side"] == "both"]
        first, second = both[columns].to_numpy(), both[[f"{column}_other" for column in columns]].to_numpy()
        yield name.removesuffix(".parquet"), digits(((second - first) / (scale or np.abs(first))).ravel()), alone
    a, b = (pd.read_parquet(folder / "ipd.parquet") for folder in (reference, other))
    both = a.merge(b, on=["key", "kind", "rock"], suffixes=("", "_other"))
    apart = both[["first_other", "second_other"]].to_numpy() - both[["first", "second"]].to_numpy()
    yield "performance of each rock", digits(apart.ravel()), len(a) + len(b) - 2 * len(both)
    a, b = (pd.read_csv(folder / "ipd.csv").to_numpy()[0] for folder in (reference, other))
    yield "IPD, absolute IPD", digits(b / a - 1), 0


def line(name: str, held: np.ndarray, alone: int) -> str:
    if not len(held):
        return f"| {name} | 0 | | | {alone} |"
    least, middle = (f"{value:.1f}" if value < MOST else "all" for value in (held.min(), np.median(held)))
    return f"| {name} | {len(held)} | {least} | {middle} | {alone} |"


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("run", type=Path)
    asked.add_argument("work", type=Path)
    asked.add_argument("--terrain", type=int, default=3)
    asked.add_argument("--only", help="this variant alone, beside the reference")
    asked.add_argument("--repeats", type=int, default=2, help="times that inputs are moved")
    asked.add_argument("--alone", nargs=2, help=argparse.SUPPRESS)
    args = asked.parse_args()
    run = Run(args.run, args.terrain)
    if args.alone:
        name, seed = args.alone
        if name == "without AVX-512":
            embree_library._ONE_THREAD += b",max_isa=avx2"
        if int(seed):
            perturb_inputs(int(seed))
        work(run, args.work / name, 2 if name == "two threads" else 1)
        return
    variants = [("reference", ONE_THREAD, 0), ("two threads", TWO_THREADS, 0), ("without AVX-512", WITHOUT_AVX512, 0)]
    variants += [(f"one ulp, draw {number}", ONE_THREAD, number) for number in range(1, args.repeats + 1)]
    for name, environment, seed in variants:
        if name not in ("reference", args.only or name):
            continue
        shutil.rmtree(args.work / name, ignore_errors=True)
        words = [args.run, args.work, "--terrain", args.terrain, "--alone", name, seed]
        command = [sys.executable, __file__, *map(str, words)]
        subprocess.run(command, env={**os.environ, **environment}, check=True)
        if name != "reference":
            print(f"\n{name}\n\n| what | values | digits, least | median | in one alone |\n|---|---|---|---|---|")
            print(*(line(*row) for row in compared(args.work / "reference", args.work / name)), sep="\n", flush=True)


if __name__ == "__main__":
    main()
