"""All figures of the photos, twins and labels of one terrain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log2
from pathlib import Path

from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import REFERENCE_EXPOSURE_MS, PhotoKey
from polarsim.report.figures.comparison import draw_comparison
from polarsim.report.figures.contact import draw_contact


def draw_photos(
    *,
    terrain: int,
    positions: Sequence[str],
    grid: GridOptions,
    photos: Path,
    inventory: Path,
    twins: Mapping[str, Path],
    stand_ins: Sequence[str],
    labels: Path,
    rendered: Path,
    comparisons: Sequence[Path],
    contacts: Sequence[Path],
) -> None:
    """Draw a comparison of a photo with the twins and a contact sheet for each position.

    `stand_ins` are reflectance models whose twins replace missing photos. Figures are in the order of `positions`.
    """
    sources = [photos, *(twins[model] for model in stand_ins)]
    for position, comparison, contact in zip(positions, comparisons, contacts, strict=True):
        keys = selected_grid(terrain, [position], grid)
        draw_comparison(
            key=shown_photo(keys),
            photos=photos,
            inventory=inventory,
            twins=twins,
            labels=labels,
            rendered=rendered,
            figure=comparison,
        )
        draw_contact(keys=keys, labels=labels, pictures=sources, figure=contact)


def shown_photo(keys: Sequence[PhotoKey]) -> PhotoKey:
    """Return the photo of a position with Sun azimuth 30, rover light off, camera L and near 256 ms, if available."""

    def rank(key: PhotoKey) -> tuple[bool, str, str, float]:
        return key.azimuth != "30", key.light, key.camera, abs(log2(key.exposure_ms / REFERENCE_EXPOSURE_MS))

    return min(keys, key=rank)
