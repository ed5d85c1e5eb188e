"""Evaluation of a detector on a domain with bootstrap replicates that all evaluations share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import metrics
from polarsim.detect.false_positives import false_positives_of_photos
from polarsim.detect.grouping import detections_by_photo, labels_by_photo, units_of
from polarsim.detect.ipd import instance_performance, rock_performance
from polarsim.detect.options import ComparisonOptions
from polarsim.photo import BOX_CLASSES
from polarsim.schemas.detect import CHANGE_ENDS

_AT_HALF = np.array([0.5])


@dataclass(frozen=True)
class DomainEvaluation:
    """Metrics of a detector on the photos `keys` of a domain."""

    keys: Sequence[str]
    labels: pd.DataFrame  # key, kind, rock, x0, y0, x1, y1
    predictions: pd.DataFrame  # key, kind, confidence, x0, y0, x1, y1
    options: ComparisonOptions
    size: tuple[int, int]  # width and height of the photos, px

    @cached_property
    def performance(self) -> pd.DataFrame:
        labels, predictions = (table[table["key"].isin(self.keys)] for table in (self.labels, self.predictions))
        return instance_performance(labels, predictions, self.options.iou_confidence)

    @cached_property
    def rock_performance(self) -> dict[str, pd.Series]:
        """Performance of the rocks in photos by class, see `ipd.rock_performance`."""
        return {kind: rock_performance(self.performance[self.performance["kind"] == kind]) for kind in BOX_CLASSES}

    @cached_property
    def false_positives(self) -> pd.DataFrame:
        return false_positives_of_photos(
            self.keys, self.labels, self.predictions, self.options.iou_confidence, self.size
        )

    @cached_property
    def precision(self) -> dict[str, np.ndarray]:
        """mAP@0.5 (1 + resamples,) by class: point estimate, then bootstrap replicates."""
        from polarsim.detect.bootstrap_numba import resampled_precision

        unit, drawn = self.draws
        precision = {}
        detections = list(detections_by_photo(self.predictions, self.keys).values())
        classes = metrics.rank_classes(labels_by_photo(self.labels, self.keys), detections, _AT_HALF)
        for kind, ranked in zip(BOX_CLASSES, classes, strict=True):
            replicates = resampled_precision(ranked, 0, unit, drawn)[:, 0]
            precision[kind] = np.concatenate([metrics.precision_at_recalls(ranked).mean(axis=1), replicates])
        return precision

    def rates(self, column: str) -> np.ndarray:
        """Return a column of `false_positives` per rock-free area (1 + resamples,): point estimate, then replicates."""
        unit, drawn = self.draws
        every = np.concatenate([np.ones((1, drawn.shape[1])), drawn])
        values, free = (self.false_positives[name].to_numpy(float) for name in (column, "free"))
        return intervals.resampled_ratios(values, free, unit, every)

    @cached_property
    def draws(self) -> tuple[np.ndarray, np.ndarray]:
        """Bootstrap unit of each photo and draw count of each unit, equal for evaluations of the same photos."""
        unit = units_of(self.keys, self.options.resampled)
        return unit, intervals.bootstrap_draws(int(unit.max()) + 1, self.options.resamples)


def ipd_change(
    kind: str, photo: DomainEvaluation, twin: DomainEvaluation, replaced: DomainEvaluation
) -> dict[str, object]:
    """Return mean IoU, IPD and the change of the IPD over the rocks that photos and both twins contain."""
    sides = {"photo": photo, "twin": twin, "replaced": replaced}
    performances = {name: evaluation.rock_performance[kind] for name, evaluation in sides.items()}
    pairs = pd.concat(performances, axis=1, join="inner").sort_index()
    if pairs.empty:
        return {"pairs": 0}
    unit = units_of(pairs.index.get_level_values("key").astype(str).tolist(), photo.options.resampled)
    units = int(unit.max()) + 1
    drawn = intervals.bootstrap_draws(units, photo.options.resamples)
    gain, other_gain = ((pairs["photo"] - pairs[name]).to_numpy(float) for name in ("twin", "replaced"))
    row: dict[str, object] = {"pairs": len(pairs), "iou_photo": pairs["photo"].mean()}
    row |= {"iou_twin": pairs["twin"].mean(), "iou": pairs["replaced"].mean()}
    row |= paired_change("ipd", np.abs(_means(gain, unit, drawn)), np.abs(_means(other_gain, unit, drawn)), units)
    return row | paired_change(
        "ipd_abs", _means(np.abs(gain), unit, drawn), _means(np.abs(other_gain), unit, drawn), units
    )


def paired_change(name: str, twin: np.ndarray, replaced: np.ndarray, units: int) -> dict[str, float]:
    """Return both metrics and their difference with interval, from values (1 + resamples,) of the same replicates."""
    low, high = intervals.percentile_interval(replaced[1:] - twin[1:], units)
    values = (float(twin[0]), float(replaced[0]), float(replaced[0] - twin[0]), low, high)
    return dict(zip((f"{name}{end}" for end in CHANGE_ENDS), values, strict=True))


def _means(values: np.ndarray, unit: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """Return the mean of values (n,) and the means of the bootstrap replicates (1 + resamples,)."""
    return np.concatenate([[values.mean()], intervals.resampled_means(values, unit, drawn)])
