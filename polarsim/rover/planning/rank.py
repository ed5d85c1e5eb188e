"""Rank correlations between the gap of detectors and their drives: does a smaller gap drive better?

Coefficients are computed for all bootstrap replicates at once. SciPy's functions, called for each replicate, agree to
1e-12 and take 5 s per table instead of milliseconds.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from polarsim.errors import RoverError
from polarsim.formats import tables
from polarsim.intervals import RESAMPLES, bootstrap_draws, percentile_interval
from polarsim.photo import ROCK
from polarsim.rover.perception.options import MODES_WITH_DETECTOR
from polarsim.rover.planning.cases import matched_drives
from polarsim.schemas.rover import AUTONOMY_DETECTORS, AUTONOMY_METRICS, AUTONOMY_RANK

ENOUGH = 5  # minimum number of detectors: with fewer, even Kendall's p is at least 0.08
SURE = 0.05
_ROCK_POINTS = 300
# Sign of an improvement: metrics of the gap and of drives.
GAPS = {"ipd": -1, "map50": 1, "rock_f1": 1}
DRIVES = {"collisions": -1, "success": 1, "rock_points": 1}
_METRICS = {"collisions": "collisions", "success": "success", "rock map": "rock_points"}


def rank_detectors(
    *,
    each: Path,
    by_detector: Path,
    ranks: Path,
    detection: Path | None = None,
    ipd: Path | None = None,
    pair: tuple[str, str] = ("analog", "hapke"),
    split: str | None = None,
) -> None:
    """Write metrics of all detectors that drove, and how their order by gap agrees with the order by drives.

    `each` is rover/autonomy_metrics.parquet; `detection` and `ipd` are tables of the run with the detectors
    `<domain>-seed<N>`. `pair`: domain of the photos and domain of the rover's pictures; the IPD is between both, the
    mAP in the second, and drives in other models are excluded. `split`: by default the first in the tables.
    """
    every = tables.read_parquet(each, AUTONOMY_METRICS.columns)
    drives = detector_drives(every, pair[1])
    if not len(drives):
        raise RoverError(f"{each}: no drives by a detector in the model {pair[1]}")
    gaps = gap_metrics(detection, ipd, pair, split)
    tables.write_parquet(by_detector, detector_metrics(drives, gaps))
    tables.write_parquet(ranks, rank_table(drives, gaps))


def detector_drives(every: pd.DataFrame, model: str) -> pd.DataFrame:
    """Return a row per drive by a detector in a model: mode, detector, light, seed and the metrics of `DRIVES`.

    Only lights and seeds that all detectors of a mode drove are compared, since easier light is no merit of a detector.
    """
    selected = every[
        every["mode"].isin(MODES_WITH_DETECTOR) & every["metric"].isin(_METRICS) & (every["model"] == model)
    ]
    keys = ["mode", "detector", "sun", "exposure", "lights", "pose", "seed"]
    wide = (
        selected.pivot_table("value", keys, "metric").rename(columns=_METRICS).reset_index().rename_axis(columns=None)
    )
    return wide.groupby("mode", group_keys=False)[list(wide)].apply(matched_drives, "detector")


def gap_metrics(detection: Path | None, ipd: Path | None, pair: tuple[str, str], split: str | None) -> pd.DataFrame:
    """Return `ipd` and `map50` of rocks by detector; NaN without a value in the table."""
    found = pd.DataFrame(columns=["ipd", "map50"], dtype=float)
    if detection is not None:
        table = _rocks(detection, ("map50", "evaluated"), split)
        found = found.combine_first(table[table["evaluated"] == pair[1]].set_index("detector")[["map50"]])
    if ipd is not None:
        table = _rocks(ipd, ("ipd", "first", "second"), split)
        same = [set(both) == set(pair) for both in zip(table["first"], table["second"], strict=True)]
        found = found.combine_first(table[same].set_index("detector")[["ipd"]])
    return found


def _rocks(path: Path, columns: tuple[str, ...], split: str | None) -> pd.DataFrame:
    table = tables.read_parquet(path, ("trained", "seed", "kind", "split", *columns))
    table = table[table["kind"] == ROCK]
    table = table[table["split"] == (split or table["split"].iloc[0])]
    return table.assign(detector=table["trained"] + "-seed" + table["seed"].astype(str))


def detector_metrics(drives: pd.DataFrame, gaps: pd.DataFrame) -> pd.DataFrame:
    """Return a row per mode and detector with the metrics of gap and drives; `AUTONOMY_DETECTORS`."""
    table = drives.groupby(["mode", "detector"]).agg(
        drives=("seed", "size"), seeds=("seed", "nunique"), **{name: (name, "mean") for name in DRIVES}
    )
    table = table.reset_index().join(gaps, on="detector")
    table = table.assign(rock_f1=table["rock_points"] / _ROCK_POINTS)
    return table[list(AUTONOMY_DETECTORS.columns)].astype(AUTONOMY_DETECTORS.dtypes)


def rank_table(drives: pd.DataFrame, gaps: pd.DataFrame) -> pd.DataFrame:
    """Return a row per mode, metric of the gap and metric of drives; `AUTONOMY_RANK`.

    Positive coefficients: detectors with a better gap drive better. Intervals are from a bootstrap over seeds (with a
    single seed: over Suns, exposures and lights), the same for all detectors. Kendall's p tests against random orders
    of the detectors, which the interval does not cover.
    """
    rows = []
    for mode, drives_of_mode in drives.groupby("mode"):
        for gap, metric in product(GAPS, DRIVES):
            part = drives_of_mode
            if gap != "rock_f1":
                part = part[part["detector"].isin(gaps.index[gaps[gap].notna()])]
            if len(part) and (gap, metric) != ("rock_f1", "rock_points"):  # the same metric twice
                rows.append((mode, gap, metric, *_rank(part, gaps, gap, metric)))
    return pd.DataFrame(rows, columns=list(AUTONOMY_RANK.columns)).astype(AUTONOMY_RANK.dtypes)


def _rank(drives: pd.DataFrame, gaps: pd.DataFrame, gap: str, metric: str) -> tuple[object, ...]:
    names = sorted(set(drives["detector"]))
    unit = "seed" if len(set(drives["seed"])) > 1 else "light"
    units = drives["seed"] if unit == "seed" else drives[["sun", "exposure", "lights"]].agg("_".join, axis=1)
    count = units.nunique()
    # Point estimate, then bootstrap replicates.
    drawn = np.concatenate([np.ones((1, count)), bootstrap_draws(count, RESAMPLES, 0)])
    after = DRIVES[metric] * _means(drives, units, metric, drawn)
    if gap == "rock_f1":
        before = _means(drives, units, "rock_points", drawn)
    else:
        before = np.tile(GAPS[gap] * gaps.loc[names, gap].to_numpy(float), (len(drawn), 1))
    complete = ~np.isnan(before + after).any(axis=1)  # excludes replicates without a drive of a detector
    estimates = [np.where(complete, rank(before, after), np.nan) for rank in (spearman, kendall)]
    intervals = [percentile_interval(values[1:], count) for values in estimates]
    p = float(stats.kendalltau(before[0], after[0]).pvalue) if len(names) > 1 else np.nan
    says = verdict(len(names), float(estimates[1][0]), intervals[1], p)
    spearmans, kendalls = ((float(values[0]), *interval) for values, interval in zip(estimates, intervals, strict=True))
    return len(names), len(drives), count, unit, *spearmans, *kendalls, p, says


def _means(drives: pd.DataFrame, units: pd.Series, metric: str, drawn: np.ndarray) -> np.ndarray:
    """Return (replicates, detectors) means of drives; NaN for a detector without drives."""
    by_unit = drives.assign(unit=units).pivot_table(metric, "detector", "unit", aggfunc=["sum", "count"])
    total, count = (by_unit[name].fillna(0).to_numpy(float) for name in ("sum", "count"))
    with np.errstate(invalid="ignore"):
        return np.asarray((drawn @ total.T) / (drawn @ count.T))


def spearman(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return Spearman's coefficient of corresponding rows (n, detectors); NaN if all values of a row are equal."""
    ranks = [stats.rankdata(values, axis=1) for values in (first, second)]
    return _correlation(*(values - values.mean(axis=1, keepdims=True) for values in ranks))


