"""Autonomous drives of the rover by the workflow's functions: collisions and cost.

`python benchmarks/rover_autonomy.py MESHES OUT --terrains 4 1 11 3 8 12 [--modes truth] [--seeds 40] [--minutes 60]`
`  [--poses truth odometry fused]`

The large table, of modes, Suns, exposures, lights and detectors; detectors of a run are named `<domain>-seed<N>`:

`python benchmarks/rover_autonomy.py MESHES OUT --terrains 4 1 11 --modes truth detector stereo both blind --seeds 5`
`  --suns 1 2 3 4 --exposures 64 256 auto --lights off on --detect results/demo/detect`
`  --weights packaged_rover hapke-seed0=results/demo/detect/position/seed0/detectors/hapke.pt ...`

Each drive gets a folder, as by the rule `drive_alone`, and a printed row; `--jobs` drives run at a time (with
OMP_NUM_THREADS=1). Existing drives are kept, so that a call resumes after its time limit. All drives of a seed precede
those of the next seed, so that partial results are comparable. Finally, tables and figures of all existing drives are
written to `OUT/tables` and `OUT/figures`, as by the rules of `rover_autonomy`; `OUT/tables/rover_medians.md` contains
medians by Sun and lights. `--detect` is the run that trained the detectors, which provides the gap for their ranking.
"""

from __future__ import annotations

import argparse
import hashlib
import math
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.intervals import RESAMPLES, bootstrap_draws, percentile_interval, resampled_means, resampled_medians
from polarsim.render.options import RenderOptions
from polarsim.report.autonomy_table import tabulate_autonomy, tabulate_rank
from polarsim.report.figures.autonomy import draw_modes
from polarsim.report.figures.autonomy_maps import draw_autonomy_maps
from polarsim.report.figures.autonomy_paths import draw_paths
from polarsim.report.layout import MISSING, value_and_interval, write_table
from polarsim.reporting import reporting
from polarsim.rover.cameras.options import PACKAGED_FILES, CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.perception.options import MODES_WITH_DETECTOR, OnboardDetector
from polarsim.rover.planning.cases import Case, cases
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.rank import rank_detectors
from polarsim.rover.planning.summary import POINTS_IN_ALL, drive_case, summarise_autonomy
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions
from polarsim.schemas.rover import ALL, AUTONOMY, AUTONOMY_METRICS, END_ERROR

CONFIG = Path(__file__).parents[1] / "config"
Statistic = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]  # of values, their units, and draws
# Statistics and digits of the table of medians. Collisions have a mean, since most drives hit no rock or one.
SUMMARISED: dict[str, tuple[Statistic, int]] = {
    POINTS_IN_ALL: (resampled_medians, 0),
    "geometric map": (resampled_medians, 0),
    "rock map": (resampled_medians, 0),
    "collisions": (resampled_means, 2),
    END_ERROR: (resampled_medians, 3),
}
CASES = {"run", "modes", "poses", "auto_exposure", "headlights", "detectors"}  # options that select drives


def drives(asked: argparse.Namespace, options: AutonomyOptions, cameras: CameraSuiteOptions) -> Iterator[Case]:
    """Yield all drives that exist or fit into the time limit, several at a time."""
    every = cases(options, cameras, range(asked.seeds), list(asked.weights))
    end = time.monotonic() + 60 * asked.minutes  # this clock is common to all processes
    with ProcessPoolExecutor(asked.jobs) as pool:
        there = pool.map(_run_drive, every, repeat(asked), repeat(options), repeat(cameras), repeat(end))
        yield from (case for case, is_there in zip(every, there, strict=True) if is_there)


