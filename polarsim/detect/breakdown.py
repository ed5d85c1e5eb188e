"""Detection metrics with intervals for all photos, for groups of photos and for size classes of labels."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect import metrics
from polarsim.detect.grouping import Unit, detections_by_photo, labels_by_photo, units_of
from polarsim.photo import BOX_CLASSES, PhotoKey, terrain_text
from polarsim.schemas.detect import BREAKDOWN, CURVES

ALL = "all"
SIZES = {
    "small": (0.0, 32.0**2),
    "medium": (32.0**2, 96.0**2),
    "large": (96.0**2, np.inf),
}  # COCO, area of the box, px^2
AREAS = (*metrics.ANY_AREA, *SIZES.values())
PHOTO_GROUPS: dict[str, Callable[[PhotoKey], str]] = {
    "exposure": lambda key: f"{key.exposure_ms:04d}",  # ms
    "azimuth": lambda key: key.azimuth,
    "light": lambda key: key.light,
    "terrain": lambda key: terrain_text(key.terrain),
}
MEASURES = ("map50", "map50_95", "iou_mean")
BREAKDOWN_COLUMNS = BREAKDOWN.without("split", "seed", "trained", "evaluated")
CURVE_IOUS = (0.5, 0.75)
CURVE_COLUMNS = CURVES.columns[2:]  # columns for a detector in a domain
GROUP_RESAMPLES = 200  # bootstrap replicates of the numerous groups of photos and size classes


@dataclass(frozen=True)
class Matches:
    """Matched predictions and labels of a detector in a domain, by class."""

    keys: list[PhotoKey]
    ranked: dict[str, metrics.Ranked]  # areas: all, then SIZES
    overlap: dict[str, np.ndarray]  # (n,) maximum IoU of each label with a prediction
    area: dict[str, np.ndarray]  # (n,) area of each label, px^2
    picture: dict[str, np.ndarray]  # (n,) index of the photo of each label in `keys`
    unit: np.ndarray  # (p,) bootstrap unit of each photo


def match_predictions(
    keys: Sequence[str],
    labels: pd.DataFrame,
    predictions: pd.DataFrame,
    performance: pd.DataFrame,
    unit: Unit = "view",
) -> Matches:
    """Match predictions with labels once for all metrics.

    Parameters
    ----------
    labels, predictions : DataFrame
        key, kind, x0, y0, x1, y1; predictions also confidence.
    performance : DataFrame
        `ipd.instance_performance` of the labels.
    """
    index = {key: n for n, key in enumerate(keys)}
    by_kind = {kind: performance[performance["kind"] == kind] for kind in BOX_CLASSES}
    detections = list(detections_by_photo(predictions, keys).values())
    ranked = metrics.rank_classes(labels_by_photo(labels, keys), detections, areas=AREAS)
    return Matches(
        [PhotoKey.parse(key) for key in keys],
        dict(zip(BOX_CLASSES, ranked, strict=True)),
        {kind: rows["iou"].to_numpy(float) for kind, rows in by_kind.items()},
        {kind: rows["area_px"].to_numpy(float) for kind, rows in by_kind.items()},
        {kind: rows["key"].map(index).to_numpy(int) for kind, rows in by_kind.items()},
        units_of(keys, unit),
    )


def breakdown(matched: Matches, *, resamples: int = 1000, group_resamples: int = GROUP_RESAMPLES) -> pd.DataFrame:
    """Return `BREAKDOWN_COLUMNS` for all photos, each size class of labels (COCO), and each group of photos.

    Kind `all` is the mean over classes with labels.
    """
    rows: list[dict[str, object]] = []
    everything = np.ones(len(matched.keys), bool)
    parts: list[tuple[str, str, np.ndarray, int]] = [(ALL, ALL, everything, 0)]
    parts += [("size", name, everything, number) for number, name in enumerate(SIZES, 1)]
    for by, group_of in PHOTO_GROUPS.items():
        groups = np.array([group_of(key) for key in matched.keys], str)
        parts += [(by, str(group), groups == group, 0) for group in np.unique(groups)]
    for by, group, chosen, area in parts:
        replicates = resamples if by == ALL else group_resamples
        rows += [{"by": by, "group": group} | row for row in _group_metrics(matched, chosen, area, replicates)]
    return pd.DataFrame(rows, columns=list(BREAKDOWN_COLUMNS))


def curves(matched: Matches) -> pd.DataFrame:
    """Return `CURVE_COLUMNS`: precision with COCO interpolation at 101 recalls for each class with labels."""
    parts = []
    for kind, ranked in matched.ranked.items():
        if ranked.labels[0].any():
            precision = metrics.precision_at_recalls(ranked)
            for iou in CURVE_IOUS:
                level = int(np.abs(metrics.IOU_THRESHOLDS - iou).argmin())
                columns = {"kind": kind, "iou": iou, "recall": metrics.RECALLS, "precision": precision[level]}
                parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(CURVE_COLUMNS))


def _group_metrics(matched: Matches, chosen: np.ndarray, area: int, resamples: int) -> Iterator[dict[str, object]]:
    """Yield a row per class and a row for all classes, for a mask (p,) of photos and a range of area (0: all)."""
    from polarsim.detect.bootstrap_numba import resampled_precision

    unit = np.zeros(len(chosen), int)
    numbers, unit[chosen] = np.unique(matched.unit[chosen], return_inverse=True)
    units = len(numbers)
    drawn = intervals.bootstrap_draws(units, resamples)
    values: list[np.ndarray] = []
    samples: list[np.ndarray] = []
    counts: list[int] = []
    for kind in BOX_CLASSES:
        ranked = matched.ranked[kind].of_pictures(chosen)
        precision = metrics.precision_at_recalls(ranked, area).mean(axis=1)
        counted = chosen[matched.picture[kind]] & _in_size(matched.area[kind], area)
        overlap, owner = matched.overlap[kind][counted], unit[matched.picture[kind][counted]]
        values.append(np.array([precision[0], precision.mean(), overlap.mean() if len(overlap) else np.nan]))
        replicates = resampled_precision(ranked, area, unit, drawn)
        means = intervals.resampled_means(overlap, owner, drawn)
        samples.append(np.stack([replicates[:, 0], replicates.mean(axis=1), means], axis=1))
        counts.append(len(overlap))
    values.append(_mean(np.array(values)))
    samples.append(_mean(np.array(samples)))
    facts = {"images": int(chosen.sum()), "units": units}
    for kind, count, value, sample in zip((*BOX_CLASSES, ALL), (*counts, sum(counts)), values, samples, strict=True):
        row: dict[str, object] = {"kind": kind, **facts, "labels": count}
        for number, name in enumerate(MEASURES):
            low, high = intervals.percentile_interval(sample[:, number], units)
            row |= {name: float(value[number]), f"{name}_low": low, f"{name}_high": high}
        yield row


def _mean(values: np.ndarray) -> np.ndarray:
    """Return the mean over the first axis without NaN; NaN if all values are NaN."""
    valid = ~np.isnan(values)
    total = np.where(valid, values, 0).sum(axis=0)
    return np.divide(total, valid.sum(axis=0), out=np.full(total.shape, np.nan), where=valid.any(axis=0))


def _in_size(area: np.ndarray, number: int) -> np.ndarray:
    low, high = AREAS[number]
    return (area >= low) & (area <= high)
