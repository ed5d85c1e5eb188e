"""Options of the scores: what they are measured against, and what counts as found."""

from __future__ import annotations

from pydantic import BaseModel, Field

from polarsim.user_path import UserPath


class ScoringOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how results are scored; none of them changes a result, only what is said about it."""

    annotated_root: UserPath | None = Field(
        None,
        description="Our labels are scored against those that people drew in this folder, which has the "
        "release's layout; null: that of the seeds, else the source's.",
    )
    iou_threshold: float = Field(0.5, gt=0, le=1, description="A box counts as found from this IoU on.")
    min_visible_px: float = Field(
        12, ge=0, description="True labels with fewer visible pixels are left out, px; people do not draw them."
    )
    min_shadow_width_px: int = Field(
        3,
        ge=1,
        description="True shadows that are nowhere this wide are left out, px; the same as for rendered shadows "
        "(`render.min_shadow_width_px`).",
    )
    min_contrast_dn: float = Field(
        10,
        ge=0,
        description="True labels that no exposure of the exposure bracket shows this clearly are left out, DN.",
    )
