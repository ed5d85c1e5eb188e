"""Options of the labels stage."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, field_validator

from polarsim.errors import LabelError
from polarsim.labels import rover_light
from polarsim.labels.annotator import COEFFICIENTS
from polarsim.photo import PhotoKey
from polarsim.survey import WALL_HEIGHT, is_surveyed
from polarsim.user_path import UserPath


class LabelsOptions(BaseModel, extra="forbid", frozen=True):
    """How seed boxes are propagated the photo grid, and how their outlines are annotated."""

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

    # What a photo shows, by the photo itself.
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

    # Which photos show what, as the people who drew the release's labels saw it (facts of the data set).
    shadow_start_ms: int = Field(
        128,
        gt=0,
        description="Under a Sun lamp shadows are labelled from this exposure on, ms, or from that of the shortest "
        "seed with shadows.",
    )
    shadow_start_ms_by_terrain: dict[int, int] = Field(
        default_factory=dict,
        description="On single terrains shadows are labelled from another exposure on (number: ms); this wins over "
        "shadow_start_ms.",
    )
    no_sun_start_ms: int = Field(
        2048, gt=0, description="Where only the rover light shines, photos are labelled from this exposure on, ms."
    )

    annotator_rover_light: tuple[float, ...] = Field(
        rover_light.COEFFICIENTS,
        min_length=len(rover_light.COEFFICIENTS),
        max_length=len(rover_light.COEFFICIENTS),
        description="These coefficients tell which rocks people draw without a Sun lamp, one a term of "
        "polarsim/labels/rover_light.py.",
    )

    # Seeds of several azimuths.

    # Rocks as bodies.
    min_rock_px: float = Field(
        12.0, gt=0, description="Rocks are labelled from this projected size on, square root of the area, px."
    )
    min_seen: float = Field(
        0.2, ge=0, le=1, description="Rocks are labelled from this visible share of their projection on."
    )

    # Shadows.
    ray_step_px: int = Field(
        2,
        ge=1,
        le=8,
        description="Shadows are cast at every n-th pixel along rows and columns; a larger step is faster and "
        "coarser, px.",
    )
    min_shadow_px: float = Field(
        12.0, gt=0, description="Cast shadows are labelled from this size on, square root of the area, px."
    )

    annotator_shadows: tuple[float, ...] = Field(
        COEFFICIENTS,
        min_length=len(COEFFICIENTS),
        max_length=len(COEFFICIENTS),
        description="These coefficients tell how people box shadows, one a term of "
        "polarsim/labels/annotator.py: they move the edges of a cast shadow's box; all 0 leaves "
        "it as geometry has it.",
    )

    # Outlines.
    simplify_px: float = Field(
        0.6, ge=0, description="Outlines are simplified with errors up to this, px; a larger one makes fewer points."
    )
    wall_height_m: float = Field(
        WALL_HEIGHT,
        ge=0,
        description="Walls of the sandbox stand so high above the sand, m, and shade it; 0: there are none.",
    )

    @field_validator("taken_back")
    @classmethod
    def _photo_keys(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        try:
            return tuple(str(PhotoKey.parse(value)) for value in values)
        except LabelError as error:
            raise ValueError(str(error)) from error

    def of(self, terrain: int) -> LabelsOptions:
        """These options, without walls where nobody stated those of a terrain."""
        return self if is_surveyed(terrain) else self.model_copy(update={"wall_height_m": 0.0})

    def excluded(self, terrain: int) -> tuple[PhotoKey, ...]:
        """Return the photos of a terrain whose annotations are excluded."""
        return tuple(key for key in map(PhotoKey.parse, self.taken_back) if key.terrain == terrain)

    def shadow_start(self, terrain: int) -> int:
        """Shortest exposure under a Sun lamp with shadow labels, ms."""
        return self.shadow_start_ms_by_terrain.get(terrain, self.shadow_start_ms)
