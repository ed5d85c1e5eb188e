"""Instance performance difference (IPD) of a detector on the same rocks in two domains.

Chen, Negrut et al., arXiv 2411.07375. The performance of a rock in a photo is the maximum IoU of its label with a
predicted box (`instance_performance`). Rocks are paired by photo key and rock id. `IpdRules` defines details that the
paper does not specify.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect.grouping import BOX_COLUMNS, Unit, rows_by, units_of, values_by
from polarsim.geometry import boxes
from polarsim.photo import PhotoKey
from polarsim.schemas.detect import IPD_ROCKS

ROCK_KEY = ["key", "kind", "rock"]  # identifies a rock in a photo; the rock id is that of the terrain
ROCK_COLUMNS = IPD_ROCKS.without("split", "seed", "trained", "first", "second")
MissingTreatment = Literal["zero", "left_out"]


@dataclass(frozen=True)
class IpdRules:
    """Rules of the IPD. The defaults follow the paper, in which the IPD is a difference of two IOU_means."""

    undetected: MissingTreatment = "zero"  # a labelled rock without an overlapping prediction
    # A rock labelled in one domain only. Labels without a rock id are always excluded because they cannot be paired.
    unpaired: MissingTreatment = "left_out"
    unit: Unit = "view"  # of the bootstrap


@dataclass(frozen=True)
class IpdResult:
    """IPD over `pairs` rocks, with 95 % bootstrap intervals over `units` views or photos.

    All metrics are NaN without pairs. Intervals are NaN with fewer than two units.
    """

    pairs: int
    units: int
    unit: str
    ipd: float  # | mean of p_first - p_second |, as in Table 2 of the paper: gains and losses cancel
    ipd_abs: float  # mean of | p_first - p_second |: gains and losses do not cancel
    ipd_low: float
    ipd_high: float
    ipd_abs_low: float
    ipd_abs_high: float


def instance_performance(labels: pd.DataFrame, predictions: pd.DataFrame, confidence: float) -> pd.DataFrame:
    """Return the maximum IoU of each label with the confident predictions of the same photo and kind.

    Labels have columns key, kind, rock, x0, y0, x1, y1; predictions key, kind, confidence, x0, y0, x1, y1. The result
    has key, kind, rock, iou, area_px (area of the label, px^2); a row per label, by photo, kind, rock.
    """
    confident = predictions[predictions["confidence"] >= confidence]
    by_photo = values_by(confident, ["key", "kind"], BOX_COLUMNS)
    corners = labels[list(BOX_COLUMNS)].to_numpy(float)
    overlap = np.zeros(len(labels))
    for name, rows in rows_by(labels, ["key", "kind"]).items():
        overlap[rows] = boxes.largest_iou(corners[rows], by_photo.get(name, np.zeros((0, 4))))
    table = labels[["key", "kind", "rock"]].assign(iou=overlap, area_px=boxes.area(corners))
    return table.sort_values(["key", "kind", "rock", "iou"], kind="stable", ignore_index=True)


def rock_performance(performances: pd.DataFrame) -> pd.Series:
    """Return the performance of each rock in each photo, from `instance_performance`, by `ROCK_KEY`, sorted.

    If a rock has several labels in a photo, the maximum performance is used. NaN counts as a missing performance.
    """
    identified = performances[(performances["rock"] > 0) & performances["iou"].notna()]
    return identified.groupby(ROCK_KEY)["iou"].max()


def pair_rock_labels(first: pd.DataFrame, second: pd.DataFrame, rules: IpdRules | None = None) -> pd.DataFrame:
    """Pair the rocks of two tables of `instance_performance`: key, kind, rock, first, second (`rock_performance`)."""
    rules = rules or IpdRules()
    sides = {"first": rock_performance(first), "second": rock_performance(second)}
    how: Literal["outer", "inner"] = "outer" if rules.unpaired == "zero" else "inner"
    pairs = pd.concat(sides, axis=1, join=how).reset_index()
    if rules.undetected == "left_out":
        pairs = pairs[(pairs["first"] != 0) & (pairs["second"] != 0)]  # keeps NaN of missing labels
    pairs = pairs.fillna({"first": 0.0, "second": 0.0})
    return pairs.sort_values(ROCK_KEY, ignore_index=True)


def instance_performance_difference(
    first: pd.DataFrame, second: pd.DataFrame, *, rules: IpdRules | None = None, resamples: int = 1000
) -> IpdResult:
    """Return the IPD of a detector between two domains, from `instance_performance` in each domain."""
    rules = rules or IpdRules()
    pairs = pair_rock_labels(first, second, rules)
    if pairs.empty:
        return IpdResult(0, 0, rules.unit, *[float("nan")] * 6)
    gain = (pairs["first"] - pairs["second"]).to_numpy(float)
    unit = units_of(pairs["key"].astype(str).tolist(), rules.unit)
    units = int(unit.max()) + 1
    drawn = intervals.bootstrap_draws(units, resamples)
    low, high, abs_low, abs_high = (
        end
        for values in (gain, np.abs(gain))
        for end in intervals.percentile_interval(intervals.resampled_means(values, unit, drawn), units)
    )
    folded = 0.0 if low <= 0 <= high else min(abs(low), abs(high))  # lower limit of |mean|; 0 if the sign is uncertain
    values = (abs(gain.mean()), np.abs(gain).mean(), folded, max(abs(low), abs(high)), abs_low, abs_high)
    return IpdResult(len(gain), units, rules.unit, *map(float, values))


def rock_means(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return `ROCK_COLUMNS`: mean performance of each rock in each domain over its photos, from `pair_rock_labels`."""
    terrain = [PhotoKey.parse(str(key)).terrain for key in pairs["key"]]
    grouped = pairs.assign(terrain=terrain).groupby(["terrain", "kind", "rock"])
    table = grouped.agg(photos=("key", "size"), iou_first=("first", "mean"), iou_second=("second", "mean"))
    table["difference"] = table["iou_first"] - table["iou_second"]
    return table.reset_index()[list(ROCK_COLUMNS)]
