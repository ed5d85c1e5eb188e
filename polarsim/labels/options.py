"""Options of the labels stage."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, Field, field_validator

from polarsim.errors import LabelError
from polarsim.photo import PhotoKey, Terrain
from polarsim.site import Site
from polarsim.site_parts import TerrainName
from polarsim.user_path import UserPath

# Annotators of the release draw shadows from 128 ms upwards, and under the rover light alone all labels from 2048 ms
# upwards; the usual exposure is 256 ms.
SHADOWS_FROM_USUAL, RIG_LAMP_FROM_USUAL = 0.5, 8


class LabelsOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the propagation of seed boxes to all photos."""

    corrections: UserPath | None = Field(
        None,
        description="Folder of corrected label files (KEY.txt or COCO). Corrections override seeds and are propagated "
        "like seeds.",
    )

    excluded_annotations: tuple[str, ...] = Field(
        (),
        description="Keys of photos (01_A_off_180_L_0256) whose seeds and corrections are ignored. `polarsim undo KEY` "
        "lists the derived labels.",
    )

    visibility: Literal["photo", "annotator"] = Field(
        "photo",
        description="Selects the labels of an exposure: 'photo' by contrast in the photo or OLAT image, 'annotator' by "
        "minimum exposures of the annotators.",
    )
    min_contrast_snr: float = Field(
        3.0,
        ge=0,
        description="Minimum contrast of a label with its surroundings, standard deviations of pixel noise. Higher "
        "values drop more labels.",
    )

    min_contrast_dn: float = Field(
        10.0,
        ge=0,
        description="Minimum contrast of a label with its surroundings, 12-bit grey values. Higher values drop more "
        "labels.",
    )

    min_shadow_exposure_ms_by_terrain: dict[TerrainName, int] = Field(
        default_factory=dict,
        description="Minimum exposure with shadow labels under a Sun lamp, ms, by terrain. Default: half the "
        "usual exposure of the site, 128 ms for POLAR.",
    )
    min_rock_side_px: float = Field(
        12.0,
        gt=0,
        description="Minimum projected size of a labelled rock, square root of the area, px at photo width 1936.",
    )
    ray_step_px: int = Field(
        2, ge=1, le=8, description="Step between sampled pixels of cast shadows, px; larger is faster and coarser."
    )

    @field_validator("excluded_annotations")
    @classmethod
    def _photo_keys(cls, values: tuple[str, ...]) -> tuple[str, ...]:
        try:
            return tuple(str(PhotoKey.parse(value)) for value in values)
        except LabelError as error:
            raise ValueError(str(error)) from error

    def excluded(self, terrain: Terrain) -> tuple[PhotoKey, ...]:
        """Return the photos of a terrain whose annotations are excluded."""
        return tuple(key for key in map(PhotoKey.parse, self.excluded_annotations) if key.terrain == terrain)

    def shadow_start(self, terrain: Terrain, usual_exposure_ms: int) -> int:
        """Return the minimum exposure with shadow labels under a Sun lamp, ms; `usual_exposure_ms` is the site's."""
        return self.min_shadow_exposure_ms_by_terrain.get(terrain, round(SHADOWS_FROM_USUAL * usual_exposure_ms))


def rig_lamp_ms(site: Site) -> int:
    """Return the minimum exposure with labels if only the rig's lamp is on, ms."""
    return RIG_LAMP_FROM_USUAL * site.usual_exposure_ms
