"""Contact sheet of all exposure brackets of a station with labels, and all figures of the photos of a terrain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from polarsim.annotate.overlay import INK, LINK, PAPER, OverlayStyle, draw_labels, font
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.files import writing
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import (
    BOX_CLASSES,
    COLOURS,
    ROCK,
    SHADOW,
    PhotoKey,
    Terrain,
    by_bracket,
    terrain_text,
)
from polarsim.report.figures.canvas import COMPRESSION
from polarsim.report.figures.comparison import draw_comparison
from polarsim.run_files.pictures import pictures_at
from polarsim.site import Site
from polarsim.tone import to_uint8

ALWAYS_DOUBTFUL = 0.5  # a label with a lower confidence is always dashed
DOUBTFUL_SHARE = 0.1  # share of a terrain's labels with the lowest confidence, which are also dashed
MAX_BYTES = 1_500_000  # maximum size of a sheet; a report contains many
GREYS, SHADES = (96, 48, 24), 16  # palette: greys (the first number that meets `MAX_BYTES`), and shades of each colour
BLANK = 90  # grey of a tile without photo and twin
SHEET_WIDTH = 2400  # px; ids are legible with four tiles per row
_GAP = 6  # pixels between tiles


@dataclass(frozen=True)
class Tile:
    """An exposure bracket on the sheet: selected exposure, labels, and image file."""

    key: PhotoKey
    labels: pd.DataFrame
    picture: Path | None

    def title(self, doubtful_below: float) -> str:
        kinds = self.labels["kind"]
        counts = ", ".join(f"{int((kinds == kind).sum())} {kind}s" for kind in BOX_CLASSES)
        doubtful = int((self.labels["confidence"] < doubtful_below).sum())
        sun = f"Sun {self.key.azimuth}" if self.key.has_sun else "no Sun"
        light = f"{sun}, light {self.key.light}, {self.key.camera}, {self.key.exposure_ms} ms"
        return f"{light}: {counts}" + (f", {doubtful} dashed" if doubtful else "")


def draw_contact(
    *,
    site: Site,
    keys: Iterable[PhotoKey],
    labels: Path,
    pictures: Iterable[Path],
    figure: Path,
    width: int = SHEET_WIDTH,
) -> None:
    """Write the sheet: a row per Sun azimuth, a column per camera and state of the rover light.

    A tile shows the exposure with the most labels of a bracket (the nearest to the usual one if there are several).
    Labels are dashed if the confidence is below 0.5 or in the lowest tenth of the terrain. `pictures` are tables of
    photos and folders of twins in order of preference; a tile without an image is grey.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    sources = [pictures_at(folder) for folder in pictures]
    doubtful_below = doubtful_confidence(table["confidence"])
    usual = site.usual_exposure_ms
    shown = [most_labelled(exposures, table, usual) for exposures in by_bracket(keys).values()]
    tiles = [Tile(key, rows_of(table, key), _picture(sources, key)) for key in shown]
    _write(figure, _sheet(site, tiles, doubtful_below, width))


def _picture(sources: Iterable[Mapping[PhotoKey, Path]], key: PhotoKey) -> Path | None:
    return next((paths[key] for paths in sources if key in paths and paths[key].exists()), None)


def most_labelled(exposures: Sequence[PhotoKey], labels: pd.DataFrame, usual_exposure_ms: int) -> PhotoKey:
    """Return the exposure of a bracket with the most labels, the nearest to the usual one if there are several."""
    counts = labels["key"].value_counts()
    return min(exposures, key=lambda key: (-int(counts.get(str(key), 0)), key.stops_from(usual_exposure_ms), key))


def doubtful_confidence(confidences: pd.Series) -> float:
    """Return the confidence below which labels are dashed and should be checked first."""
    lowest = float(confidences.quantile(DOUBTFUL_SHARE)) if len(confidences) else 0.0
    return max(lowest, ALWAYS_DOUBTFUL)


