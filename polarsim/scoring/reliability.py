"""Whether labels are right as often as their confidence says.

A label is right where it has a partner among the true boxes of its own photo. Copies of a label on the exposures of its
exposure bracket are one drawing and one try: together they weigh as much as one label, so that intervals stay honest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.photo import BOX_CLASSES
from polarsim.schemas.report import RELIABILITY
from polarsim.scoring.label_pairs import EDGES

COLUMNS = {name: RELIABILITY.dtypes[name] for name in RELIABILITY.without("seeds")}
ANY_SOURCE = "all"
BINS = 10  # of equal numbers of labels
FEWEST = 30  # labels in a bin: fewer bins where there are few labels
_ONE_BOX = ["terrain", "position", "light", "azimuth", "camera", "kind", *EDGES]
_Z = 1.959964  # of the normal distribution, 95 %


@dataclass(frozen=True)
class Confidences:
    """How sure n labels are, and whether they are right; copies in an exposure bracket are included."""

    confidence: np.ndarray  # (n,)
    right: np.ndarray  # (n,) bool
    weight: np.ndarray  # (n,) 1 over the number of copies in the exposure bracket


def label_confidences(pairs: pd.DataFrame) -> Confidences:
    """Confidences of the labels among rows of `label_pairs`."""
    labels = pairs[pairs["label_px"].notna()]
    copies = labels.groupby(_ONE_BOX)["key"].transform("size").to_numpy(float)
    return Confidences(labels["confidence"].to_numpy(float), labels["hit"].to_numpy(bool), 1 / copies)


def equal_bins(own: Confidences) -> np.ndarray:
    """(n,) bins by confidence, each of about the same weight; labels of one confidence share a bin."""
    _, index = np.unique(own.confidence, return_inverse=True)
    weight = np.bincount(index, own.weight)
    total = weight.sum()
    centre = np.cumsum(weight) - weight / 2
    return np.asarray(np.floor(np.clip(total // FEWEST, 1, BINS) * centre / total).astype(int)[index])


def reliability_bins(own: Confidences) -> pd.DataFrame:
    """A row a bin: lowest, highest and mean confidence, share of right labels with its interval, mean squared error."""
    rows = []
    bins = equal_bins(own)
    for number in np.unique(bins):
        confidence, right, weight = (part[bins == number] for part in (own.confidence, own.right, own.weight))
        total, share = float(weight.sum()), float(np.average(right, weights=weight))
        low, high = wilson(share, total)
        rows.append(
            {
                "labels": total, "low": float(confidence.min()), "high": float(confidence.max()),
                "confidence": float(np.average(confidence, weights=weight)),
                "right": share, "right_low": low, "right_high": high,
                "brier": float(np.average((confidence - right) ** 2, weights=weight)),
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def reliability_table(pairs: pd.DataFrame) -> pd.DataFrame:
    """The bins of every kind, of all sources together and of each by itself, with `COLUMNS`."""
    parts = []
    for kind in BOX_CLASSES:
        of_kind = pairs[(pairs["kind"] == kind) & pairs["label_px"].notna()]
        for source in [ANY_SOURCE, *sorted(set(of_kind["source"]))] if len(of_kind) else []:
            chosen = of_kind if source == ANY_SOURCE else of_kind[of_kind["source"] == source]
            parts.append(reliability_bins(label_confidences(chosen)).assign(kind=kind, label_source=source))
    whole = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(COLUMNS))
    return whole.astype(COLUMNS)[list(COLUMNS)]


def wilson(share: float, n: float) -> tuple[float, float]:
    """95 % interval of a share of n (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    spread = _Z * _Z / n
    centre = share + spread / 2
    half = float(np.sqrt(share * (1 - share) * spread + spread * spread / 4))
    return max(0.0, (centre - half) / (1 + spread)), min(1.0, (centre + half) / (1 + spread))


def calibration_error(bins: pd.DataFrame) -> float:
    """Expected calibration error: mean distance of the confidence of bins from their share of right labels."""
    return float(np.average((bins["confidence"] - bins["right"]).abs(), weights=bins["labels"]))


def brier_score(bins: pd.DataFrame) -> float:
    """Mean squared distance of the confidence from 1 (right) or 0 (Brier, Mon. Weather Rev. 78 (1950) 1)."""
    return float(np.average(bins["brier"], weights=bins["labels"]))
