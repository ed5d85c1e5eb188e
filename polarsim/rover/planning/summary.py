"""All drives in which the rover decides: one drive's metrics as a file, all together, what each axis changes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.intervals import RESAMPLES, draws, interval, resampled_means
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.planning.cases import AXES, UNLIT, matched, parsed
from polarsim.rover.planning.drive import drive, job_for, write
from polarsim.rover.planning.metrics import drive_metrics, events
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.touches import touches
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.schemas.rover import ALL, ANY, AUTONOMY, AUTONOMY_EFFECTS, EVERY_AUTONOMY

EVENTS = "events.parquet"
OVER_BLIND = {"path": "path over the blind one's", "energy": "energy over the blind one's"}
MAPS = {"geometric map", "rock map"}
BOTH_MAPS = "both maps"
AFFECTED = ("collisions", "success", "stops", BOTH_MAPS, "rock map", OVER_BLIND["energy"])


def drive_case(
    *,
    case: str,
    meshes: Path,
    folder: Path,
    world: WorldOptions,
    soil: SoilOptions,
    drive_options: DriveOptions,
    options: AutonomyOptions,
    cameras: CameraSuiteOptions,
    render: RenderOptions,
    detector: OnboardDetector | None,
    threads: int = 1,
) -> None:
    """Drive a case, measure it and write its folder: the drive's files, its events, and then `figures.parquet`.

    Raises
    ------
    PolarsimError
        Meshes or a detector are missing or broken, the path leaves the grid.
    """
    own = parsed(case)
    job = job_for(meshes=meshes, world=world, soil=soil, drive=drive_options, options=options, seed=own.seed)
    vehicle = read_vehicle(drive_options.vehicle)
    light = own.light(vehicle)
    outcome = drive(job, own.mode, light, options, cameras, render=render, detector=detector, threads=threads)
    rocks = touches(outcome.trace, vehicle)
    write(folder, outcome, options)
    tables.write_parquet(folder / EVENTS, events(outcome, rocks))
    rows = drive_metrics(outcome, rocks, vehicle, options)
    named = rows.assign(**own.axes, seed=own.seed, ended=str(outcome.trace.drive["ended"]))
    tables.write_parquet(folder / "figures.parquet", named[list(EVERY_AUTONOMY.columns)])


def summarise_autonomy(*, drives: Sequence[Path], each: Path, together: Path, effects: Path) -> None:
    """Write the metrics of every drive, their means over seeds with intervals, and what each axis changes.

    Raises
    ------
    FormatError
        A drive's metrics are missing.
    """
    every = pd.concat([tables.read_parquet(path, EVERY_AUTONOMY.columns) for path in drives], ignore_index=True)
    every = with_derived(every)
    tables.write_parquet(each, every)
    tables.write_parquet(together, summary(every))
    tables.write_parquet(effects, effects_of(every))


def with_derived(every: pd.DataFrame) -> pd.DataFrame:
    """With rows of both maps' points together, and of path and energy over those of the same seed's blind drive."""
    parts = [every]
    maps = every[every["metric"].isin(MAPS)]
    parts.append(
        maps.groupby([*AXES, "seed", "ended"], as_index=False)["value"]
        .sum()
        .assign(metric=BOTH_MAPS, unit="points of 600")
    )
    for metric, name in OVER_BLIND.items():
        own = every[every["metric"] == metric]
        blind = own[own["mode"] == "blind"].set_index("seed")["value"]
        others = own[(own["mode"] != "blind") & own["seed"].isin(blind.index)]
        ratio = others["value"] / others["seed"].map(blind)
        parts.append(others.assign(metric=name, unit="", value=ratio))
    return pd.concat([part for part in parts if len(part)], ignore_index=True)[list(EVERY_AUTONOMY.columns)]


def summary(every: pd.DataFrame) -> pd.DataFrame:
    """A row a kind of drive and metric; `AUTONOMY`.

    Then over all Suns and exposures (`all`), and both once more over all detectors of a mode that has several.
    Intervals: 2.5 and 97.5 percentiles of the mean with seeds drawn with replacement; of one seed there is none.
    """
    several = every.groupby("mode")["detector"].transform("nunique") > 1
    own = pd.concat([every, every[several].assign(detector=ALL)])
    own = pd.concat([own, own[~own["mode"].isin(UNLIT)].assign(sun=ALL, exposure=ALL)])
    rows = []
    for key, part in own.dropna(subset="value").groupby([*AXES, "metric", "unit"], sort=True):
        value, low, high = mean_over_seeds(part["value"].to_numpy(float), part["seed"].to_numpy())
        rows.append((*key, len(part), part["seed"].nunique(), value, low, high))
    return pd.DataFrame(rows, columns=list(AUTONOMY.columns)).astype(AUTONOMY.dtypes)


def mean_over_seeds(values: np.ndarray, seeds: np.ndarray) -> tuple[float, float, float]:
    """Mean of drives' values (n,), and its 95 % interval over seeds: drives of one share ground and start."""
    unit = np.unique(seeds, return_inverse=True)[1]
    drawn = draws(unit.max() + 1, RESAMPLES, 0)
    return float(values.mean()), *interval(resampled_means(values, unit, drawn), unit.max() + 1)


def effects_of(every: pd.DataFrame) -> pd.DataFrame:
    """What drives are like at each level of an axis, over all levels of the others; `AUTONOMY_EFFECTS`.

    `change` is against the mean of the axis's other levels, by the same seeds, so what a seed's ground and start do
    cancels. Like is compared with like: only drives count that were made at every level (a detector that drove with
    lights on where others did not says nothing of lights by those, nor of itself against them). Seeds with fewer of
    these than others (a table not yet finished) are left out. Mode `all`: mean of modes.
    """
    seen = every[~every["mode"].isin(UNLIT)]
    rows = []
    for mode in [*sorted(set(seen["mode"])), ALL]:
        own = seen if mode == ALL else seen[seen["mode"] == mode]
        for axis in AXES[1:]:
            levelled = own[own[axis] != ANY]
            alike = matched(levelled, axis)
            if len(set(alike[axis])) > 1 and (mode != ALL or len(set(alike["mode"])) > 1):
                rows += [(mode, axis, *row) for row in _effects_on(alike, axis)]
    return pd.DataFrame(rows, columns=list(AUTONOMY_EFFECTS.columns)).astype(AUTONOMY_EFFECTS.dtypes)


def _effects_on(drives: pd.DataFrame, axis: str) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for metric in AFFECTED:
        own = matched(drives[drives["metric"] == metric].dropna(subset="value"), axis)
        if not len(own):
            continue
        count = own.groupby("seed").size()
        own = own[own["seed"].isin(count.index[count == count.max()])]
        cells = own.pivot_table("value", "seed", ["mode", axis]).dropna()  # means over the other axes
        by_level = cells.T.groupby(level=axis).mean().T  # of modes
        for level in by_level.columns:
            here, others = by_level[level], by_level.drop(columns=level).mean(axis=1)
            means = [mean_over_seeds(some.to_numpy(), some.index.to_numpy()) for some in (here, here - others)]
            rows.append((level, metric, own["unit"].iloc[0], len(by_level), *means[0], *means[1]))
    return rows
