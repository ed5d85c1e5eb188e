"""Calibration of the confidences of labels.

A label is correct if it is matched with a true box of the same photo. Copies of a label in the photos of an exposure
bracket are not independent. Together they have the weight of a single label, so that confidence intervals are valid.
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
BINS = 10  # maximum number of bins, with equal numbers of labels
MIN_BIN_LABELS = 30  # minimum number of labels in a bin
_BOX_OF_BRACKET = ["terrain", "position", "light", "azimuth", "camera", "kind", *EDGES]
_Z = 1.959964  # quantile of the normal distribution for an interval of 95 %


@dataclass(frozen=True)
class LabelConfidences:
    """Confidences and correctness of n labels, including copies in exposure brackets."""

    confidence: np.ndarray  # (n,)
    right: np.ndarray  # (n,) bool
    weight: np.ndarray  # (n,) 1 / number of copies in the exposure bracket


def label_confidences(pairs: pd.DataFrame) -> LabelConfidences:
    """Return the confidences of the labels in rows of `label_pairs`."""
    labels = pairs[pairs["label_px"].notna()]
    copies = labels.groupby(_BOX_OF_BRACKET)["key"].transform("size").to_numpy(float)
    return LabelConfidences(labels["confidence"].to_numpy(float), labels["hit"].to_numpy(bool), 1 / copies)


def equal_bins(labels: LabelConfidences) -> np.ndarray:
    """Return the bins (n,) by confidence, of about equal weight. Labels of equal confidence share a bin."""
    _, index = np.unique(labels.confidence, return_inverse=True)
    weight = np.bincount(index, labels.weight)
    total = weight.sum()
    centre = np.cumsum(weight) - weight / 2
    return np.asarray(np.floor(np.clip(total // MIN_BIN_LABELS, 1, BINS) * centre / total).astype(int)[index])


def reliability_bins(labels: LabelConfidences) -> pd.DataFrame:
    """Return a row per bin: confidence range and mean, share of correct labels with interval, mean squared error."""
    rows = []
    bins = equal_bins(labels)
    for number in np.unique(bins):
        confidence, right, weight = (part[bins == number] for part in (labels.confidence, labels.right, labels.weight))
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
    """Return the bins of every class, for all sources pooled and for each source, with `COLUMNS`."""
    parts = []
    for kind in BOX_CLASSES:
        of_kind = pairs[(pairs["kind"] == kind) & pairs["label_px"].notna()]
        for source in [ANY_SOURCE, *sorted(set(of_kind["source"]))] if len(of_kind) else []:
            chosen = of_kind if source == ANY_SOURCE else of_kind[of_kind["source"] == source]
            parts.append(reliability_bins(label_confidences(chosen)).assign(kind=kind, label_source=source))
    table = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(COLUMNS))
    return table.astype(COLUMNS)[list(COLUMNS)]


def wilson(share: float, n: float) -> tuple[float, float]:
    """Return the 95 % interval of a share of n (Wilson, J. Am. Stat. Assoc. 22 (1927) 209)."""
    spread = _Z * _Z / n
    centre = share + spread / 2
    half = float(np.sqrt(share * (1 - share) * spread + spread * spread / 4))
    return max(0.0, (centre - half) / (1 + spread)), min(1.0, (centre + half) / (1 + spread))


def binned_calibration_error(bins: pd.DataFrame) -> float:
    """Return the expected calibration error: mean difference of confidence and share of correct labels of bins."""
    return float(np.average((bins["confidence"] - bins["right"]).abs(), weights=bins["labels"]))


def brier_score(bins: pd.DataFrame) -> float:
    """Return the mean squared error of the confidence (Brier, Mon. Weather Rev. 78 (1950) 1)."""
    return float(np.average(bins["brier"], weights=bins["labels"]))
