"""Selection of photos of NASA's photo grid."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, Field, field_validator

from polarsim.photo import AZIMUTHS, CAMERAS, LIGHTS, Azimuth, CameraSide, Light, PhotoKey, is_exposure, photo_grid


def text_values(value: object) -> object:
    """Convert values of the photo grid from YAML to text; raise ValueError for booleans."""
    if isinstance(value, bool):
        raise ValueError("YAML reads on, off, no as booleans: put them in quotes")
    if isinstance(value, (list, tuple)):
        return [text_values(part) for part in value]
    return str(value) if isinstance(value, int) else value


class GridOptions(BaseModel, extra="forbid", frozen=True):
    """Selection of the photos to label, render and evaluate; default: all photos of the grid."""

    lights: tuple[Light, ...] = Field(
        default=LIGHTS,
        description="States of the rover light: 'on', 'off' (in quotes, because YAML reads on as true).",
    )
    azimuths: tuple[Azimuth, ...] = Field(
        default=AZIMUTHS,
        description="Azimuths of the Sun lamp: 'no', '30', '180', '270', '350' (in quotes).",
    )
    cameras: tuple[CameraSide, ...] = Field(default=CAMERAS, description="Cameras: 'L' (left), 'R' (right).")
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

    @field_validator("exposures_ms", "exposures_no_sun_ms")
    @classmethod
    def _known_exposures(cls, values: tuple[int, ...] | None) -> tuple[int, ...] | None:
        for value in values or ():
            if not is_exposure(value):
                raise ValueError(f"exposure {value} ms, expected 16, 32, 64 ... 8192")
        return values


def selected_grid(terrain: int, positions: Sequence[str], grid: GridOptions) -> list[PhotoKey]:
    """Return the selected photos of a terrain in the order of the grid."""

    def wanted(key: PhotoKey) -> bool:
        exposures = grid.exposures_no_sun_ms if key.azimuth == "no" else grid.exposures_ms
        return (
            key.position in positions
            and key.light in grid.lights
            and key.azimuth in grid.azimuths
            and key.camera in grid.cameras
            and (exposures is None or key.exposure_ms in exposures)
        )

    return [key for key in photo_grid(terrain) if wanted(key)]


def selected_grids(terrains: Sequence[int], positions: Sequence[str], grid: GridOptions) -> list[PhotoKey]:
    """Return the selected photos of all terrains."""
    return [key for terrain in terrains for key in selected_grid(terrain, positions, grid)]
