"""Metrics of walls: distance between predicted and measured shadow edges on open sand."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from polarsim.run_files.wall_edges import EdgeSamples
from polarsim.scoring.metrics import Metric, summary_metric

SUBJECT = "shadow edges of walls"
MIN_SAMPLES = 10  # minimum number of measured edges of a lamp; the median of fewer edges may be a rock's shadow


def wall_shadow_metrics(edges: Mapping[str, EdgeSamples]) -> list[Metric]:
    """Return median and 90th percentile of the distances, in mm on the ground and in pixels, and medians by Sun lamp.

    `edges`: samples by azimuth. Lamps with few samples have no metric of their own.
    """
    together = EdgeSamples.joined([edges[azimuth] for azimuth in sorted(edges)])
    metrics = summary_metric(SUBJECT, "edge_mm", 1000 * np.abs(together.offset_m), "mm", "photos")
    metrics += summary_metric(SUBJECT, "edge_px", together.offset_px, "px", "photos")
    for azimuth, samples in sorted(edges.items()):
        if len(samples) < MIN_SAMPLES:
            continue
        offset_mm = 1000 * np.abs(samples.offset_m)
        metrics += summary_metric(f"Sun {azimuth}, {SUBJECT}", "edge_mm", offset_mm, "mm", "photos", p90=False)
    return metrics
