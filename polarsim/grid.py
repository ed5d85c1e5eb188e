"""The part of NASA's photo grid that a run works on."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, Field, field_validator

from polarsim.photo import AZIMUTHS, CAMERAS, LIGHTS, Azimuth, CameraSide, Light, PhotoKey, is_exposure, photo_grid


def as_text(value: object) -> object:
    """Words of the photo grid as YAML hands them over, for a validator: numbers become text, booleans are refused."""
    if isinstance(value, bool):
        raise ValueError("YAML reads on, off, no as booleans: put them in quotes")
    if isinstance(value, (list, tuple)):
        return [as_text(one) for one in value]
    return str(value) if isinstance(value, int) else value


class GridOptions(BaseModel, extra="forbid", frozen=True):
    """These options say which photos of the grid are labelled, rendered and evaluated; the default is all of them."""

    lights: tuple[Light, ...] = Field(
        default=LIGHTS,
        description="Photos with the rover light 'on' or 'off' are used (quote them: YAML reads on as true).",
    )
    azimuths: tuple[Azimuth, ...] = Field(
        default=AZIMUTHS,
        description="Photos under these Sun lamps are used: 'no', '30', '180', '270', '350' (quote them).",
    )
    cameras: tuple[CameraSide, ...] = Field(
        default=CAMERAS, description="Photos of these cameras are used: 'L' (left), 'R' (right)."
    )
    exposures_ms: tuple[int, ...] | None = Field(
        default=None, description="Photos under a Sun lamp with these exposures are used, ms; null takes all."
    )
    exposures_no_sun_ms: tuple[int, ...] | None = Field(
        default=None, description="Photos without a Sun lamp with these exposures are used, ms; null takes all."
    )

    @field_validator("lights", "azimuths", mode="before")
    @classmethod
    def _words(cls, values: object) -> object:
        return as_text(values)

    @field_validator("exposures_ms", "exposures_no_sun_ms")
    @classmethod
    def _known_exposures(cls, values: tuple[int, ...] | None) -> tuple[int, ...] | None:
        for value in values or ():
            if not is_exposure(value):
                raise ValueError(f"exposure {value} ms, expected 16, 32, 64 ... 8192")
        return values


def selected_grid(terrain: int, positions: Sequence[str], grid: GridOptions) -> list[PhotoKey]:
    """The photos of a terrain that a run works on, in the grid's order."""

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
    """The photos of all terrains that a run works on."""
    return [key for terrain in terrains for key in selected_grid(terrain, positions, grid)]
