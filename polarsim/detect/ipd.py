"""Instance performance difference: how differently one detector performs on the same rocks in two domains.

Chen, Negrut et al., arXiv 2411.07375. The performance of a rock in a photo is the IoU of its label with the best
predicted box (`instance_performance`); rocks are paired by photo key and rock id. What the paper leaves open is stated
by `Rules`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import bootstrap, metrics
from polarsim.detect.grouping import BOX_COLUMNS, rows_by, values_by
from polarsim.errors import DetectError
from polarsim.geometry import boxes
from polarsim.photo import PhotoKey
from polarsim.schemas.detect import INSTANCES, IPD_ROCKS

INSTANCE_COLUMNS = INSTANCES.columns[2:6]  # of one detector in one domain
ROCK_COLUMNS = IPD_ROCKS.without("split", "seed", "trained", "first", "second")
Treatment = Literal["zero", "left_out"]


@dataclass(frozen=True)
class Rules:
    """What counts. The defaults follow the paper as far as it can be read: its IPD is a difference of two IOU_means.

    Attributes
    ----------
    undetected
        A labelled rock that no prediction overlaps: performance 0, or the pair is left out.
    unpaired
        A rock with a label in one domain only: left out, or performance 0 in the other. Labels without a rock id are
        left out always, for nobody knows their partners.
    unit
        What the bootstrap draws.
    """

    undetected: Treatment = "zero"
    unpaired: Treatment = "left_out"
    unit: bootstrap.Unit = "view"


@dataclass(frozen=True)
class Difference:
    """IPD over `pairs` rocks in `units` views or photos, with 95 % bootstrap intervals over these.

    All figures are NaN without pairs, and intervals with fewer than two units.
    """

    pairs: int
    units: int
    unit: str
    ipd: float  # | mean of p_first - p_second |, as the paper's Table 2: gains and losses cancel
    ipd_abs: float  # mean of | p_first - p_second |: they do not
    ipd_low: float
    ipd_high: float
    ipd_abs_low: float
    ipd_abs_high: float


def instance_performance(labels: pd.DataFrame, predictions: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """The best overlap of every label with the predictions of its photo and kind.

    Parameters
    ----------
    labels : DataFrame
        Columns key, kind, rock, x0, y0, x1, y1.
    predictions : DataFrame
        Columns key, kind, confidence, x0, y0, x1, y1.
    confidence : float
        Predictions below it do not count.

    Returns
    -------
    DataFrame
        Columns key, kind, rock, iou, area_px (of the label's box, px^2); a row a label, by photo, kind, rock.
    """
    sure = predictions[predictions["confidence"] >= confidence]
    found = values_by(sure, ["key", "kind"], BOX_COLUMNS)
    corners = labels[list(BOX_COLUMNS)].to_numpy(float)
    overlap = np.zeros(len(labels))
    for name, rows in rows_by(labels, ["key", "kind"]).items():
        overlap[rows] = metrics.best_overlap(corners[rows], found.get(name, np.zeros((0, 4))))
    table = labels[["key", "kind", "rock"]].assign(iou=overlap, area_px=boxes.area(corners))
    return table.sort_values(["key", "kind", "rock", "iou"], kind="stable", ignore_index=True)


def pair(first: pd.DataFrame, second: pd.DataFrame, rules: Rules | None = None) -> pd.DataFrame:
    """Rocks of both tables of `instance_performance`: key, kind, rock, first, second (their performances).

    Of several labels of one rock in a photo the best one counts. A performance that is NaN is none.

    Raises
    ------
    DetectError
        A column is missing.
    """
    rules = rules or Rules()
    sides = []
    for table, name in ((first, "first"), (second, "second")):
        missing = [column for column in INSTANCE_COLUMNS if column not in table.columns]
        if missing:
            raise DetectError(f"column {missing[0]!r} of the instance performances is missing")
        known = table[(table["rock"] > 0) & table["iou"].notna()]
        sides.append(known.groupby(["key", "kind", "rock"])["iou"].max().rename(name).reset_index())
    how: Literal["outer", "inner"] = "outer" if rules.unpaired == "zero" else "inner"
    pairs = sides[0].merge(sides[1], on=["key", "kind", "rock"], how=how, validate="one_to_one")
    if rules.undetected == "left_out":
        pairs = pairs[(pairs["first"] != 0) & (pairs["second"] != 0)]  # a missing label is NaN here, and stays
    pairs = pairs.fillna({"first": 0.0, "second": 0.0})
    return pairs.sort_values(["key", "kind", "rock"], ignore_index=True)


def instance_performance_difference(
    first: pd.DataFrame, second: pd.DataFrame, *, rules: Rules | None = None, seed: int = 0, resamples: int = 1000
) -> Difference:
    """IPD of one detector between two domains, from the rows of `instance_performance` in each.

    Parameters
    ----------
    first, second : DataFrame
        Columns key, kind, rock, iou.
    rules
        The defaults of `Rules` when None.
    seed, resamples : int
        Of the bootstrap.

    Raises
    ------
    DetectError
        A column is missing; or views are to be drawn, and keys are no photo keys.
    """
    rules = rules or Rules()
    pairs = pair(first, second, rules)
    if pairs.empty:
        return Difference(0, 0, rules.unit, *[float("nan")] * 6)
    gain = (pairs["first"] - pairs["second"]).to_numpy(float)
    unit = bootstrap.units_of(pairs["key"].astype(str).tolist(), rules.unit)
    units = int(unit.max()) + 1
    drawn = intervals.draws(units, resamples, seed)
    low, high = intervals.interval(intervals.resampled_means(gain, unit, drawn), units)
    folded = 0.0 if low <= 0 <= high else min(abs(low), abs(high))  # of the mean's interval, where its sign is open
    abs_low, abs_high = intervals.interval(intervals.resampled_means(np.abs(gain), unit, drawn), units)
    return Difference(
        len(gain),
        units,
        rules.unit,
        float(abs(gain.mean())),
        float(np.abs(gain).mean()),
        float(folded),
        float(max(abs(low), abs(high))),
        float(abs_low),
        float(abs_high),
    )


def of_rocks(pairs: pd.DataFrame) -> pd.DataFrame:
    """`ROCK_COLUMNS` of the rows of `pair`: mean performance of each rock in each domain over its photos."""
    terrain = [PhotoKey.parse(str(key)).terrain for key in pairs["key"]]
    grouped = pairs.assign(terrain=terrain).groupby(["terrain", "kind", "rock"])
    table = grouped.agg(photos=("key", "size"), iou_first=("first", "mean"), iou_second=("second", "mean"))
    table["difference"] = table["iou_first"] - table["iou_second"]
    return table.reset_index()[list(ROCK_COLUMNS)]