def _run_drive(
    case: Case, asked: argparse.Namespace, options: AutonomyOptions, cameras: CameraSuiteOptions, end: float
) -> bool:
    """Run a drive if it does not exist and time is left; return whether it exists."""
    folder = asked.out / "drives" / case.name
    if not (folder / "figures.parquet").exists():
        if time.monotonic() > end:
            return False
        drive_case(
            case=case.name,
            meshes=asked.meshes,
            folder=folder,
            world=WorldOptions(terrains=tuple(asked.terrains)),
            soil=SoilOptions(table=CONFIG / "soils.csv"),
            drive_options=DriveOptions(vehicle=CONFIG / "viper.yaml"),
            options=options,
            cameras=cameras,
            render=RenderOptions(),
            detector=asked.weights.get(case.detector),
            threads=asked.threads,
        )
    print(row_of(case, tables.read_parquet(folder / "figures.parquet", AUTONOMY_METRICS.columns)), flush=True)
    return True


def options_digest(terrains: list[int], options: AutonomyOptions) -> str:
    """Return a digest of terrains and options, to distinguish drives; cases do not affect it."""
    return hashlib.sha256(f"{terrains} {options.model_dump_json(exclude=CASES)}".encode()).hexdigest()[:12]


def row_of(case: Case, own: pd.DataFrame) -> str:
    value = own.set_index("metric")["value"]
    closest = value.get("closest pass of a rock above 10 cm", math.nan)  # missing if no rock was near
    passed = "no rock above 10 cm near" if math.isnan(closest) else f"closest {closest:.3f} m"
    return (
        f"{case.name}: {own['ended'].iloc[0]} after {value['time']:.1f} s, {value['collisions']:.0f} collisions, "
        f"{passed}, {value['CPU for a second driven'] * value['time']:.0f} s of CPU, "
        f"{value['CPU for a second driven']:.2f} a second"
    )


def medians(every: pd.DataFrame) -> pd.DataFrame:
    """Return medians over drives, and mean collisions, by mode, pose, Sun and lights, with bootstrap intervals."""
    pooled = pd.concat([every, every.assign(lights=ALL)])
    pooled = pd.concat([pooled, pooled.assign(sun=ALL)])
    rows = []
    for key, drives in pooled.groupby(["mode", "pose", "sun", "lights"]):
        row: dict[str, object] = dict(zip(("mode", "pose", "sun", "lights"), key, strict=True))
        row["drives"] = int((drives["metric"] == "collisions").sum())
        for metric, (statistic, digits) in SUMMARISED.items():
            values = drives.loc[drives["metric"] == metric, "value"].dropna().to_numpy(float)
            unit = ", %" if metric == END_ERROR else ""
            row[metric + unit] = _with_interval(values, statistic, digits) if len(values) else MISSING
        rows.append(row)
    return pd.DataFrame(rows)


def _with_interval(values: np.ndarray, statistic: Statistic, digits: int) -> str:
    """Return a statistic of drives' values (n,), and its 95 % interval over drives."""
    unit, count = np.arange(len(values)), len(values)
    estimate = statistic(values, unit, np.ones((1, count)))[0]
    bounds = percentile_interval(statistic(values, unit, bootstrap_draws(count, RESAMPLES, 0)), count)
    return value_and_interval(estimate, *bounds, f".{digits}f")


