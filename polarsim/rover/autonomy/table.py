"""All drives in which the rover decides: one drive's figures as a file, and all together with 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.formats.schemas import AUTONOMY, EVERY_AUTONOMY
from polarsim.randomness import generator
from polarsim.rover.autonomy.cases import UNLIT, parsed
from polarsim.rover.autonomy.drive import drive, job_for, write
from polarsim.rover.autonomy.measure import figures
from polarsim.rover.autonomy.options import AutonomyOptions
from polarsim.rover.cameras.options import OnboardOptions
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import read_vehicle
from polarsim.rover.world.options import WorldOptions

OVER_BLIND = {"path": "path over the blind one's", "energy": "energy over the blind one's"}
_RESAMPLES = 1000
_GROUP = ["mode", "sun", "exposure"]


def drive_case(
    *,
    case: str,
    meshes: Path,
    folder: Path,
    world: WorldOptions,
    soil: SoilOptions,
    drive_options: DriveOptions,
    options: AutonomyOptions,
    onboard: OnboardOptions,
) -> None:
    """Drive a case, measure it and write its folder: the drive's files, and then `figures.parquet`.

    Raises
    ------
    PolarsimError
        Meshes or a detector are missing or broken, the path leaves the grid.
    """
    mode, light, seed = parsed(case)
    job = job_for(meshes=meshes, world=world, soil=soil, drive=drive_options, options=options, seed=seed)
    outcome = drive(job, mode, light, options, onboard)
    write(folder, outcome, options)
    rows = figures(outcome, read_vehicle(drive_options.vehicle), options)
    _, sun, exposure, _ = case.split("_")
    named = rows.assign(mode=mode, sun=sun, exposure=exposure, seed=seed, ended=str(outcome.trace.drive["ended"]))
    tables.write_parquet(folder / "figures.parquet", named[list(EVERY_AUTONOMY.columns)])


def summarise_autonomy(*, drives: Sequence[Path], each: Path, together: Path) -> None:
    """Write the figures of every drive, and the means over seeds of every mode and light with intervals.

    Raises
    ------
    FormatError
        A drive's figures are missing.
    """
    every = pd.concat([tables.read_parquet(path, EVERY_AUTONOMY.columns) for path in drives], ignore_index=True)
    every = with_ratios(every)
    tables.write_parquet(each, every)
    tables.write_parquet(together, summary(every))


def with_ratios(every: pd.DataFrame) -> pd.DataFrame:
    """With rows of path and energy over those of the same seed's blind drive, where there is one."""
    parts = [every]
    for metric, name in OVER_BLIND.items():
        own = every[every["metric"] == metric]
        blind = own[own["mode"] == "blind"].set_index("seed")["value"]
        others = own[(own["mode"] != "blind") & own["seed"].isin(blind.index)]
        ratio = others["value"] / others["seed"].map(blind)
        parts.append(others.assign(metric=name, unit="", value=ratio))
    return pd.concat(parts, ignore_index=True)


def summary(every: pd.DataFrame) -> pd.DataFrame:
    """A row a mode, light and metric, and of a mode over all its lights (Sun and exposure `all`); `AUTONOMY`.

    Intervals: 2.5 and 97.5 percentiles of the mean over drives drawn with replacement; one drive has none.
    """
    lit = every[~every["mode"].isin(UNLIT)].assign(sun="all", exposure="all")
    rows = []
    keys = [*_GROUP, "metric", "unit"]
    for key, own in pd.concat([every, lit]).groupby(keys, sort=True):
        values = own["value"].dropna().to_numpy(float)
        low, high = _interval(values, *key)
        rows.append((*key, len(values), float(values.mean()) if len(values) else np.nan, low, high))
    return pd.DataFrame(rows, columns=list(AUTONOMY.columns)).astype(AUTONOMY.dtypes)


def _interval(values: np.ndarray, *purpose: object) -> tuple[float, float]:
    if len(values) < 2:
        return np.nan, np.nan
    drawn = generator(0, "rover", "autonomy", *purpose).integers(len(values), size=(_RESAMPLES, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)
