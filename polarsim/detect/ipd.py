"""Instance performance difference: how differently one judge performs on the same rocks in two domains.

Chen, Negrut et al., arXiv 2411.07375. The performance of a rock in a photo is the IoU of its label with the best
predicted box (`instance_performance`); rocks are paired by photo key and rock id.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.detect import metrics
from polarsim.detect.dataset import BOX_COLUMNS
from polarsim.errors import DetectError
from polarsim.randomness import generator

INSTANCE_COLUMNS = ("key", "kind", "rock", "iou")


@dataclass(frozen=True)
class Difference:
    """IPD over `pairs` rocks, with 95 % bootstrap intervals over photos; NaN without pairs."""

    pairs: int
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
        Columns key, kind, rock, iou; a row a label, ordered by photo, kind, rock.
    """
    sure = predictions[predictions["confidence"] >= confidence]
    found = {name: rows[list(BOX_COLUMNS)].to_numpy(float) for name, rows in sure.groupby(["key", "kind"])}
    parts = []
    for name, rows in labels.groupby(["key", "kind"]):
        overlap = metrics.best_overlap(rows[list(BOX_COLUMNS)].to_numpy(float), found.get(name, np.zeros((0, 4))))
        parts.append(rows[["key", "kind", "rock"]].assign(iou=overlap))
    table = pd.concat(parts) if parts else labels[["key", "kind", "rock"]].assign(iou=0.0)
    return table.sort_values(["key", "kind", "rock", "iou"], kind="stable", ignore_index=True)


def pair(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    """Rocks that both tables of `instance_performance` know: key, kind, rock, first, second (their performances).

    Labels without a rock (id below 1) have no partner. Of several labels of one rock in a photo the best one counts.
    """
    sides = []
    for table, name in ((first, "first"), (second, "second")):
        known = table[table["rock"] > 0]
        sides.append(known.groupby(["key", "kind", "rock"])["iou"].max().rename(name).reset_index())
    return sides[0].merge(sides[1], on=["key", "kind", "rock"], how="inner", validate="one_to_one")


def instance_performance_difference(
    first: pd.DataFrame, second: pd.DataFrame, *, seed: int = 0, resamples: int = 1000
) -> Difference:
    """IPD of one judge between two domains, from the rows of `instance_performance` in each.

    Parameters
    ----------
    first, second : DataFrame
        Columns key, kind, rock, iou.
    seed, resamples : int
        Of the bootstrap, which draws photos, not rocks: rocks of one photo are not independent.

    Raises
    ------
    DetectError
        A column is missing.
    """
    for table in (first, second):
        missing = [name for name in INSTANCE_COLUMNS if name not in table.columns]
        if missing:
            raise DetectError(f"column {missing[0]!r} of the instance performances is missing")
    pairs = pair(first, second)
    if pairs.empty:
        return Difference(0, *[float("nan")] * 6)
    gain = (pairs["first"] - pairs["second"]).to_numpy(float)
    photo = pd.factorize(pairs["key"], sort=True)[0]
    rocks, total, total_abs = (np.bincount(photo, weights) for weights in (np.ones_like(gain), gain, np.abs(gain)))
    random = generator(seed, "detect", "ipd")
    means, means_abs = np.empty(resamples), np.empty(resamples)
    for n in range(resamples):
        drawn = random.integers(len(rocks), size=len(rocks))
        means[n] = total[drawn].sum() / rocks[drawn].sum()
        means_abs[n] = total_abs[drawn].sum() / rocks[drawn].sum()
    low, high = np.quantile(means, [0.025, 0.975])
    folded = 0.0 if low <= 0 <= high else min(abs(low), abs(high))  # of the mean's interval, where its sign is open
    abs_low, abs_high = np.quantile(means_abs, [0.025, 0.975])
    return Difference(
        len(gain),
        float(abs(gain.mean())),
        float(np.abs(gain).mean()),
        float(folded),
        float(max(abs(low), abs(high))),
        float(abs_low),
        float(abs_high),
    )