def _sheet(site: Site, tiles: Sequence[Tile], doubtful_below: float, width: int) -> Any:
    """Return an image with the tiles in rows and columns, their titles, and a legend at the bottom."""
    from PIL import Image, ImageDraw

    rows = [azimuth for azimuth in site.azimuths if any(tile.key.azimuth == azimuth for tile in tiles)]
    columns = [
        (light, camera)
        for light in site.lights
        for camera in site.cameras.sides
        if any((tile.key.light, tile.key.camera) == (light, camera) for tile in tiles)
    ]
    tile_width = (width - _GAP) // max(len(columns), 1) - _GAP
    letters = font(max(10, tile_width // 36))
    title_height = round(1.6 * letters.size)
    row_height = round(tile_width * site.images.height / site.images.width) + title_height + _GAP
    sheet = Image.new("RGB", (width, _GAP + len(rows) * row_height + title_height), PAPER)
    pen = ImageDraw.Draw(sheet)
    for tile in tiles:
        x = _GAP + columns.index((tile.key.light, tile.key.camera)) * (tile_width + _GAP)
        y = _GAP + rows.index(tile.key.azimuth) * row_height
        pen.text((x, y + title_height // 2), tile.title(doubtful_below), fill=INK, font=letters, anchor="lm")
        sheet.paste(
            Image.fromarray(_tile_pixels(tile, tile_width, doubtful_below, site.images.size)), (x, y + title_height)
        )
    legend = _legend(tiles, doubtful_below)
    pen.text((_GAP, sheet.height - title_height // 2), legend, fill=INK, font=letters, anchor="lm")
    return sheet


def _legend(tiles: Sequence[Tile], doubtful_below: float) -> str:
    stations = sorted({tile.key.station for tile in tiles})
    name = ", ".join(f"Terrain {terrain_text(terrain)}, position {position}" for terrain, position in stations)
    marks = "Labels; yellow: rocks with ids; blue: shadows with a line to the rock"
    return f"{name}. {marks}; dashed: confidence below {doubtful_below:.2f}"


def _tile_pixels(tile: Tile, width: int, doubtful_below: float, size: tuple[int, int]) -> np.ndarray:
    if tile.picture is not None and tile.picture.exists():
        pixels = to_uint8(png.read_png(tile.picture))
    else:
        pixels = np.full(size[::-1], BLANK, np.uint8)
    marks = OverlayStyle(
        links=True, stated_below=0, doubtful_below=doubtful_below, letter_px=max(10, round(width / 42))
    )
    return draw_labels(pixels, tile.labels, width, marks)


def _write(path: Path, sheet: Any) -> None:
    """Write the sheet as a PNG with a palette of greys and label colours, a third of the size of an RGB PNG."""
    red, green, blue = (np.asarray(channel, np.int32) for channel in sheet.split())
    coded = red << 16 | green << 8 | blue
    used = np.zeros(1 << 24, bool)
    used[coded] = True
    codes = np.flatnonzero(used)
    place = np.zeros(len(used), np.int32)
    place[codes] = np.arange(len(codes))
    indices = place[coded]  # a twentieth of the time of `np.unique`
    colours = codes[:, None] >> [16, 8, 0] & 255
    for greys in GREYS:
        content = _coded(colours, indices, _palette(greys))
        if len(content) <= MAX_BYTES:
            break
    with writing(path) as temporary:
        temporary.write_bytes(content)


def _coded(colours: np.ndarray, indices: np.ndarray, palette: np.ndarray) -> bytes:
    """Return a PNG with the nearest palette colours; `indices` (h, w) index the image's `colours` (n, 3)."""
    from PIL import Image

    _, nearest = cKDTree(palette).query(colours)
    picture, content = Image.fromarray(np.asarray(nearest, np.uint8)[indices]), BytesIO()
    picture.putpalette(palette.ravel().tolist())
    picture.save(content, "PNG", compress_level=COMPRESSION)
    return content.getvalue()


def _palette(count: int) -> np.ndarray:
    """Return a palette (n, 3) int: `count` greys, and shades of each label colour for the antialiased text outlines."""
    greys = np.repeat(np.linspace(0, 255, count)[:, None], 3, axis=1)
    steps = np.linspace(0, 1, SHADES + 1)[1:, None]
    return np.round(
        np.concatenate([greys, *(steps * colour for colour in (COLOURS[ROCK], COLOURS[SHADOW], LINK))])
    ).astype(int)


def draw_photos(
    *,
    site: Site,
    terrain: Terrain,
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
        keys = selected_grid(site, terrain, [position], grid)
        draw_comparison(
            key=shown_photo(keys, site),
            photos=photos,
            inventory=inventory,
            twins=twins,
            labels=labels,
            rendered=rendered,
            figure=comparison,
            size=site.images.size,
        )
        draw_contact(site=site, keys=keys, labels=labels, pictures=sources, figure=contact)


def shown_photo(keys: Sequence[PhotoKey], site: Site) -> PhotoKey:
    """Return the photo of a position with the first Sun lamp, rig lamp off, camera L and near the usual exposure.

    Without such a photo, the nearest in this order is returned.
    """
    first, usual = site.suns[:1], site.usual_exposure_ms
    return min(keys, key=lambda key: (key.azimuth not in first, key.light, key.camera, key.stops_from(usual)))
