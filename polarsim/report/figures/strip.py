"""One photo in a strip: as it was taken, its twin, how they differ, its labels, and what a detector finds in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import Marks, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.files import write_json, writing_folder
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import COLOURS, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import boxed
from polarsim.report.figures.difference import STOPS, difference_of_photo
from polarsim.run_files.pictures import STRIP_TEXT, pictures_at
from polarsim.schemas.detect import PREDICTIONS
from polarsim.tone import to_8bit, white_of

PANEL_WIDTH = 960  # px
CONFIDENCE = 0.25  # least one of a box that is shown
RED = f"red: twin too bright (full at {STOPS:g} stops), blue: too dark, grey: dark or clipped, left out"


def draw_strip(
    *, photos: Path, twins: Path, labels: Path, predictions: Path | None, model: str, trained: str, strip: Path
) -> None:
    """Write the folder of a terrain's strip: a PNG a panel, and `strip.json` with the key and what each panel is.

    What there is not, such as photos of the release, has no panel.

    Parameters
    ----------
    photos, twins, labels
        Table of the terrain's photos, folder of a model's twins, label table.
    predictions
        What a detector, `trained` on a domain, finds in photos that it was not trained on.
    """
    table = read_parquet(labels, LABEL_COLUMNS)
    taken, made = pictures_at(photos), pictures_at(twins)
    found = None if predictions is None else read_parquet(predictions, PREDICTIONS.columns)
    key = shown_key(taken or made, made, table, found)
    panels: dict[str, tuple[str, np.ndarray]] = {}
    if key is not None:
        pixels = {name: png.read(places[key]) for name, places in (("photo", taken), ("twin", made)) if key in places}
        white = white_of(next(iter(pixels.values())))
        shown = {name: to_8bit(values, white) for name, values in pixels.items()}
        titles = {"photo": "Photo", "twin": f"Twin, {model}"}
        panels = {name: (titles[name], draw_labels(values, table[:0], PANEL_WIDTH)) for name, values in shown.items()}
        if len(pixels) == 2:
            difference = difference_of_photo(pixels["photo"], pixels["twin"])
            panels["difference"] = (f"Twin over photo; {RED}", draw_labels(difference, table[:0], PANEL_WIDTH))
        below = next(iter(shown.values()))
        own = rows_of(table, key)
        panels["labels"] = (
            "Labels, propagated; yellow: rocks, blue: shadows",
            draw_labels(below, own, PANEL_WIDTH, _MARKS),
        )
        if found is not None and str(key) in set(found["key"]):
            label = f"What the detector trained on {paper.domain_title(trained)} finds, confidence from {CONFIDENCE:g}"
            panels["detections"] = (label, _with_finds(below, found[found["key"] == str(key)]))
    with writing_folder(strip) as folder:
        for name, (_, image) in panels.items():
            png.write(folder / f"{name}.png", image)
        captions = {name: caption for name, (caption, _) in panels.items()}
        write_json(folder / STRIP_TEXT, {"key": str(key or ""), "panels": [list(one) for one in captions.items()]})


_MARKS = Marks(confidences=False)


def shown_key(
    pictures: dict[PhotoKey, Path], twins: dict[PhotoKey, Path], labels: pd.DataFrame, found: pd.DataFrame | None
) -> PhotoKey | None:
    """The photo that shows most: one that a detector was tested on and that has a twin, many labels, a usual exposure.

    None where there is no picture.
    """
    tested = set() if found is None else set(found["key"])
    counts = labels["key"].value_counts()

    def rank(key: PhotoKey) -> tuple[bool, bool, bool, bool, float, int, PhotoKey]:
        unseen, usual = bool(tested) and str(key) not in tested, key.stops_off_usual
        return (
            unseen,
            key not in twins,
            key.azimuth == "no",
            key.light == "on",
            usual,
            -int(counts.get(str(key), 0)),
            key,
        )

    there = [key for key in pictures if pictures[key].exists()]
    return min(there, key=rank, default=None)


def _with_finds(pixels: np.ndarray, found: pd.DataFrame) -> np.ndarray:
    sure = found[found["confidence"] >= CONFIDENCE]
    boxes = sure[["x0", "y0", "x1", "y1"]].to_numpy(float)
    coloured = [(box, COLOURS[kind]) for box, kind in zip(boxes, sure["kind"], strict=True)]
    return boxed(np.ascontiguousarray(pixels[..., 0]), coloured, PANEL_WIDTH)