def kendall(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return Kendall's tau-b of corresponding rows (n, detectors); NaN if all values of a row are equal."""
    a, b = np.triu_indices(first.shape[1], 1)
    signs = [np.sign(values[:, a] - values[:, b]) for values in (first, second)]
    return _correlation(*signs)


def _correlation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    size = np.sqrt((first**2).sum(axis=1) * (second**2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(size > 0, (first * second).sum(axis=1) / size, np.nan))


def ranks_of_levels(values: np.ndarray) -> list[tuple[float, float, float]]:
    """Return the rank of the mean of each column of values (seeds, levels) with its 95 % interval over seeds.

    Rank 1 has the largest mean; equal means share the mean of their ranks.
    """
    count = len(values)
    drawn = np.concatenate([np.ones((1, count)), bootstrap_draws(count, RESAMPLES, 0)])
    means = np.round(drawn @ values / count, 12)  # equal values of different order are ties
    ranks = stats.rankdata(-means, axis=1)
    return [(float(column[0]), *percentile_interval(column[1:], count)) for column in ranks.T]


def verdict(detectors: int, tau: float, bounds: tuple[float, float], p: float) -> str:
    """Return the verdict of a coefficient on whether a smaller gap drives better."""
    if detectors < ENOUGH:
        return "too few detectors"
    if np.isnan(tau) or np.isnan(bounds[0]):
        return "nothing to order by"
    if bounds[0] <= 0 <= bounds[1] or p >= SURE:
        return "not shown"
    return "better" if tau > 0 else "worse"
