"""Options of the cameras stage."""

from __future__ import annotations

from pydantic import BaseModel, Field


class LocalisationOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the localisation by labels and meshes, for terrains without scans."""

    rock_translation_sd_mm: float = Field(
        7,
        ge=0,
        description="Standard deviation of published rock meshes from their true positions, mm on each axis. 0 keeps "
        "the published positions.",
    )


class RefinementOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the refinement of rigs, lenses and lamps on photos."""

    scales: tuple[float, ...] = Field(
        (0.25, 0.5),
        description="Scales of photos 1936 px wide that are compared with shaded views, coarse to fine. Photos of "
        "another width get the same widths. An empty list disables the refinement.",
    )


class CamerasOptions(BaseModel, extra="forbid", frozen=True):
    """Options of the cameras stage."""

    localisation: LocalisationOptions = Field(
        LocalisationOptions(), description="Localisation of rigs by labels and meshes."
    )
    refinement: RefinementOptions = Field(RefinementOptions(), description="Refinement of rigs on photos.")
