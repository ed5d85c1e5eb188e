"""Warnings about inconsistencies of a run, from the consistency metrics."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

STAGE = "consistency"


@dataclass(frozen=True)
class _Limit:
    """Limit of a metric with the warning for values above (or below) the limit."""

    value: float
    sentence: str
    above: bool = True

    def is_exceeded(self, value: float) -> bool:
        return value > self.value if self.above else value < self.value


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


def warnings_of(table: pd.DataFrame) -> list[str]:
    """Return a warning for each row of a metric table that exceeds the limit of the metric."""
    return [
        f"Terrain {row['terrain']}: {sentence}."
        for row in table[table["stage"] == STAGE].to_dict("records")
        for sentence in metric_warning(str(row["subject"]), str(row["metric"]), float(row["value"]))
    ]


def metric_warning(subject: str, metric: str, value: float) -> list[str]:
    """Return the warning for a metric; empty if the limit is not exceeded."""
    limit = LIMITS.get(metric)
    return [f"{subject}: {limit.sentence.format(value=value)}"] if limit and limit.is_exceeded(value) else []
