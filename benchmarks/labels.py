"""Time and memory of labelling all 13 terrains: boxes of every photo, then polygons, grey maps and COCO.

`python benchmarks/labels.py RELEASE WORK [--config config/release.yaml] [--jobs 2]`

RELEASE is the release's folder (Labels, TerrainMeshes). Thirteen terrains are made of the five that
`benchmarks/transfers.py` puts in folders below WORK, each with the whole photo grid of its number. Every terrain is
a process of its own, as in the pipeline; so many run at once.

Last figures (two processes on two cores of an AMD EPYC, nothing else running, 5,280 photos): boxes 35 s, 65 CPU s with
Python's starts, 755 MB a process; outlines 71 s, 132 CPU s, 1,011 MB. On another machine, before rays were cast more
cheaply: 56 and 188 s.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import cycle, islice
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from transfers import Run

from polarsim.config import read_config
from polarsim.labels.masks import draw_masks
from polarsim.labels.options import LabelsOptions
from polarsim.photo import PhotoKey, photo_grid

TERRAINS, ALL = (1, 3, 4, 8, 11), 13


@dataclass(frozen=True)
class Job:
    """One of the thirteen: a terrain's files, and where its labels go."""

    run: Run
    out: Path

    @property
    def keys(self) -> list[PhotoKey]:
        return list(photo_grid(self.run.terrain))

    @property
    def options(self) -> LabelsOptions:
        return LabelsOptions(**self.run.config.labels.stage_options())


def boxes(job: Job) -> int:
    job.run.labels(job.keys, job.options, job.out)
    return peak_mb()


def outlines(job: Job) -> int:
    draw_masks(
        terrain=job.run.terrain,
        keys=job.keys,
        photos=job.run.folder / "photos.parquet",
        table=job.out / "labels.parquet",
        cameras=job.run.folder / "cameras",
        meshes=job.run.folder / "meshes",
        polygons=job.out / "polygons",
        masks=job.out / "masks",
        annotations=job.out / "coco.json",
        options=job.options,
    )
    return peak_mb()


def peak_mb() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def cpu_seconds() -> float:
    """Of all processes that have ended, Python's start and imports included."""
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return ended.ru_utime + ended.ru_stime


def timed(name: str, work: Callable[[Job], int], jobs: Sequence[Job], at_once: int) -> None:
    photos = sum(len(job.keys) for job in jobs)
    start, before = time.perf_counter(), cpu_seconds()
    with ProcessPoolExecutor(at_once, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        most = max(pool.map(work, jobs))
    wall, cpu = time.perf_counter() - start, cpu_seconds() - before
    print(f"{name:9s} {len(jobs)} terrains, {photos} photos: {wall:.0f} s, {cpu:.0f} CPU s, {most} MB a process")


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("release", type=Path)
    asked.add_argument("work", type=Path)
    asked.add_argument("--config", type=Path, default=Path("config/release.yaml"), help="whose options are used")
    asked.add_argument("--jobs", type=int, default=2, help="processes at once")
    args = asked.parse_args()
    config = read_config(args.config)
    seeded = config.labels.seeds.azimuths
    runs = [Run(args.release, args.work, terrain, config, seeded) for terrain in TERRAINS]
    for run in runs:
        run.localise()
    with tempfile.TemporaryDirectory() as out:
        jobs = [Job(run, Path(out) / f"{number:02d}") for number, run in enumerate(islice(cycle(runs), ALL))]
        for name, work in (("boxes", boxes), ("outlines", outlines)):
            timed(name, work, jobs, args.jobs)


if __name__ == "__main__":
    main()
