"""Predictions of a detector and labels of its test photos in every domain, for figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import ROCK, PhotoKey
from polarsim.report import paper
from polarsim.schemas.detect import INSTANCES, PREDICTIONS


@dataclass(frozen=True)
class DetectorResults:
    """Predictions of a detector and labels by evaluated domain, in the paper's order of domains."""

    trained: str  # training domain
    source: str  # of the run's photos
    instances: pd.DataFrame  # labelled rocks of the test photos
    predictions: dict[str, pd.DataFrame]  # rocks only, above the minimum confidence
    labels: dict[str, pd.DataFrame]
    pixels_of: Callable[[str, PhotoKey], np.ndarray | None]  # image of a domain and a key

    def title(self, domain: str) -> str:
        """Return the name of a domain in figures."""
        return paper.domain_title(paper.display_name(domain, self.source))


def read_detector_results(
    trained: str,
    source: str,
    *,
    instances: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    pixels_of: Callable[[str, PhotoKey], np.ndarray | None],
    confidence: float,
) -> DetectorResults:
    """Read the instance table, and the predictions and labels of each domain."""
    table = read_parquet(instances, INSTANCES.columns)
    domains = sorted(predictions, key=paper.domain_rank)
    tables = {domain: read_parquet(predictions[domain], PREDICTIONS.columns) for domain in domains}
    return DetectorResults(
        trained,
        source,
        table[(table["trained"] == trained) & (table["kind"] == ROCK)],
        {name: rows[(rows["kind"] == ROCK) & (rows["confidence"] >= confidence)] for name, rows in tables.items()},
        {domain: read_parquet(labels[domain], LABEL_COLUMNS) for domain in domains},
        pixels_of,
    )
