"""Options of the labels stage."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, field_validator

from polarsim.errors import LabelError
from polarsim.photo import SHADOWS_ANNOTATED_FROM_MS, PhotoKey
from polarsim.user_path import UserPath


class LabelsOptions(BaseModel, extra="forbid", frozen=True):
    """How seed boxes are propagated to all photos."""

    corrections: UserPath | None = Field(
        None,
        description="Label files in this folder were edited by people, KEY.txt as `polarsim export` writes them or "
        "COCO: each wins for its photo, and is propagated to others as seeds are.",
    )

    taken_back: tuple[str, ...] = Field(
        (),
        description="Seeds and corrections of these photos count as never drawn: keys such as 01_A_off_180_L_0256. "
        "`polarsim undo KEY` shows what followed from one.",
    )

    visibility: Literal["photo", "annotator"] = Field(
        "photo",
        description="An exposure has these labels: 'photo', those that stand out in the photo, or, without one, in "
        "the OLAT images of the meshes; 'annotator', as people labelled the release: rocks always, "
        "shadows from an exposure on; where no lamp shines nothing, unless the photo shows it or people"
        " drew the position's own.",
    )
    min_contrast: float = Field(
        3.0,
        ge=0,
        description="A label stands out from its surround in its photo by so many standard deviations of a pixel's "
        "noise, or it is left out.",
    )

    min_contrast_dn: float = Field(
        10.0,
        ge=0,
        description="A label also stands out by so many grey values of 4,095: less is half a step of a screen's 256"
        " shades.",
    )

    shadow_start_ms_by_terrain: dict[int, int] = Field(
        default_factory=dict,
        description="Shortest exposure under a Sun lamp with shadow labels, ms, for single terrains (number: ms); 128 "
        "for all others.",
    )
    min_rock_side_px: float = Field(
        12.0, gt=0, description="Minimum projected size of a labelled rock, square root of the area, px."
    )
    ray_step_px: int = Field(
        2, ge=1, le=8, description="Step between sampled pixels of cast shadows, px; larger is faster and coarser."
    )

    @field_validator("taken_back")
    @classmethod
    def _photo_keys(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        try:
            return tuple(str(PhotoKey.parse(value)) for value in values)
        except LabelError as error:
            raise ValueError(str(error)) from error

    def excluded(self, terrain: int) -> tuple[PhotoKey, ...]:
        """Return the photos of a terrain whose annotations are excluded."""
        return tuple(key for key in map(PhotoKey.parse, self.taken_back) if key.terrain == terrain)

    def shadow_start(self, terrain: int) -> int:
        """Shortest exposure under a Sun lamp with shadow labels, ms."""
        return self.shadow_start_ms_by_terrain.get(terrain, SHADOWS_ANNOTATED_FROM_MS)
