"""Strip of images of one photo for the results page: photo, twin, difference, labels, predictions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.files import write_json, writing_folder
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import COLOURS, ROCK, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import boxed
from polarsim.report.figures.difference import STOPS, difference_of_photo
from polarsim.run_files.pictures import STRIP_TEXT, pictures_at
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import Site
from polarsim.tone import display_white_level, to_8bit

PANEL_WIDTH = 960  # px
CONFIDENCE = 0.25  # minimum confidence of shown predictions
KINDS = "yellow: rocks, blue: shadows"
RED = f"red: twin too bright (saturated at {STOPS:g} stops), blue: too dark, grey: excluded (dark or clipped)"


def draw_strip(
    *,
    site: Site,
    photos: Path,
    twins: Path,
    labels: Path,
    predictions: Path | None,
    model: str,
    trained: str,
    strip: Path,
) -> None:
    """Write a PNG per panel of a terrain's strip, and `strip.json` with the photo key and the captions.

    Missing images, such as photos of the release, have no panel. `predictions` are of a detector whose training domain
    is `trained`, in test photos.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    photo_paths, twin_paths = pictures_at(photos), pictures_at(twins)
    predicted = None if predictions is None else read_parquet(predictions, PREDICTIONS.columns)
    key = shown_key(site, photo_paths or twin_paths, twin_paths, table, predicted)
    panels: dict[str, tuple[str, np.ndarray]] = {}
    if key is not None:
        sources = {"photo": photo_paths, "twin": twin_paths}
        pixels = {name: png.read_png(paths[key]) for name, paths in sources.items() if key in paths}
        white = display_white_level(next(iter(pixels.values())))
        shown = {name: to_8bit(values, white) for name, values in pixels.items()}
        titles = {"photo": "Photo", "twin": f"Twin, {model}"}
        panels = {name: (titles[name], draw_labels(values, table[:0], PANEL_WIDTH)) for name, values in shown.items()}
        if len(pixels) == 2:
            difference = difference_of_photo(pixels["photo"], pixels["twin"])
            panels["difference"] = (f"log2(twin / photo); {RED}", draw_labels(difference, table[:0], PANEL_WIDTH))
        background = next(iter(shown.values()))
        panels["labels"] = (
            f"Propagated labels; {KINDS}",
            draw_labels(background, rows_of(table, key), PANEL_WIDTH, _MARKS),
        )
        if predicted is not None and str(key) in set(predicted["key"]):
            name = paper.domain_title(trained)
            label = f"Predictions of the detector trained on {name}, confidence of at least {CONFIDENCE:g}; {KINDS}"
            panels["detections"] = (label, _with_predictions(background, predicted[predicted["key"] == str(key)]))
    with writing_folder(strip) as folder:
        for name, (_, image) in panels.items():
            png.write_png(folder / f"{name}.png", image)
        captions = {name: caption for name, (caption, _) in panels.items()}
        write_json(folder / STRIP_TEXT, {"key": str(key or ""), "panels": [list(item) for item in captions.items()]})


_MARKS = OverlayStyle(stated_below=0)


def shown_key(
    site: Site,
    pictures: dict[PhotoKey, Path],
    twins: dict[PhotoKey, Path],
    labels: pd.DataFrame,
    predicted: pd.DataFrame | None,
) -> PhotoKey | None:
    """Return the photo of the strip, or None without images.

    Preferred are photos with predictions, a twin, a Sun lamp, the rover light off, a usual exposure, the first lamp
    of the site, and large rocks.
    """
    tested = set() if predicted is None else set(predicted["key"])
    sides = (labels["x1"] - labels["x0"]) * (labels["y1"] - labels["y0"])
    areas = sides[labels["kind"] == ROCK].groupby(labels["key"]).sum()

    def rank(key: PhotoKey) -> tuple[bool, bool, bool, bool, float, bool, float, PhotoKey]:
        return (
            bool(tested) and str(key) not in tested,
            key not in twins,
            not key.has_sun,
            key.light == "on",
            key.stops_from(site.usual_exposure_ms),
            key.azimuth not in site.suns[:1],
            -float(areas.get(str(key), 0.0)),
            key,
        )

    available = [key for key in pictures if pictures[key].exists()]
    return min(available, key=rank, default=None)


def _with_predictions(pixels: np.ndarray, predicted: pd.DataFrame) -> np.ndarray:
    shown = predicted[predicted["confidence"] >= CONFIDENCE]
    boxes = shown[["x0", "y0", "x1", "y1"]].to_numpy(float)
    coloured = [(box, COLOURS[kind]) for box, kind in zip(boxes, shown["kind"], strict=True)]
    return boxed(np.ascontiguousarray(pixels[..., 0]), coloured, PANEL_WIDTH)
