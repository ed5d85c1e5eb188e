"""Metrics of onboard detectors over all drives, with 95 % intervals.

The bootstrap resamples rides (a drive under a Sun), since pictures of a ride are correlated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
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
_GROUP = ["source", "model", "exposure_ms"]
Statistic = Callable[[np.ndarray], float]  # of the rows of rides


def summarise_onboard(folders: Sequence[Path], table: Path, seed: int = 0) -> None:
    """Read the tables of drives and write a table of all metrics, the columns of `ONBOARD`.

    Raises
    ------
    FormatError
        The tables of a drive are missing.
    """
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
        selected = [*_recalls(tables_of_group), *_stable(tables_of_group), *_map(tables_of_group)]
        for metric, labels, by_ride, statistic, count in [*selected, *_stops(tables_of_group)]:
            random = generator(seed, "rover", "onboard", *group, metric, *labels)
            value = statistic(np.concatenate(by_ride)) if by_ride else np.nan
            rows.append(
                (*group, metric, *labels, value, *bootstrap_interval(by_ride, statistic, random), len(by_ride), count)
            )
    return pd.DataFrame(rows, columns=list(ONBOARD.columns))


MetricRow = tuple[str, tuple[float, float, float], list[np.ndarray], Statistic, float]
_NOWHERE = (np.nan, np.nan)


def _groups(parts: Mapping[str, pd.DataFrame]) -> list[tuple[tuple[str, str, float], dict[str, pd.DataFrame]]]:
    keys = sorted(set(parts["stops"][_GROUP].itertuples(index=False, name=None)))
    pooled = sorted({(source, model, 0.0) for source, model, exposure in keys if exposure})
    groups = []
    for source, model, exposure in [*keys, *pooled]:
        selected = {}
        for name, table in parts.items():
            chosen = (table["source"] == source) & (table["model"] == model)
            selected[name] = table[chosen & ((table["exposure_ms"] == exposure) | (exposure == 0))]
        groups.append(((source, model, float(exposure)), selected))
    return groups


def _recalls(group: Mapping[str, pd.DataFrame]) -> list[MetricRow]:
    rides = [recall_by_distance(ride) for _, ride in group["sightings"].groupby(_RIDE)]
    rows: list[MetricRow] = []
    for number in range(len(rides[0]) if rides else 0):
        height, low, high = rides[0][["height_m", "from_m", "to_m"]].to_numpy(float)[number].tolist()
        counts = [ride.loc[number, ["detected", "rocks"]].to_numpy(float)[None] for ride in rides]
        total = float(sum(count[0, 1] for count in counts))
        if total:
            rows.append(("recall", (height, low, high), counts, _share, total))
    return rows


def _stable(group: Mapping[str, pd.DataFrame]) -> list[MetricRow]:
    rows: list[MetricRow] = []
    for height in HEIGHTS_M:
        high = group["stable"][group["stable"]["height_m"] > height]
        rides = [ride for _, ride in high.groupby(_RIDE)]
        labels = (height, *_NOWHERE)
        ever = [ride["first_stable_m"].notna().to_numpy(float) for ride in rides]
        distance = [ride["first_stable_m"].dropna().to_numpy(float) for ride in rides]
        in_time = [(ride["first_stable_m"] > ride["stopping_m"]).to_numpy(float) for ride in rides]
        total = float(len(high))
        rows += [
            ("stable share", labels, ever, _mean, total),
            ("first stable distance m", labels, distance, _median, float(sum(map(len, distance)))),
            ("stable before stopping distance", labels, in_time, _mean, total),
        ]
    return rows


def _map(group: Mapping[str, pd.DataFrame]) -> list[MetricRow]:
    rides = [ride for _, ride in group["map"].groupby(_RIDE)]
    labels = (np.nan, *_NOWHERE)
    hits = [ride[["right", "false", "missed"]].to_numpy(float) for ride in rides]
    cells = float(group["map"]["cells"].sum())
    return [
        ("rock cell F1", labels, hits, _f1, cells),
        ("height error m", labels, [ride["height_error_m"].dropna().to_numpy(float) for ride in rides], _median, cells),
        ("heights within 5 cm", labels, [ride["within_5_cm"].dropna().to_numpy(float) for ride in rides], _mean, cells),
    ]


def _stops(group: Mapping[str, pd.DataFrame]) -> list[MetricRow]:
    rides = [ride for _, ride in group["stops"].groupby(_RIDE)]
    metres = float(group["stops"]["length_m"].sum())
    counts = [ride[["stops", "length_m"]].to_numpy(float) for ride in rides]
    rows: list[MetricRow] = [
        ("false stops per 100 m", (np.nan, *_NOWHERE), counts, lambda rows: 100 * _share(rows), metres)
    ]
    for height in HEIGHTS_M:
        gaps = [ride[f"miss_{round(100 * height)}_cm_m"].to_numpy(float) for ride in rides]
        gaps = [gap[np.isfinite(gap)] for gap in gaps]
        rows.append(("miss distance m", (height, *_NOWHERE), gaps, _minimum, float(sum(map(len, gaps)))))
    return rows


def _share(rows: np.ndarray) -> float:
    """Return the sum of the first column divided by the sum of the second."""
    total = float(rows[:, 1].sum())
    return float(rows[:, 0].sum()) / total if total else np.nan


def _f1(rows: np.ndarray) -> float:
    right, false, missed = rows.sum(axis=0)
    return float(2 * right / (2 * right + false + missed)) if right + false + missed else np.nan


def _if_any(statistic: Statistic) -> Statistic:
    """Return a statistic that is NaN for empty arrays."""
    return lambda values: float(statistic(values)) if len(values) else np.nan


_mean, _median, _minimum = _if_any(np.mean), _if_any(np.median), _if_any(np.min)
