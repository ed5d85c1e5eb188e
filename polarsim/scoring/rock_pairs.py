"""Found rocks and true ones brought together: which are the same, how many were found, how large they came out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from polarsim.geometry.boxes import pairs
from polarsim.scoring.metrics import Metric, summary

MATCH_RADIUS = 0.5  # of the true size: how far the centre of a found rock may be off
SMALLEST_RADIUS = 0.03  # metres
# Longest sides of large rocks, and of small ones up to those, cm: a rover steers round the first, drives over the rest.
LARGE_ROCK_CM, SMALL_ROCK_CM = 8.0, 5.0


@dataclass(frozen=True)
class RockPairs:
    """Found rocks and true ones: row numbers that belong together, one to one."""

    true: np.ndarray  # (p,)
    found: np.ndarray  # (p,)


def pair_rocks(true: pd.DataFrame, found: pd.DataFrame) -> RockPairs:
    """One-to-one pairs: as many as possible, then the nearest; none beyond half the true rock's size.

    Distances are between centres, as shares of that radius. Both tables are in one frame.
    """
    centres = [table[["x", "y", "z"]].to_numpy(float) for table in (true, found)]
    distance = np.linalg.norm(centres[0][:, None] - centres[1][None], axis=-1)
    radius = np.maximum(MATCH_RADIUS * true["size_m"].to_numpy(float), SMALLEST_RADIUS)[:, None]
    return RockPairs(*pairs(-distance / radius, distance < radius))


def recall_and_precision(true: pd.DataFrame, found: pd.DataFrame, pairs: RockPairs, seen: np.ndarray) -> list[Metric]:
    """Share of true rocks found and of found rocks true, by size, and how sizes differ.

    A rock counts by its own size: a true one for recall, a found one for precision. True rocks that scans `seen`
    (n,) saw have a recall of their own: what hides behind another rock no scan can find.
    """
    metrics = []
    true_cm, found_cm = (100 * table["size_m"].to_numpy(float) for table in (true, found))
    for number, subject in enumerate(size_names()):
        wanted, given = size_classes(true_cm)[number], size_classes(found_cm)[number]
        for name, members, hits in (
            ("recall", wanted, pairs.true),
            ("recall_seen", wanted & seen, pairs.true),
            ("precision", given, pairs.found),
        ):
            if members.any():
                share = float(np.isin(np.flatnonzero(members), hits).mean())
                metrics.append(Metric(subject, name, share, "1", int(members.sum()), "truth"))
    for column, name in (("size_m", "size_error"), ("height_m", "height_error")):
        difference = found[column].to_numpy(float)[pairs.found] - true[column].to_numpy(float)[pairs.true]
        metrics += summary("paired rocks", name, 1000 * np.abs(difference), "mm", "truth")
    ratio = found["volume_m3"].to_numpy(float)[pairs.found] / true["volume_m3"].to_numpy(float)[pairs.true]
    return metrics + summary("paired rocks", "volume_ratio", ratio, "1", "truth", p90=False)


def size_classes(size_cm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) bool of the large and of the small rocks."""
    large = size_cm >= LARGE_ROCK_CM
    return large, (size_cm >= SMALL_ROCK_CM) & ~large


def size_names() -> tuple[str, str]:
    """What the large and the small rocks are called in tables."""
    return f"rocks of {LARGE_ROCK_CM:g} cm and more", f"rocks of {SMALL_ROCK_CM:g} to {LARGE_ROCK_CM:g} cm"
