"""Matching of detected and true rocks, with recall, precision and size errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.geometry.boxes import match_pairs
from polarsim.geometry.poses import Pose
from polarsim.scoring.metrics import Metric, summary_metric

MATCH_RADIUS = 0.5  # maximum distance of the centres of matched rocks, as a share of the true size
MIN_MATCH_RADIUS = 0.03  # metres
# Minimum longest sides of large and small rocks, cm. A rover drives around large rocks and over small rocks.
LARGE_ROCK_CM, SMALL_ROCK_CM = 8.0, 5.0


@dataclass(frozen=True)
class RockPairs:
    """Matches between true and detected rocks: row numbers."""

    true: np.ndarray  # (p,)
    found: np.ndarray  # (p,)


def pair_rocks(true: pd.DataFrame, found: pd.DataFrame, truth_from_sandbox: Pose | None = None) -> RockPairs:
    """Match each rock at most once: maximum number of pairs, then minimum distance, up to half the true rock size.

    Distances are between centres, relative to this radius. Without a pose, both tables are in the same frame.
    """
    centres, found_centres = (table[["x", "y", "z"]].to_numpy(float).reshape(-1, 3) for table in (true, found))
    if truth_from_sandbox is not None:
        found_centres = truth_from_sandbox.apply(found_centres)
    distance = np.linalg.norm(centres[:, None] - found_centres[None], axis=-1)
    radius = np.maximum(MATCH_RADIUS * true["size_m"].to_numpy(float), MIN_MATCH_RADIUS)[:, None]
    return RockPairs(*match_pairs(-distance / radius, distance < radius))


def recall_and_precision(
    true: pd.DataFrame, found: pd.DataFrame, pairs: RockPairs, visible: np.ndarray
) -> list[Metric]:
    """Return recall and precision by size class, and errors of size, height and volume of matched rocks.

    Recall uses the size of true rocks, precision the size of detected rocks. `recall_seen` is the recall of the true
    rocks that are visible in scans (`visible`, (n,) bool).
    """
    metrics = []
    true_cm, found_cm = (100 * table["size_m"].to_numpy(float) for table in (true, found))
    for number, subject in enumerate(size_names()):
        of_true, of_found = size_classes(true_cm)[number], size_classes(found_cm)[number]
        for name, members, hits in (
            ("recall", of_true, pairs.true),
            ("recall_seen", of_true & visible, pairs.true),
            ("precision", of_found, pairs.found),
        ):
            if members.any():
                share = float(np.isin(np.flatnonzero(members), hits).mean())
                metrics.append(Metric(subject, name, share, "1", int(members.sum()), "truth"))
    for column, name in (("size_m", "size_error"), ("height_m", "height_error")):
        difference = found[column].to_numpy(float)[pairs.found] - true[column].to_numpy(float)[pairs.true]
        metrics += summary_metric("paired rocks", name, 1000 * np.abs(difference), "mm", "truth")
    ratio = found["volume_m3"].to_numpy(float)[pairs.found] / true["volume_m3"].to_numpy(float)[pairs.true]
    return metrics + summary_metric("paired rocks", "volume_ratio", ratio, "1", "truth", p90=False)


def size_classes(size_cm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return masks (n,) of the large and of the small rocks."""
    large = size_cm >= LARGE_ROCK_CM
    return large, (size_cm >= SMALL_ROCK_CM) & ~large


def size_names() -> tuple[str, str]:
    """Return the names of large and small rocks in tables."""
    return f"rocks of {LARGE_ROCK_CM:g} cm and more", f"rocks of {SMALL_ROCK_CM:g} to {LARGE_ROCK_CM:g} cm"
