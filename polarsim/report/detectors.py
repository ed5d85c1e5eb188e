"""All tables of what a run's detectors found, from the tables of the detect stage."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from polarsim.report.breakdown_table import tabulate_breakdown
from polarsim.report.detection_table import tabulate_detection
from polarsim.report.differences_table import tabulate_differences
from polarsim.report.false_positives_table import tabulate_false_positives
from polarsim.report.ipd_rocks_table import tabulate_ipd_rocks
from polarsim.report.ipd_table import tabulate_ipd


def tabulate_detectors(
    *, found: Mapping[str, Path], tables: Path, origin: dict[str, str], min_mean_dn: float = 0.0
) -> None:
    """Write detection, differences, detection_breakdown, false_positives, ipd, ipd_rocks, each as {csv,md,tex,parquet}.

    Parameters
    ----------
    found
        detection, differences, breakdown, false_positives, ipd, rocks: Parquet tables of the detect stage.
    tables
        Folder to write to.
    min_mean_dn
        Pictures that are darker (mean above black, DN) were left out; 0: none was.
    """
    common: dict[str, Any] = {"detection": found["detection"], "origin": origin}
    tabulate_detection(**common, stem=tables / "detection", min_mean_dn=min_mean_dn)
    tabulate_differences(**common, differences=found["differences"], stem=tables / "differences")
    tabulate_breakdown(**common, breakdown=found["breakdown"], stem=tables / "detection_breakdown")
    tabulate_false_positives(**common, false_positives=found["false_positives"], stem=tables / "false_positives")
    tabulate_ipd(**common, ipd=found["ipd"], stem=tables / "ipd")
    tabulate_ipd_rocks(**common, rocks=found["rocks"], stem=tables / "ipd_rocks")
