"""Figure of a detector's predictions in photos and twins, with labels, as figures 4 and 5 of the paper."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import HEIGHT, NO_ROCK, ROCK, WIDTH, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, note, page, show_image
from polarsim.schemas.detect import INSTANCES, PREDICTIONS
from polarsim.tone import to_8bit

PHOTOS = 2  # columns, of different terrains
PREDICTED = (0, 229, 255)  # colour of predicted boxes
_TITLE_PX = 50


@dataclass(frozen=True)
class DetectorResults:
    """Predictions of a detector and labels by evaluated domain, in the paper's order of domains."""

    trained: str  # training domain
    source: str  # of the run's photos
    instances: pd.DataFrame  # labelled rocks of the test photos
    predictions: dict[str, pd.DataFrame]  # rocks only, above the minimum confidence
    labels: dict[str, pd.DataFrame]
    picture_of: Callable[[str, PhotoKey], Path | None]  # image of a domain and a key

    def title(self, domain: str) -> str:
        """Return the name of a domain in figures."""
        return paper.domain_title(paper.display_name(domain, self.source))


def read_detector_results(
    trained: str,
    source: str,
    *,
    instances: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    picture_of: Callable[[str, PhotoKey], Path | None],
    confidence: float,
) -> DetectorResults:
    """Read the instance table, and the predictions and labels of each domain."""
    table = read_parquet(instances, INSTANCES.columns)
    domains = sorted(predictions, key=paper.domain_rank)
    tables = {domain: read_parquet(predictions[domain], PREDICTIONS.columns) for domain in domains}
    return DetectorResults(
        trained,
        source,
        table[(table["trained"] == trained) & (table["kind"] == ROCK)],
        {name: rows[(rows["kind"] == ROCK) & (rows["confidence"] >= confidence)] for name, rows in tables.items()},
        {domain: read_parquet(labels[domain], LABEL_COLUMNS) for domain in domains},
        picture_of,
    )


def draw_predictions(results: DetectorResults, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of one detector: a row per domain, a column per test photo; white levels differ."""
    keys, domains = shown_keys(results.instances), list(results.predictions)
    column = width // max(1, len(keys))
    height = round(column * HEIGHT / WIDTH) + _TITLE_PX
    with page(figure, width, height * max(1, len(domains)) if keys else 300) as sheet:
        if not keys:
            note(sheet, "no test photo has a labelled rock in every domain")
            return
        grid = sheet.subplots(len(domains), len(keys), squeeze=False)
        for row, domain in enumerate(domains):
            predicted, name = results.predictions[domain], results.title(domain)
            for axes, key in zip(grid[row], keys, strict=True):
                path = results.picture_of(domain, key)
                if path is None or not path.exists():
                    axes.set_axis_off()
                    note(axes.figure, f"{name}: no image of {key}")
                    continue
                labels, boxes = rows_of(results.labels[domain], key), predicted[predicted["key"] == str(key)]
                show_image(axes, _with_boxes(to_8bit(png.read_png(path)), labels, boxes, column), f"{name}, {key}")


def shown_keys(instances: pd.DataFrame) -> list[PhotoKey]:
    """Return at most `PHOTOS` test photos of different terrains.

    Preferred are photos with the Sun lamp on, the rover light off, an exposure near 256 ms, the left camera and many
    rocks. `instances` has the rows (`evaluated`, `key`, `rock`) of the labelled rocks in each domain; a photo needs a
    labelled rock in every domain.
    """
    with_id = instances[instances["rock"] != NO_ROCK]
    labelled = with_id.groupby(["key", "evaluated"])["rock"].nunique().reset_index().groupby("key")["rock"]
    in_all_domains = labelled.count() == instances["evaluated"].nunique()
    counts = labelled.min()[in_all_domains]
    chosen: dict[int, PhotoKey] = {}  # best photo of each terrain, best first
    for *_, key in sorted(_order(PhotoKey.parse(str(key)), int(number)) for key, number in counts.items()):
        chosen.setdefault(key.terrain, key)
    return sorted(list(chosen.values())[:PHOTOS])


def _order(key: PhotoKey, rocks: int) -> tuple[bool, bool, float, bool, int, PhotoKey]:
    return key.azimuth == "no", key.light == "on", key.stops_off_usual, key.camera == "R", -rocks, key


def _with_boxes(pixels: np.ndarray, labels: pd.DataFrame, predicted: pd.DataFrame, width: int) -> np.ndarray:
    """Return the scaled image (h', width, 3) uint8 with predicted boxes and, above them, rock labels with ids."""
    from PIL import Image, ImageDraw

    size = (width, round(width * pixels.shape[0] / pixels.shape[1]))
    image = Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS)
    pen, line, scale = ImageDraw.Draw(image), max(1, round(width / 500)), width / WIDTH
    margin = np.array([-1, -1, 1, 1]) * (line + 1)  # keeps the box of a perfect prediction visible around the label
    for box in predicted[["x0", "y0", "x1", "y1"]].to_numpy(float) * scale + margin:
        pen.rectangle([float(edge) for edge in box], outline=PREDICTED, width=line)
    return draw_labels(np.asarray(image), labels, width, OverlayStyle((ROCK,), confidences=False))
