"""Options of the cameras stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class LocalisationOptions(BaseModel, extra="forbid", frozen=True):
    """Rigs are localised by labels and meshes where there are no scans; the defaults fit the real data."""

    survey_sd_m: float = Field(
        0.4,
        gt=0,
        description="A tripod stands about its surveyed position with this standard deviation, m on each axis; a "
        "smaller one trusts the survey more.",
    )
    survey_sd_deg: float = Field(
        5,
        gt=0,
        description="Yaw and pitch lie about the nominal ones with this standard deviation, degrees; a smaller one "
        "trusts the survey more.",
    )
    rock_translation_sd_mm: float = Field(
        7,
        ge=0,
        description="Published rock meshes may lie off their positions by this standard deviation, mm on each axis; 0:"
        " they lie where they are said to.",
    )


class RefinementOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how located rigs are refined on photos, in which shaded meshes are looked for."""

    scales: tuple[float, ...] = Field(
        (0.25, 0.5),
        description="Photos are compared with shaded views at these shares of a photo's size, coarse to fine; none:"
        " rigs are not refined.",
    )


class CamerasOptions(BaseModel, extra="forbid", frozen=True):
    """The section says how the rigs are localised."""

    localisation: LocalisationOptions = Field(
        LocalisationOptions(), description="This section says how rigs are localised by labels and meshes."
    )
    refinement: RefinementOptions = Field(
        RefinementOptions(), description="This section says how rigs are refined on photos."
    )
