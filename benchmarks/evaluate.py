"""Speed of the evaluation with intervals for the paper's 1,730 test photos: compiled kernels against the reference.

    python benchmarks/evaluate.py [photos]

Each photo has 14 labels and 300 predictions of each kind, twice the maximum of a detector. CPU seconds on one thread
for one detector in one domain; a run has 9 such pairs per split and seed. The reference uses a tenth of the samples.

Last metrics (AMD EPYC, Zen 4, busy machine): bootstrap 12.2 s, compiled 1.5 s (8.1 times); all metrics of a
detector in a domain 13.0 s (with the reference 55 s).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import bootstrap_numba, metrics
from polarsim.detect.breakdown import breakdown, match_predictions
from polarsim.detect.grouping import BOX_COLUMNS, units_of
from polarsim.detect.ipd import instance_performance
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES
from polarsim.site import polar

LABELS, PREDICTIONS, RESAMPLES = 14, 300, 1000
PAIRS = 9


def synthetic_tables(photos: int) -> tuple[list[str], pd.DataFrame, pd.DataFrame]:
    """Return keys, labels and predictions: half of the labels are detected with an error, the rest is random."""
    rng = np.random.default_rng(0)
    every = [str(key) for terrain in range(1, 14) for key in polar().photos_of(terrain)]
    keys = sorted(rng.choice(every, photos, replace=False).tolist())
    photo_size = polar().images.size
    labels, found = [], []
    for kind in BOX_CLASSES:
        corner, size = rng.uniform(0, photo_size, (photos, LABELS, 2)), rng.uniform(15, 150, (photos, LABELS, 2))
        label = np.concatenate([corner, corner + size], axis=2)
        strewn = rng.uniform(0, photo_size, (photos, PREDICTIONS - LABELS, 2))
        stray = np.concatenate([strewn, strewn + rng.uniform(15, 150, strewn.shape)], axis=2)
        near = label + rng.normal(0, 6, label.shape)
        sure = np.concatenate(
            [rng.beta(2, 2, (photos, LABELS)), rng.beta(1, 12, (photos, PREDICTIONS - LABELS))], axis=1
        )
        labels.append(_rows(keys, kind, label).assign(rock=1 + np.arange(photos * LABELS) % LABELS))
        found.append(_rows(keys, kind, np.concatenate([near, stray], axis=1)).assign(confidence=sure.ravel()))
    return keys, pd.concat(labels, ignore_index=True), pd.concat(found, ignore_index=True)


def _rows(keys: list[str], kind: str, corners: np.ndarray) -> pd.DataFrame:
    table = pd.DataFrame(boxes.clip(corners.reshape(-1, 4), *polar().images.size), columns=list(BOX_COLUMNS))
    return table.assign(key=np.repeat(keys, corners.shape[1]), kind=kind)


def cpu_seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def main(photos: int) -> None:
    keys, labels, found = synthetic_tables(photos)
    performance = instance_performance(labels, found, 0.25)
    match_predictions(keys[:2], labels[:0], found[:0], performance[:0])  # imports and compiles
    matched = match_predictions(keys, labels, found, performance)
    ranked = matched.ranked[BOX_CLASSES[0]]
    unit = units_of(keys, "view")
    units = int(unit.max()) + 1
    few, all_draws = (intervals.bootstrap_draws(units, number, 0) for number in (RESAMPLES // 10, RESAMPLES))
    bootstrap_numba.resampled_precision(ranked, 0, unit, few[:1])
    reference = 10 * cpu_seconds(lambda: [metrics.precision_at_recalls(ranked, 0, drawn[unit]) for drawn in few])
    compiled = cpu_seconds(lambda: bootstrap_numba.resampled_precision(ranked, 0, unit, all_draws))
    print(f"{photos} photos, {units} views, {len(ranked.picture)} predictions of a kind")
    print(
        f"bootstrap of {RESAMPLES} resamples: {reference:.1f} s, compiled {compiled:.1f} s: "
        f"{reference / compiled:.1f} times"
    )

    whole = cpu_seconds(lambda: breakdown(match_predictions(keys, labels, found, performance)))
    print(f"all figures of a detector in a domain: {whole:.1f} s; {PAIRS} pairs: {PAIRS * whole / 60:.1f} minutes")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1730)
