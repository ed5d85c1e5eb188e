"""Run and measure an autonomous drive; summarise all drives and compute the effect of each axis."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.intervals import RESAMPLES, bootstrap_draws, percentile_interval, resampled_means
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.planning.cases import AXES, matched_drives, parse_case
from polarsim.rover.planning.challenge import POINTS
from polarsim.rover.planning.drive import job_for, run_autonomous_drive, write_outcome
from polarsim.rover.planning.metrics import drive_metrics, event_table
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.rank import ranks_of_levels
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions
from polarsim.schemas.rover import ALL, ANY, AUTONOMY, AUTONOMY_EFFECTS, AUTONOMY_METRICS, END_ERROR, KNOWN

EVENTS = "events.parquet"
OVER_BLIND = {"path": "path over the blind one's", "energy": "energy over the blind one's"}
MAPS = {"geometric map", "rock map"}
BOTH_MAPS, POINTS_IN_ALL = "both maps", "points"
# Metrics of which effects are computed, with the sign of an improvement.
AFFECTED = {
    "collisions": -1,
    "success": 1,
    "stops": -1,
    BOTH_MAPS: 1,
    "rock map": 1,
    POINTS_IN_ALL: 1,
    END_ERROR: -1,
    OVER_BLIND["energy"]: -1,
}


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
    parts: Path | None = None,
    threads: int = 1,
) -> None:
    """Run a drive, measure it and write its folder: the drive's files, events, and then `figures.parquet`.

    `parts` is a file of `drive.job.cut_rocks`.
    """
    chosen = parse_case(case)
    job = job_for(
        meshes=meshes, world=world, soil=soil, drive=drive_options, options=options, seed=chosen.seed, parts=parts
    )
    vehicle = read_vehicle(drive_options.vehicle)
    light = chosen.light(vehicle)
    outcome = run_autonomous_drive(
        job, chosen.mode, light, options, cameras,
        render=render, pose=chosen.pose, detector=detector, threads=threads,
    )  # fmt: skip
    write_outcome(folder, outcome, options)
    tables.write_parquet(folder / EVENTS, event_table(outcome))
    rows = drive_metrics(outcome, vehicle, options)
    named = rows.assign(**chosen.axes, seed=chosen.seed, ended=str(outcome.trace.drive["ended"]))
    tables.write_parquet(folder / "figures.parquet", named[list(AUTONOMY_METRICS.columns)])


def summarise_autonomy(*, drives: Sequence[Path], each: Path, together: Path, effects: Path) -> None:
    """Write the metrics of all drives, their means over seeds with intervals, and the effect of each axis."""
    every = pd.concat([tables.read_parquet(path, AUTONOMY_METRICS.columns) for path in drives], ignore_index=True)
    every = with_derived(every)
    tables.write_parquet(each, every)
    tables.write_parquet(together, drive_summary(every))
    tables.write_parquet(effects, effects_of(every))


def with_derived(every: pd.DataFrame) -> pd.DataFrame:
    """Return the metrics with additional rows: points of both maps and in all, path and energy over the blind drive."""
    drive = [*AXES, "seed", "ended"]
    maps = every[every["metric"].isin(MAPS)].groupby(drive, as_index=False)["value"].sum()
    scored = every[every["metric"].isin(POINTS)].groupby(drive)["value"]
    points = scored.sum(min_count=len(POINTS)).dropna().reset_index()  # without rocks there is no total
    parts = [every, maps.assign(metric=BOTH_MAPS, unit="points of 600")]
    parts.append(points.assign(metric=POINTS_IN_ALL, unit="points of 1000"))
    for metric, name in OVER_BLIND.items():
        rows = every[every["metric"] == metric]
        blind = rows[(rows["mode"] == "blind") & (rows["pose"] == KNOWN)].set_index("seed")["value"]
        others = rows[(rows["mode"] != "blind") & rows["seed"].isin(blind.index)]
        ratio = others["value"] / others["seed"].map(blind)
        parts.append(others.assign(metric=name, unit="", value=ratio))
    return pd.concat([part for part in parts if len(part)], ignore_index=True)[list(AUTONOMY_METRICS.columns)]


def drive_summary(every: pd.DataFrame) -> pd.DataFrame:
    """Return a row per kind of drive and metric, `AUTONOMY`.

    Additional rows pool all Suns and exposures (`all`), and all detectors of a mode with several detectors.
    Intervals are the 2.5 and 97.5 percentiles of the mean over resampled seeds; they are undefined for one seed.
    """
    several = every.groupby("mode")["detector"].transform("nunique") > 1
    drives = pd.concat([every, every[several].assign(detector=ALL)])
    drives = pd.concat([drives, drives[drives["sun"] != ANY].assign(sun=ALL, exposure=ALL)])
    rows = []
    for key, part in drives.dropna(subset="value").groupby([*AXES, "metric", "unit"], sort=True):
        value, low, high = mean_over_seeds(part["value"].to_numpy(float), part["seed"].to_numpy())
        rows.append((*key, len(part), part["seed"].nunique(), value, low, high))
    return pd.DataFrame(rows, columns=list(AUTONOMY.columns)).astype(AUTONOMY.dtypes)


def mean_over_seeds(values: np.ndarray, seeds: np.ndarray) -> tuple[float, float, float]:
    """Return the mean of drives' values (n,) and its 95 % interval over seeds.

    Drives of a seed share ground and start, so the bootstrap resamples seeds.
    """
    unit = np.unique(seeds, return_inverse=True)[1]
    resampled = bootstrap_draws(unit.max() + 1, RESAMPLES, 0)
    return float(values.mean()), *percentile_interval(resampled_means(values, unit, resampled), unit.max() + 1)


def effects_of(every: pd.DataFrame) -> pd.DataFrame:
    """Return the mean of drives at each level of an axis, pooled over the other axes, `AUTONOMY_EFFECTS`.

    `change` is the difference from the mean of the other levels of the axis with the same seeds, so the influence of a
    seed's ground and start cancels. Only drives that exist at all levels are compared; for example, a detector that
    drove only with lights on is excluded from the effect of lights. Seeds with fewer drives than the others are
    excluded (unfinished tables). Mode `all` is the mean over modes. With several sources of poses, each source has rows
    of its own, and pose `all` pools them.
    """
    lit = every[every["sun"] != ANY]
    poses = sorted(set(lit["pose"]))
    rows = []
    for pose, mode in product([*poses, ALL] if len(poses) > 1 else poses, [*sorted(set(lit["mode"])), ALL]):
        drives = lit if mode == ALL else lit[lit["mode"] == mode]
        drives = drives if pose == ALL else drives[drives["pose"] == pose]
        for axis in AXES[1:]:
            levelled = drives[drives[axis] != ANY]
            comparable = matched_drives(levelled, axis)
            if len(set(comparable[axis])) > 1 and (mode != ALL or len(set(comparable["mode"])) > 1):
                rows += [(mode, pose, axis, *row) for row in _effects_on(comparable, axis)]
    return pd.DataFrame(rows, columns=list(AUTONOMY_EFFECTS.columns)).astype(AUTONOMY_EFFECTS.dtypes)


def _effects_on(drives: pd.DataFrame, axis: str) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for metric, sign in AFFECTED.items():
        compared = matched_drives(drives[drives["metric"] == metric].dropna(subset="value"), axis)
        if not len(compared):
            continue
        count = compared.groupby("seed").size()
        compared = compared[compared["seed"].isin(count.index[count == count.max()])]
        cells = compared.pivot_table("value", "seed", ["mode", axis]).dropna()  # means over the other axes
        by_level = cells.T.groupby(level=axis).mean().T  # means over modes
        ranks = ranks_of_levels(sign * by_level.to_numpy())
        for level, rank in zip(by_level.columns, ranks, strict=True):
            values, others = by_level[level], by_level.drop(columns=level).mean(axis=1)
            means = [mean_over_seeds(part.to_numpy(), part.index.to_numpy()) for part in (values, values - others)]
            rows.append((level, metric, compared["unit"].iloc[0], len(by_level), *means[0], *means[1], *rank))
    return rows
