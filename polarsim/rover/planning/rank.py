"""Rank correlations over detectors between their gap and their drives: does a smaller gap drive better?

Coefficients are computed for all resamples at once: SciPy's functions, called for each, give the same to 1e-12 and take
5 s in place of milliseconds for a table.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from polarsim.errors import RoverError
from polarsim.formats import tables
from polarsim.intervals import RESAMPLES, draws, interval
from polarsim.photo import ROCK
from polarsim.rover.planning.cases import DETECTING, matched
from polarsim.schemas.rover import AUTONOMY_DETECTORS, AUTONOMY_RANK, EVERY_AUTONOMY

ENOUGH = 5  # detectors: of fewer no order says anything, for even Kendall's p is 0.08 at best
SURE = 0.05
_ROCK_POINTS = 300
# Which way is better: metrics of the gap and of drives.
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
    """Write metrics of every detector that drove, and how their order by gap agrees with that by driving.

    Parameters
    ----------
    each
        rover/every_autonomy.parquet.
    detection, ipd
        detect/detection.parquet and detect/ipd.parquet of the run whose detectors drove as `<domain>-seed<N>`.
    pair
        The photos' domain, and that of the rover's pictures: of these two is the IPD, in the second the mAP. Drives in
        other models do not count.
    split
        By which photos were shared out for the trainings; the first in the tables where it is not named.

    Raises
    ------
    RoverError
        No drive by a detector.
    FormatError
        A table is missing or has other columns.
    """
    every = tables.read_parquet(each, EVERY_AUTONOMY.columns)
    drives = driven(every, pair[1])
    if not len(drives):
        raise RoverError(f"{each}: no drive goes by a detector in {pair[1]}")
    gaps = gap_metrics(detection, ipd, pair, split)
    tables.write_parquet(by_detector, detector_metrics(drives, gaps))
    tables.write_parquet(ranks, ranked(drives, gaps))


def driven(every: pd.DataFrame, model: str) -> pd.DataFrame:
    """A row a drive by a detector in a model: mode, detector, light, seed and the metrics of `DRIVES`.

    Of a mode only lights and seeds that all its detectors drove: one that drove in easier light is no better.
    """
    own = every[every["mode"].isin(DETECTING) & every["metric"].isin(_METRICS) & (every["model"] == model)]
    keys = ["mode", "detector", "sun", "exposure", "lights", "seed"]
    wide = own.pivot_table("value", keys, "metric").rename(columns=_METRICS).reset_index()
    return wide.rename_axis(columns=None).groupby("mode", group_keys=False)[list(wide)].apply(matched, "detector")


def gap_metrics(detection: Path | None, ipd: Path | None, pair: tuple[str, str], split: str | None) -> pd.DataFrame:
    """`ipd` and `map50` of rocks by detector; NaN where a table has none."""
    found = []
    if detection is not None:
        table = _rocks(detection, ("map50", "evaluated"), split)
        found.append(table[table["evaluated"] == pair[1]].set_index("detector")["map50"])
    if ipd is not None:
        table = _rocks(ipd, ("ipd", "first", "second"), split)
        same = [set(both) == set(pair) for both in zip(table["first"], table["second"], strict=True)]
        found.append(table[same].set_index("detector")["ipd"])
    return (
        pd.concat(found, axis=1).reindex(columns=["ipd", "map50"]) if found else pd.DataFrame(columns=["ipd", "map50"])
    )


def _rocks(path: Path, columns: tuple[str, ...], split: str | None) -> pd.DataFrame:
    table = tables.read_parquet(path, ("trained", "seed", "kind", "split", *columns))
    table = table[table["kind"] == ROCK]
    table = table[table["split"] == (split or table["split"].iloc[0])]
    return table.assign(detector=table["trained"] + "-seed" + table["seed"].astype(str))


def detector_metrics(drives: pd.DataFrame, gaps: pd.DataFrame) -> pd.DataFrame:
    """A row a mode and detector, its gap and its drives; `AUTONOMY_DETECTORS`."""
    own = drives.groupby(["mode", "detector"]).agg(
        drives=("seed", "size"), seeds=("seed", "nunique"), **{name: (name, "mean") for name in DRIVES}
    )
    own = own.reset_index().join(gaps, on="detector").assign(rock_f1=lambda table: table["rock_points"] / _ROCK_POINTS)
    return own[list(AUTONOMY_DETECTORS.columns)].astype(AUTONOMY_DETECTORS.dtypes)


def ranked(drives: pd.DataFrame, gaps: pd.DataFrame) -> pd.DataFrame:
    """A row a mode, metric of the gap and metric of drives; `AUTONOMY_RANK`.

    Coefficients above 0: the detector that is better by its gap is better on drives. Intervals: seeds (with one seed:
    Suns, exposures and lights) are drawn with replacement, the same for all detectors. Kendall's p is of chance orders
    of the detectors, which such an interval knows nothing of.
    """
    rows = []
    for mode, own in drives.groupby("mode"):
        for gap, metric in [(gap, metric) for gap in GAPS for metric in DRIVES]:
            if (gap, metric) == ("rock_f1", "rock_points"):
                continue  # the same metric twice
            part = own if gap == "rock_f1" else own[own["detector"].isin(gaps.index[gaps[gap].notna()])]
            if len(part):
                rows.append((mode, gap, metric, *_rank(part, gaps, gap, metric)))
    return pd.DataFrame(rows, columns=list(AUTONOMY_RANK.columns)).astype(AUTONOMY_RANK.dtypes)


def _rank(drives: pd.DataFrame, gaps: pd.DataFrame, gap: str, metric: str) -> tuple[object, ...]:
    names = sorted(set(drives["detector"]))
    unit = "seed" if len(set(drives["seed"])) > 1 else "light"
    units = drives["seed"] if unit == "seed" else drives[["sun", "exposure", "lights"]].agg("_".join, axis=1)
    count = units.nunique()
    drawn = np.concatenate([np.ones((1, count)), draws(count, RESAMPLES, 0)])  # as it is, then resampled
    after = DRIVES[metric] * _means(drives, units, metric, drawn)
    if gap == "rock_f1":
        before = _means(drives, units, "rock_points", drawn)
    else:
        before = np.tile(GAPS[gap] * gaps.loc[names, gap].to_numpy(float), (len(drawn), 1))
    whole = ~np.isnan(before + after).any(axis=1)  # no resample in which a detector did not drive
    found = [np.where(whole, rank(before, after), np.nan) for rank in (spearman, kendall)]
    intervals = [interval(values[1:], count) for values in found]
    p = float(stats.kendalltau(before[0], after[0]).pvalue) if len(names) > 1 else np.nan
    says = verdict(len(names), float(found[1][0]), intervals[1], p)
    coefficients = [(float(values[0]), *bounds) for values, bounds in zip(found, intervals, strict=True)]
    return len(names), len(drives), count, unit, *coefficients[0], *coefficients[1], p, says


def _means(drives: pd.DataFrame, units: pd.Series, metric: str, drawn: np.ndarray) -> np.ndarray:
    """(resamples, detectors) means of drives; NaN where a detector has none."""
    by_unit = drives.assign(unit=units).pivot_table(metric, "detector", "unit", aggfunc=["sum", "count"])
    total, count = (by_unit[name].fillna(0).to_numpy(float) for name in ("sum", "count"))
    with np.errstate(invalid="ignore"):
        return np.asarray((drawn @ total.T) / (drawn @ count.T))


def spearman(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Spearman's coefficient of rows (n, detectors) and rows; NaN where all of a row are alike."""
    ranks = [stats.rankdata(values, axis=1) for values in (one, other)]
    return _correlation(*(values - values.mean(axis=1, keepdims=True) for values in ranks))


def kendall(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Kendall's tau-b of rows (n, detectors) and rows; NaN where all of a row are alike."""
    first, second = np.triu_indices(one.shape[1], 1)
    signs = [np.sign(values[:, first] - values[:, second]) for values in (one, other)]
    return _correlation(*signs)


def _correlation(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    size = np.sqrt((one**2).sum(axis=1) * (other**2).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(size > 0, (one * other).sum(axis=1) / size, np.nan))


def verdict(detectors: int, tau: float, bounds: tuple[float, float], p: float) -> str:
    """What a coefficient says of whether a smaller gap drives better."""
    if detectors < ENOUGH:
        return "too few detectors"
    if np.isnan(tau) or np.isnan(bounds[0]):
        return "nothing to order by"
    if bounds[0] <= 0 <= bounds[1] or p >= SURE:
        return "not shown"
    return "better" if tau > 0 else "worse"
