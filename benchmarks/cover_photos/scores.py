"""How well a detector finds the labels of cover photos, with intervals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from polarsim.detect import metrics
from polarsim.detect.dataset import BOX_COLUMNS
from polarsim.photo import BOX_CLASSES
from polarsim.randomness import generator


def cover_figures(
    labels: pd.DataFrame, predictions: pd.DataFrame, keys: Sequence[str], *, seed: int, resamples: int
) -> pd.DataFrame:
    """Average precision of each labelled kind, photos pooled, with 95 % intervals of a bootstrap over the photos.

    Columns: kind, images, labels, map50, map50_low, map50_high, map50_95, iou_mean (every prediction counts).
    """
    rows = []
    labels = labels[labels["key"].isin(keys)]
    for kind in (kind for kind in BOX_CLASSES if (labels["kind"] == kind).any()):
        truth = _by_photo(labels[labels["kind"] == kind], BOX_COLUMNS, keys)
        found = _by_photo(predictions[predictions["kind"] == kind], (*BOX_COLUMNS, "confidence"), keys)

        def precision(
            chosen: np.ndarray, truth: list[np.ndarray] = truth, found: list[np.ndarray] = found
        ) -> np.ndarray:
            return metrics.average_precision(
                [truth[n] for n in chosen], [found[n][:, :4] for n in chosen], [found[n][:, 4] for n in chosen]
            )

        whole = precision(np.arange(len(keys)))
        random = generator(seed, "covers", "bootstrap", kind)
        drawn = [precision(random.integers(len(keys), size=len(keys)))[0] for _ in range(resamples)]
        low, high = np.nanpercentile(drawn, [2.5, 97.5])
        best = np.concatenate([metrics.best_overlap(t, f[:, :4]) for t, f in zip(truth, found, strict=True)])
        rows.append((kind, len(keys), len(best), whole[0], low, high, whole.mean(), best.mean()))
    names = ["kind", "images", "labels", "map50", "map50_low", "map50_high", "map50_95", "iou_mean"]
    return pd.DataFrame(rows, columns=names)


def _by_photo(table: pd.DataFrame, columns: Sequence[str], keys: Sequence[str]) -> list[np.ndarray]:
    found = {str(key): rows.to_numpy(float) for key, rows in table.groupby("key")[list(columns)]}
    return [found.get(key, np.zeros((0, len(columns)))) for key in keys]
