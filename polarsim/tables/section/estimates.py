"""A figure with its interval, and what may be said about two of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import pandas as pd

from polarsim.tables.layout import MISSING


@dataclass(frozen=True)
class Estimate:
    """The mean over trainings of other seeds, and an interval that holds the 95 % intervals of all of them.

    `low` and `high` are NaN where some training has no interval, `spread` (standard deviation of a sample over seeds)
    where there is one training.
    """

    value: float
    low: float = math.nan
    high: float = math.nan
    spread: float = math.nan

    @property
    def known(self) -> bool:
        return not math.isnan(self.value)

    def text(self, decimals: int = 3) -> str:
        """The value, ± its spread over seeds, and [its interval]: each where it is known."""
        if not self.known:
            return MISSING
        spread = "" if math.isnan(self.spread) else f" ± {self.spread:.{decimals}f}"
        interval = "" if math.isnan(self.low) else f" [{self.low:.{decimals}f}, {self.high:.{decimals}f}]"
        return f"{self.value:.{decimals}f}{spread}{interval}"


def estimate(rows: pd.DataFrame, name: str, factor: float = 1.0) -> Estimate:
    """One figure of the rows of one training each; NaN without any.

    Parameters
    ----------
    name
        Column of the figure; `<name>_low` and `<name>_high` hold its interval, where there are any.
    factor
        100 for percent.
    """
    values = factor * rows[name].dropna().astype(float)
    if not len(values):
        return Estimate(math.nan)
    low, high = math.nan, math.nan
    if f"{name}_low" in rows.columns:
        bounds = factor * rows.loc[values.index, [f"{name}_low", f"{name}_high"]].astype(float)
        if not bounds.isna().to_numpy().any():
            low, high = float(bounds.iloc[:, 0].min()), float(bounds.iloc[:, 1].max())
    spread = float(values.std(ddof=1)) if len(values) > 1 else math.nan
    return Estimate(float(values.mean()), low, high, spread)


def compared(first: Estimate, second: Estimate) -> int:
    """1 or -1 where the first lies surely above or below the second: where both have intervals that do not meet.

    0 says that they cannot be told apart. Intervals that do not meet are a stricter test than that of their difference.
    """
    if first.low > second.high:
        return 1
    return -1 if first.high < second.low else 0


def verdict(first: Estimate, second: Estimate) -> str:
    """Words behind two figures of which the reader sees which one is larger."""
    if compared(first, second):
        return "distinguishable"
    return "no intervals" if math.isnan(first.low) or math.isnan(second.low) else "not distinguishable"


def listed(words: Iterable[str], last: str = "and") -> str:
    """a; a and b; a, b and c."""
    *first, final = list(words) or [""]
    return f"{', '.join(first)} {last} {final}" if first else final


def counted(number: int, noun: str, nouns: str = "") -> str:
    """1 photo, 2 photos, 1,413 labels."""
    return f"{number:,} {noun if number == 1 else nouns or noun + 's'}"


def spanned(values: Sequence[int]) -> str:
    """The only value, or from the least to the largest, with commas."""
    low, high = min(values), max(values)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
