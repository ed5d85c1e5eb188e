"""All figures of what a run's detectors found, from the tables of the detect stage."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from polarsim.report.figures.curves import draw_curves
from polarsim.report.figures.ipd_histogram import draw_ipd_histogram
from polarsim.report.figures.matrices import draw_detection, draw_ipd


def draw_detectors(*, found: Mapping[str, Path], figures: Mapping[str, Path], origin: dict[str, str]) -> None:
    """Draw the matrix of detection, precision over recall, IPD, and its histogram over rocks.

    Parameters
    ----------
    found, figures
        detection, curves, ipd, rocks: Parquet table of the detect stage, and PNG to write.
    """
    draw_detection(detection=found["detection"], figure=figures["detection"], origin=origin)
    draw_curves(curves=found["curves"], figure=figures["curves"], origin=origin)
    draw_ipd(ipd=found["ipd"], figure=figures["ipd"], origin=origin)
    draw_ipd_histogram(rocks=found["rocks"], figure=figures["rocks"], origin=origin)
