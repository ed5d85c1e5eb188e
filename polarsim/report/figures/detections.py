"""Figures of the predictions of a detector in photos and twins, figure 4 of the paper."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.photo import NO_ROCK, ROCK, PhotoKey, Terrain
from polarsim.report.figures.canvas import (
    BOX_LEGEND,
    FIGURE_WIDTH,
    PREDICTED,
    box_legend,
    note,
    page,
    rgb,
    show_image,
)
from polarsim.report.figures.detector_results import DetectorResults, read_detector_results
from polarsim.report.figures.gap_rocks import draw_gap_rocks
from polarsim.run_files.pictures import picture_finder
from polarsim.site import Site
from polarsim.tone import to_8bit

PHOTOS = 2  # columns, of different terrains
_TITLE_PX, _LEGEND_PX = 50, 50
_PICTURES = 48  # number of images in memory, which several figures show


def draw_detector_results(
    *,
    site: Site,
    domains: Sequence[str],
    photo_domain: str,
    pictures: Iterable[Path],
    instances: Path,
    ipd: Path,
    predictions: Sequence[Path],
    labels: Mapping[str, Path],
    seen: Sequence[Path],
    gap_rocks: Sequence[Path],
    origin: dict[str, str],
) -> None:
    """Write both figures of the detector of each domain, with the minimum confidence of the IPD.

    `predictions` are the tables of the first detector in all domains, then those of the second, and so on. `pictures`
    are tables of photos and folders of twins, see `picture_finder`.
    """
    confidence = read_parquet(ipd, ["confidence"])["confidence"]
    picture_of, read = picture_finder(photo_domain, pictures), lru_cache(_PICTURES)(png.read_png)

    def pixels_of(domain: str, key: PhotoKey) -> np.ndarray | None:
        path = picture_of(domain, key)
        return read(path) if path is not None and path.exists() else None

    for number, trained in enumerate(domains):
        of_detector = predictions[number * len(domains) : (number + 1) * len(domains)]
        results = read_detector_results(
            trained,
            origin["source"],
            instances=instances,
            predictions=dict(zip(domains, of_detector, strict=True)),
            labels=labels,
            pixels_of=pixels_of,
            confidence=float(confidence.iloc[0]) if len(confidence) else 0.0,
        )
        draw_predictions(site, results, seen[number])
        draw_gap_rocks(site, results, gap_rocks[number])


def draw_predictions(site: Site, results: DetectorResults, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of one detector: a row per domain, a column per test photo; white levels differ."""
    keys, domains = shown_keys(results.instances, site.usual_exposure_ms), list(results.predictions)
    column = width // max(1, len(keys))
    height = round(column * site.images.height / site.images.width) + _TITLE_PX
    with page(figure, width, height * max(1, len(domains)) + _LEGEND_PX if keys else 300) as sheet:
        if not keys:
            note(sheet, "no test photo has a labelled rock in every domain")
            return
        box_legend(sheet, BOX_LEGEND)
        grid = sheet.subplots(len(domains), len(keys), squeeze=False)
        for row, domain in enumerate(domains):
            predicted, name = results.predictions[domain], results.title(domain)
            for axes, key in zip(grid[row], keys, strict=True):
                pixels = results.pixels_of(domain, key)
                if pixels is None:
                    axes.set_axis_off()
                    note(axes.figure, f"{name}: no image of {key}")
                    continue
                labels, boxes = rows_of(results.labels[domain], key), predicted[predicted["key"] == str(key)]
                show_image(axes, _with_boxes(to_8bit(pixels), labels, boxes, column), f"{name}, {key}")


def shown_keys(instances: pd.DataFrame, usual_exposure_ms: int) -> list[PhotoKey]:
    """Return at most `PHOTOS` test photos of different terrains.

    Preferred are photos with the Sun lamp on, the rover light off, an exposure near the usual one, the left camera and
    many rocks. `instances` has the rows (`evaluated`, `key`, `rock`) of the labelled rocks in each domain; a photo
    needs a labelled rock in every domain.
    """
    with_id = instances[instances["rock"] != NO_ROCK]
    labelled = with_id.groupby(["key", "evaluated"])["rock"].nunique().reset_index().groupby("key")["rock"]
    in_all_domains = labelled.count() == instances["evaluated"].nunique()
    counts = labelled.min()[in_all_domains]
    chosen: dict[Terrain, PhotoKey] = {}  # best photo of each terrain, best first
    ranked = (_order(PhotoKey.parse(str(key)), int(number), usual_exposure_ms) for key, number in counts.items())
    for *_, key in sorted(ranked):
        chosen.setdefault(key.terrain, key)
    return sorted(list(chosen.values())[:PHOTOS])


def _order(key: PhotoKey, rocks: int, usual_exposure_ms: int) -> tuple[bool, bool, float, bool, int, PhotoKey]:
    off = key.stops_from(usual_exposure_ms)
    return not key.has_sun, key.light == "on", off, key.camera == "R", -rocks, key


def _with_boxes(pixels: np.ndarray, labels: pd.DataFrame, predicted: pd.DataFrame, width: int) -> np.ndarray:
    """Return the scaled image (h', width, 3) uint8 with predicted boxes and, above them, rock labels with ids."""
    from PIL import Image, ImageDraw

    size = (width, round(width * pixels.shape[0] / pixels.shape[1]))
    image = Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS)
    pen, line, scale = ImageDraw.Draw(image), max(1, round(width / 500)), width / pixels.shape[1]
    margin = np.array([-1, -1, 1, 1]) * (line + 1)  # keeps the box of a perfect prediction visible around the label
    for box in predicted[["x0", "y0", "x1", "y1"]].to_numpy(float) * scale + margin:
        pen.rectangle([float(edge) for edge in box], outline=rgb(PREDICTED), width=line)
    return draw_labels(
        np.asarray(image), labels, width, OverlayStyle((ROCK,), stated_below=0), photo_width=pixels.shape[1]
    )
