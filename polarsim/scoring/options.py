"""Options of the evaluation: reference and thresholds."""

from __future__ import annotations

from pydantic import BaseModel, Field

from polarsim.user_path import UserPath


class ScoringOptions(BaseModel, extra="forbid", frozen=True):
    """Evaluation of results. These options do not change results."""

    annotated_root: UserPath | None = Field(
        None,
        description="Folder of annotations for the evaluation, in the layout of the release. null: folder of the seeds "
        "or source.",
    )
    iou_threshold: float = Field(0.5, gt=0, le=1, description="Minimum IoU of a detected box.")
    min_visible_px: float = Field(
        12, ge=0, description="Minimum number of visible pixels of a true label. Smaller objects are not annotated."
    )
    min_shadow_width_px: int = Field(
        3,
        ge=1,
        description="Minimum width of a true shadow, px; see `render.min_shadow_width_px`.",
    )
    min_contrast_dn: float = Field(
        10,
        ge=0,
        description="Minimum contrast of a true label in any photo of the exposure bracket, DN.",
    )
