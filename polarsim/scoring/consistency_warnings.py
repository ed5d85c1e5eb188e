"""Warnings about inconsistencies of a run, from the consistency metrics."""

from __future__ import annotations

from dataclasses import dataclass, fields

import pandas as pd

from polarsim.photo import photo_scale
from polarsim.scoring.metrics import Metric

STAGE = "consistency"


@dataclass(frozen=True)
class _Limit:
    """Limit of a metric with the warning for values above (or below) the limit; px in photos of the reference width."""

    value: float
    sentence: str
    above: bool = True

    def is_exceeded(self, metric: Metric, photo_width: int) -> bool:
        limit = self.value * (photo_scale(photo_width) if metric.unit == "px" else 1)
        return metric.value > limit if self.above else metric.value < limit


# Several times the values of consistent runs (docs/notes/cameras.md), and below values that affect meshes and labels.
LIMITS = {
    "common_rotation": _Limit(0.03, "all scans need a common rotation by {value:.3f} degrees to fit the meshes"),
    "common_translation": _Limit(0.6, "all scans need a common translation by {value:.1f} mm to fit the meshes"),
    "rotation_between": _Limit(
        0.05, "the relative rotation of the two scans differs by {value:.3f} degrees after alignment with the meshes"
    ),
    "translation_between": _Limit(
        1.0, "the relative position of the two scans differs by {value:.1f} mm after alignment with the meshes"
    ),
    "cameras_rotation": _Limit(
        0.1, "a common rotation of the cameras by {value:.3f} degrees since the reconstruction of the meshes"
    ),
    "boxes_iou": _Limit(
        0.55, "mean IoU of only {value:.2f} between projected meshes and the boxes used for localisation", above=False
    ),
    "windows_found": _Limit(
        0.25,
        "only {value:.0%} of the windows of left photos have a match in right photos: do they belong to the same rig?",
        above=False,
    ),
    "across_rows": _Limit(1.5, "a median offset of {value:.1f} px across the epipolar lines"),
    "across_rows_spread": _Limit(1.5, "a spread of {value:.1f} px across the epipolar lines"),
    "iou_lost": _Limit(0.25, "the IoU of meshes and boxes is lower by {value:.2f} in the right camera"),
    "boxes_across_rows": _Limit(
        2.5, "the vertical offset between meshes and boxes differs by {value:.1f} px between the cameras"
    ),
    "feet_off": _Limit(0.1, "{value:.0%} of the rocks have a foot more than 2 cm above or below the ground"),
    "far_from_feet": _Limit(
        0.5, "{value:.0%} of the ground is farther than 0.5 m from all rocks, where the height is uncertain"
    ),
    "edge_mm_median": _Limit(
        90, "the shadow edges in photos are {value:.0f} mm from the predicted edges, median: check walls and lamps"
    ),
    "surveyed": _Limit(0.5, "the pose of the camera is unconfirmed, with possible errors of decimetres and degrees"),
}


def warnings_of(table: pd.DataFrame, photo_width: int) -> list[str]:
    """Return a warning for each row of a metric table that exceeds the limit of the metric.

    `photo_width`: width of the photos of the table, px.
    """
    return [
        f"Terrain {row['terrain']}: {sentence}."
        for row in table[table["stage"] == STAGE].to_dict("records")
        for sentence in metric_warning(Metric(**{field.name: row[field.name] for field in fields(Metric)}), photo_width)
    ]


def metric_warning(metric: Metric, photo_width: int) -> list[str]:
    """Return the warning for a metric of photos of a width, px; empty if the limit is not exceeded."""
    limit = LIMITS.get(metric.metric)
    if limit is None or not limit.is_exceeded(metric, photo_width):
        return []
    return [f"{metric.subject}: {limit.sentence.format(value=metric.value)}"]
