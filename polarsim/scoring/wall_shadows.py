"""Metrics of walls: distance between predicted and measured shadow edges on open sand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.run_files.wall_edges import EdgeSamples
from polarsim.scoring.metrics import Metric, summary_metric

SUBJECT = "shadow edges of walls"


def wall_shadow_metrics(edges: Mapping[str, EdgeSamples]) -> list[Metric]:
    """Return median and 90th percentile of the distances, in mm on the ground and in pixels, and medians by Sun lamp.

    `edges`: samples by azimuth. Lamps without samples have no metric.
    """
    together = EdgeSamples.joined([edges[azimuth] for azimuth in sorted(edges)])
    metrics = summary_metric(SUBJECT, "edge_mm", 1000 * np.abs(together.offset_m), "mm", "photos")
    metrics += summary_metric(SUBJECT, "edge_px", together.offset_px, "px", "photos")
    for azimuth, samples in sorted(edges.items()):
        offset_mm = 1000 * np.abs(samples.offset_m)
        metrics += summary_metric(f"Sun {azimuth}, {SUBJECT}", "edge_mm", offset_mm, "mm", "photos", p90=False)
    return metrics
