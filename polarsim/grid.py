"""Selection of photos of the photo grid of a site."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from pydantic import BaseModel, Field, field_validator

from polarsim.photo import NO_SUN, Azimuth, CameraSide, Light, PhotoKey, Terrain
from polarsim.site import Site


def text_values(value: object) -> object:
    """Convert values of the photo grid from YAML to text; raise ValueError for booleans."""
    if isinstance(value, bool):
        raise ValueError("YAML reads on, off, no as booleans: put them in quotes")
    if isinstance(value, (list, tuple)):
        return [text_values(part) for part in value]
    return str(value) if isinstance(value, int) else value


class GridOptions(BaseModel, extra="forbid", frozen=True):
    """Selection of the photos to label, render and evaluate; default: all photos of the grid."""

    lights: tuple[Light, ...] | None = Field(
        default=None,
        description="States of the rig's lamp: 'on', 'off' (in quotes, because YAML reads on as true); null: all.",
    )
    azimuths: tuple[Azimuth, ...] | None = Field(
        default=None,
        description="Azimuths of the Sun lamp, such as 'no', '30', '180', '270', '350' (in quotes); null: all.",
    )
    cameras: tuple[CameraSide, ...] | None = Field(
        default=None, description="Cameras: 'L' (left or only camera), 'R' (right); null: all."
    )
    exposures_ms: tuple[int, ...] | None = Field(
        default=None, description="Exposures of photos with a Sun lamp, ms; null: all."
    )
    exposures_no_sun_ms: tuple[int, ...] | None = Field(
        default=None, description="Exposures of photos without a Sun lamp, ms; null: all."
    )

    @field_validator("lights", "azimuths", mode="before")
    @classmethod
    def _words(cls, values: object) -> object:
        return text_values(values)

    def wrong_values(self, site: Site) -> Iterator[str]:
        """Return messages about selected values that the site does not have."""
        return site.wrong_choices(
            (
                ("lights", self.lights or (), site.lights),
                ("azimuths", self.azimuths or (), site.azimuths),
                ("cameras", self.cameras or (), site.cameras.sides),
                ("exposures_ms", self.exposures_ms or (), site.all_exposures_ms),
                ("exposures_no_sun_ms", self.exposures_no_sun_ms or (), site.exposures_no_sun_ms),
            )
        )


def selected_grid(site: Site, terrain: Terrain, positions: Sequence[str], grid: GridOptions) -> list[PhotoKey]:
    """Return the selected photos of a terrain in the order of the grid."""

    def wanted(key: PhotoKey) -> bool:
        exposures = grid.exposures_no_sun_ms if key.azimuth == NO_SUN else grid.exposures_ms
        return (
            key.position in positions
            and (grid.lights is None or key.light in grid.lights)
            and (grid.azimuths is None or key.azimuth in grid.azimuths)
            and (grid.cameras is None or key.camera in grid.cameras)
            and (exposures is None or key.exposure_ms in exposures)
        )

    return [key for key in site.photos_of(terrain) if wanted(key)]


def selected_grids(
    site: Site, terrains: Sequence[Terrain], positions: Sequence[str], grid: GridOptions
) -> list[PhotoKey]:
    """Return the selected photos of all terrains."""
    return [key for terrain in terrains for key in selected_grid(site, terrain, positions, grid)]
