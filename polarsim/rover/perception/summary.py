"""Metrics of onboard detectors over all drives, with 95 % intervals.

The bootstrap resamples rides (a drive under a Sun), since pictures of a ride are correlated.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import tables
from polarsim.intervals import bootstrap_interval
from polarsim.randomness import generator
from polarsim.rover.perception.measure import SETTING_COLUMNS, TABLES
from polarsim.rover.perception.sightings import HEIGHTS_M, recall_by_distance
from polarsim.schemas.rover import ONBOARD

_RIDE = ["seed", "sun"]
_NOWHERE = (np.nan, np.nan)
Statistic = Callable[[np.ndarray], float]  # of the values of rides
# Metric, (height, from, to), values of each ride, statistic, number of items
Sample = tuple[str, tuple[float, float, float], list[np.ndarray], Statistic, float]


def summarise_onboard(folders: Sequence[Path], table: Path, seed: int = 0) -> None:
    """Read the tables of drives and write a table of all metrics, the columns of `ONBOARD`."""
    parts = {
        name: pd.concat(
            [tables.read_parquet(folder / "onboard" / f"{name}.parquet", SETTING_COLUMNS) for folder in folders],
            ignore_index=True,
        )
        for name in TABLES
    }
    tables.write_parquet(table, metrics(parts, seed))


def metrics(parts: Mapping[str, pd.DataFrame], seed: int = 0) -> pd.DataFrame:
    """Return a row per metric of each source, model and exposure, and of all exposures of a model (exposure 0).

    value, low, high
        NaN without data.
    count
        Number of items: labels of rocks, rocks, cells or metres, depending on the metric.
    """
    rows: list[tuple[object, ...]] = []
    for group, tables_of_group in _groups(parts):
        for metric, labels, by_ride, statistic, count in _samples(tables_of_group):
            random = generator(seed, "rover", "onboard", *group, metric, *labels)
            value = statistic(np.concatenate(by_ride)) if by_ride else np.nan
            interval = bootstrap_interval(by_ride, statistic, random)
            rows.append((*group, metric, *labels, value, *interval, len(by_ride), count))
    return pd.DataFrame(rows, columns=list(ONBOARD.columns))


def _groups(parts: Mapping[str, pd.DataFrame]) -> Iterator[tuple[tuple[str, str, float], dict[str, pd.DataFrame]]]:
    stops = parts["stops"]
    keys = sorted(set(zip(stops["source"], stops["model"], stops["exposure_ms"].astype(float), strict=True)))
    for source, model, exposure in [*keys, *sorted({(*key[:2], 0.0) for key in keys if key[2]})]:
        chosen = {}
        for name, table in parts.items():
            of_model = table[(table["source"] == source) & (table["model"] == model)]
            chosen[name] = of_model[(of_model["exposure_ms"] == exposure) | (exposure == 0)]
        yield (source, model, exposure), chosen


def _samples(group: Mapping[str, pd.DataFrame]) -> Iterator[Sample]:
    recalls = [recall_by_distance(ride) for _, ride in group["sightings"].groupby(_RIDE)]
    for number in range(len(recalls[0]) if recalls else 0):
        height, low, high = recalls[0][["height_m", "from_m", "to_m"]].to_numpy(float)[number].tolist()
        counts = [ride.loc[number, ["detected", "rocks"]].to_numpy(float)[None] for ride in recalls]
        if total := float(sum(count[0, 1] for count in counts)):
            yield "recall", (height, low, high), counts, _share, total
    stable = group["stable"].assign(
        ever=group["stable"]["first_stable_m"].notna(),
        in_time=group["stable"]["first_stable_m"] > group["stable"]["stopping_m"],
    )
    for height in HEIGHTS_M:
        rocks, labels = stable[stable["height_m"] > height], (height, *_NOWHERE)
        yield _sample("stable share", labels, rocks, "ever", _mean)
        yield _sample("first stable distance m", labels, rocks, "first_stable_m", _median)
        yield _sample("stable before stopping distance", labels, rocks, "in_time", _mean)
    cells, stops, everywhere = group["map"], group["stops"], (np.nan, *_NOWHERE)
    count, metres = float(cells["cells"].sum()), float(stops["length_m"].sum())
    yield _sample("rock cell F1", everywhere, cells, ["right", "false", "missed"], _f1, count)
    yield _sample("height error m", everywhere, cells, "height_error_m", _median, count)
    yield _sample("heights within 5 cm", everywhere, cells, "within_5_cm", _mean, count)
    yield _sample("false stops per 100 m", everywhere, stops, ["stops", "length_m"], _per_100_m, metres)
    for height in HEIGHTS_M:
        name = f"miss_{round(100 * height)}_cm_m"
        gaps = stops.assign(**{name: stops[name].replace(np.inf, np.nan)})
        yield _sample("miss distance m", (height, *_NOWHERE), gaps, name, _minimum)


def _sample(
    metric: str,
    labels: tuple[float, float, float],
    table: pd.DataFrame,
    columns: str | list[str],
    statistic: Statistic,
    count: float | None = None,
) -> Sample:
    """Return the values of each ride without NaN; by default they are counted."""
    by_ride = [ride[columns].dropna().to_numpy(float) for _, ride in table.groupby(_RIDE)]
    return metric, labels, by_ride, statistic, float(sum(map(len, by_ride))) if count is None else count


def _share(rows: np.ndarray) -> float:
    """Return the sum of the first column divided by the sum of the second."""
    total = float(rows[:, 1].sum())
    return float(rows[:, 0].sum()) / total if total else np.nan


def _per_100_m(rows: np.ndarray) -> float:
    return 100 * _share(rows)


def _f1(rows: np.ndarray) -> float:
    right, false, missed = rows.sum(axis=0)
    return float(2 * right / (2 * right + false + missed)) if right + false + missed else np.nan


def _if_any(statistic: Statistic) -> Statistic:
    """Return a statistic that is NaN for empty arrays."""
    return lambda values: float(statistic(values)) if len(values) else np.nan


_mean, _median, _minimum = _if_any(np.mean), _if_any(np.median), _if_any(np.min)
