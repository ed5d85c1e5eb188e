"""Options of the tables and figures: what counts as found, how much is sampled, how large pictures are."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, Field


class TablesOptions(BaseModel, extra="forbid", frozen=True):
    """How results are scored and drawn. None of it changes a result, only what is said about it."""

    drawn_root: Path | None = Field(
        None,
        description="Folder in the release's layout with labels that people drew, which ours are scored against; null: "
        "that of the seeds, else the source's.",
    )
    seed: int = Field(0, ge=0, description="Seed of the points that are sampled on true surfaces.")
    iou_threshold: float = Field(0.5, gt=0, le=1, description="IoU from which a box counts as found.")
    large_rock_cm: float = Field(8, gt=0, description="Rocks with a longest side from here on are large, cm.")
    small_rock_cm: float = Field(5, gt=0, description="Rocks from here up to the large ones are small, cm.")
    surface_samples: int = Field(20_000, gt=0, description="Points sampled on the true rocks, and on the true ground.")
    min_visible_px: float = Field(12, ge=0, description="True labels with fewer visible pixels are left out, px.")
    min_contrast_dn: float = Field(
        10, ge=0, description="True labels that no exposure of the photo set shows this clearly are left out, DN."
    )
    shadows_drawn_from_ms: int = Field(
        128, gt=0, description="Exposure from which people draw shadows, ms: the analog's truth has them always."
    )
    compared_photos: int = Field(
        32, ge=0, description="Photos of a terrain, one a photo set at most, whose pixels are compared with the twins'."
    )
    figure_width_px: int = Field(1600, ge=400, le=8000, description="Width of the figures, px.")
