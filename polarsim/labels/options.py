"""Options of the labels stage."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field

from polarsim.labels import rover_light
from polarsim.labels.annotator_model import COEFFICIENTS


class LabelsOptions(BaseModel, extra="forbid", frozen=True):
    """How seed boxes are propagated the photo grid, and how their outlines are annotated."""

    corrections: Path | None = Field(
        None,
        description="Folder of label files that people edited, KEY.txt as `polarsim export` writes them or COCO: each "
        "wins for its photo, and flows on to others as seeds do.",
    )

    # What a photo shows, by the photo itself.
    visibility: Literal["photo", "annotator"] = Field(
        "photo",
        description="Which labels an exposure has: 'photo', those that stand out in the photo, or, without one, in the "
        "OLAT images of the meshes; 'annotator', as people labelled the release: rocks always, shadows from an "
        "exposure on; where no lamp shines nothing, unless the photo shows it or people drew the position's own.",
    )
    min_contrast: float = Field(
        3.0, ge=0, description="Least contrast of a label with its surround in its photo, noises of a pixel."
    )

    min_contrast_dn: float = Field(
        10.0,
        ge=0,
        description="The same in grey values of 4,095: less is half a step of a screen's 256 shades.",
    )

    # Which photos show what, as the people who drew the release's labels saw it (facts of the data set).
    shadow_start_ms: int = Field(
        128,
        gt=0,
        description="Shortest exposure under a Sun lamp with shadow labels, ms; a seed with shadows may be shorter.",
    )
    shadow_start_ms_by_terrain: dict[int, int] = Field(
        default_factory=dict, description="The same for single terrains (number: ms); wins over shadow_start_ms."
    )
    no_sun_start_ms: int = Field(
        2048, gt=0, description="Shortest exposure with labels where only the rover light shines, ms."
    )

    annotator_rover_light: tuple[float, ...] = Field(
        rover_light.COEFFICIENTS,
        min_length=len(rover_light.COEFFICIENTS),
        max_length=len(rover_light.COEFFICIENTS),
        description="Which rocks people draw without a Sun lamp, one coefficient a term of polarsim/labels/"
        "rover_light.py.",
    )

    # Seeds of several azimuths.

    # Rocks as bodies.
    min_rock_px: float = Field(12.0, gt=0, description="Smallest projected rock that is labelled, sqrt(area), px.")
    min_seen: float = Field(
        0.2, ge=0, le=1, description="Smallest share of a projected rock that nothing else hides, for a label."
    )

    # Shadows.
    ray_step_px: int = Field(2, ge=1, le=8, description="Shadows are cast at every n-th pixel along rows and columns.")
    min_shadow_px: float = Field(12.0, gt=0, description="Smallest cast shadow that is labelled, sqrt(area), px.")

    annotator_shadows: tuple[float, ...] = Field(
        COEFFICIENTS,
        min_length=len(COEFFICIENTS),
        max_length=len(COEFFICIENTS),
        description="How people box shadows, one coefficient a term of polarsim/labels/annotator_model.py: they "
        "move the edges "
        "of a cast shadow's box; all 0 leaves it as geometry has it.",
    )

    # Outlines.
    simplify_px: float = Field(0.6, ge=0, description="Largest error of a simplified outline, px.")
    wall_height_m: float = Field(0.30, ge=0, description="Height of the sandbox's walls above the sand, m; 0: none.")

    def shadow_start(self, terrain: int) -> int:
        """Shortest exposure under a Sun lamp with shadow labels, ms."""
        return self.shadow_start_ms_by_terrain.get(terrain, self.shadow_start_ms)