def write_tables(asked: argparse.Namespace, found: list[Case], origin: dict[str, str]) -> None:
    """Write tables and figures of these drives."""
    folders = [asked.out / "drives" / case.name for case in found]
    rover, shown, drawn = (asked.out / name for name in ("rover", "tables", "figures"))
    each, together, effects = (
        rover / f"{name}.parquet" for name in ("autonomy_metrics", "autonomy", "autonomy_effects")
    )
    files = [folder / "figures.parquet" for folder in folders]
    summarise_autonomy(drives=files, each=each, together=together, effects=effects)
    stems = {"stem": shown / "rover_autonomy", "effects_stem": shown / "rover_autonomy_effects"}
    tabulate_autonomy(together=together, effects=effects, **stems, origin=origin)
    draw_modes(tables.read_parquet(together, AUTONOMY.columns), drawn / "rover_autonomy.png", origin)
    if whole := [folder for folder in folders if (folder / "trace.parquet").exists()]:
        draw_paths(folders=whole, figure=drawn / "rover_ways.png", origin=origin)
        draw_autonomy_maps(folders=whole, figure=drawn / "rover_maps.png", origin=origin)
    caption = "Medians over drives, and mean number of rocks above 10 cm hit."
    notes = ["Intervals: 95 %, bootstrapped over drives. Drives of a seed share ground and start."]
    every = tables.read_parquet(each, AUTONOMY_METRICS.columns)
    write_table(shown / "rover_medians", medians(every), caption, notes=notes, origin=origin)
    for name in ("rover_autonomy", "rover_autonomy_effects", "rover_medians"):
        print((shown / f"{name}.md").read_text())
    if any(case.mode in MODES_WITH_DETECTOR for case in found):
        ranked = {"by_detector": rover / "autonomy_detectors.parquet", "ranks": rover / "autonomy_rank.parquet"}
        gap = {name: asked.detect / f"{name}.parquet" for name in ("detection", "ipd")} if asked.detect else {}
        rank_detectors(each=each, **ranked, **gap, pair=tuple(asked.pair))
        tabulate_rank(**ranked, stem=shown / "rover_rank", origin=origin)
        print((shown / "rover_rank.md").read_text())


def detector_argument(text: str) -> tuple[str, OnboardDetector]:
    """Return name and options of a detector: a packaged detector, or `name=path`."""
    name, _, path = text.partition("=")
    if path and not Path(path).is_file():
        raise argparse.ArgumentTypeError(f"{path}: no such file")
    if not path and name not in PACKAGED_FILES:
        raise argparse.ArgumentTypeError(f"{text!r}, expected {', '.join(PACKAGED_FILES)} or name=path")
    return name, OnboardDetector(weights=Path(path) if path else PACKAGED_FILES[name])


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--terrains", type=int, nargs="+", default=[3, 1, 11])
    parser.add_argument("--modes", nargs="+", default=["truth"])
    parser.add_argument("--poses", nargs="+", default=["truth"])
    parser.add_argument("--suns", nargs="+", default=["3"])
    parser.add_argument("--exposures", nargs="+", default=["256"], help="ms, or auto")
    parser.add_argument("--lights", nargs="+", default=["off"], choices=("off", "on"))
    parser.add_argument("--models", nargs="+", help="reflectance models of the images; default: model of --pair")
    parser.add_argument("--weights", nargs="+", default=[detector_argument("packaged_rover")], type=detector_argument)
    parser.add_argument("--detect", type=Path, help="results/<run>/detect of the run that trained them")
    parser.add_argument("--pair", nargs=2, default=["analog", "hapke"], help="domains of photos and of images")
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--minutes", type=float, default=60, help="time after which no drive starts")
    parser.add_argument("--jobs", type=int, default=1, help="drives at a time")
    parser.add_argument("--threads", type=int, default=1, help="threads that render a drive's images")
    parser.add_argument("--source", default="release", help="source of the meshes, for tables")
    asked = parser.parse_args()
    asked.weights = dict(asked.weights)
    return asked


def main() -> None:
    asked = arguments()
    options = AutonomyOptions.model_validate(
        {
            "modes": asked.modes,
            "poses": asked.poses,
            "headlights": asked.lights,
            "auto_exposure": asked.exposures == ["auto"],
            "longest_s": max(160, 80 * len(asked.terrains)),  # about half a minute per terrain without stops
        }
    )
    cameras = CameraSuiteOptions.model_validate(
        {"suns": asked.suns, "models": asked.models or [asked.pair[1]], "scale": 0.5}
        | ({} if options.auto_exposure else {"exposures_ms": [float(text) for text in asked.exposures]})
    )
    told = options_digest(asked.terrains, options)
    found = list(drives(asked, options, cameras))
    if found:
        write_tables(asked, found, {"run": asked.out.name, "source": asked.source, "config": told})


if __name__ == "__main__":
    with reporting():
        main()
