"""Options of the cameras stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class PlacementOptions(BaseModel, extra="forbid", frozen=True):
    """How rigs are placed by labels and meshes where there are no scans. The defaults fit the real data."""

    distance_m: tuple[float, float] = Field(
        (1.0, 7.0), description="Horizontal distances from the origin at which a tripod is looked for, m."
    )
    height_m: tuple[float, float] = Field(
        (0.8, 2.0), description="Heights above the median rock at which a camera is looked for, m."
    )
    survey_sd_m: float = Field(0.4, gt=0, description="Prior on a tripod's place about the survey, m on each axis.")
    survey_sd_deg: float = Field(5, gt=0, description="Prior on yaw and pitch about the nominal ones, degrees.")
    rock_shift_sd_mm: float = Field(
        7,
        ge=0,
        description="Prior on how far published rock meshes lie off their places, mm on each axis; 0: not at all.",
    )


class RefinementOptions(BaseModel, extra="forbid", frozen=True):
    """How located rigs are refined on photos, in which shaded meshes are looked for."""

    scales: tuple[float, ...] = Field(
        (0.25, 0.5), description="Sizes of the shaded views over the photos', coarse to fine; none: no refinement."
    )


class CamerasOptions(BaseModel, extra="forbid", frozen=True):
    """Where the rigs stood."""

    placement: PlacementOptions = Field(PlacementOptions(), description="Rigs placed by labels and meshes.")
    refinement: RefinementOptions = Field(RefinementOptions(), description="Rigs refined on photos.")
