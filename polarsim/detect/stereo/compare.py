"""Stereo tables of all terrains, and the IPD of stereo depth between domains."""

from __future__ import annotations

from dataclasses import asdict
from itertools import combinations
from pathlib import Path

import pandas as pd

from polarsim.detect.ipd import IpdRules, instance_performance_difference
from polarsim.detect.options import ComparisonOptions
from polarsim.detect.stereo.measure import PAIR_COLUMNS, ROCK_COLUMNS, stereo_table
from polarsim.formats import tables
from polarsim.photo import ROCK
from polarsim.schemas.detect import STEREO_IPD


def compare_stereo(
    *, pairs: list[Path], rocks: list[Path], stereo: Path, instances: Path, ipd: Path, options: ComparisonOptions
) -> None:
    """Merge the tables of `measure_stereo` of all terrains, and write the IPD of every pair of domains.

    The performance of a rock is the share of its pixels with correct depth. It replaces the IoU of detectors.
    """
    tables.write_parquet(stereo, stereo_table(pd.concat([tables.read_parquet(path, PAIR_COLUMNS) for path in pairs])))
    performances = stereo_table(pd.concat([tables.read_parquet(path, ROCK_COLUMNS) for path in rocks]))
    tables.write_parquet(instances, performances)
    by_domain = {
        str(domain): rows.rename(columns={"performance": "iou"}).assign(kind=ROCK)
        for domain, rows in performances.groupby("domain")
    }
    differences = [
        {"first": first, "second": second}
        | asdict(
            instance_performance_difference(
                by_domain[first],
                by_domain[second],
                rules=IpdRules(unit=options.resampled),
                resamples=options.resamples,
            )
        )
        for first, second in combinations(sorted(by_domain), 2)
    ]
    tables.write_parquet(ipd, pd.DataFrame(differences, columns=list(STEREO_IPD.columns)).round(6))
