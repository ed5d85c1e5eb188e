"""Plain sentences on what does not agree in a run, from the metrics of its consistency."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

STAGE = "consistency"


@dataclass(frozen=True)
class _Limit:
    """From where on a metric is a complaint; `above` tells which side is bad."""

    value: float
    sentence: str
    above: bool = True

    def broken(self, value: float) -> bool:
        return value > self.value if self.above else value < self.value


# Several times what sound runs show (docs/notes/cameras.md), and well below what spoils meshes and labels.
LIMITS = {
    "common_rotation": _Limit(
        0.03, "all scans together would have to rotate by {value:.3f} degrees to lie on the meshes"
    ),
    "common_translation": _Limit(0.6, "all scans together would have to move by {value:.1f} mm to lie on the meshes"),
    "rotation_between": _Limit(0.05, "on the meshes the two scans lie {value:.3f} degrees otherwise than written"),
    "translation_between": _Limit(1.0, "on the meshes the two scans lie {value:.1f} mm otherwise than written"),
    "cameras_rotation": _Limit(0.1, "cameras rotated together by {value:.3f} degrees after the meshes were made"),
    "boxes_iou": _Limit(0.55, "projected meshes meet the boxes with a mean IoU of {value:.2f} only", above=False),
    "windows_found": _Limit(
        0.25, "{value:.0%} of the left photos' windows are found in the right ones: are these one rig's?", above=False
    ),
    "across_rows": _Limit(1.5, "the right photos lie {value:.1f} px beside the rows of the left ones"),
    "across_rows_spread": _Limit(1.5, "the right photos' rows stray by {value:.1f} px from those of the left ones"),
    "iou_lost": _Limit(0.25, "meshes meet the right camera's boxes by {value:.2f} of IoU worse than the left one's"),
    "boxes_across_rows": _Limit(2.5, "boxes of the right camera lie {value:.1f} px otherwise up or down on the meshes"),
    "feet_off": _Limit(0.1, "the feet of {value:.0%} of the rocks lie over 2 cm above or below it: unsupported"),
    "far_from_feet": _Limit(0.5, "{value:.0%} of it is farther than 0.5 m from all rocks: its height there is a guess"),
    "surveyed": _Limit(0.5, "nothing proves the pose of the camera: it may be decimetres and degrees off"),
}


def complaints(table: pd.DataFrame) -> list[str]:
    """A sentence for each row of a metric table whose files do not agree."""
    return [
        f"Terrain {row['terrain']}: {sentence}."
        for row in table[table["stage"] == STAGE].to_dict("records")
        for sentence in complaint(str(row["subject"]), str(row["metric"]), float(row["value"]))
    ]


def complaint(subject: str, metric: str, value: float) -> list[str]:
    """The sentence on one metric; none where it holds."""
    limit = LIMITS.get(metric)
    return [f"{subject}: {limit.sentence.format(value=value)}"] if limit and limit.broken(value) else []
