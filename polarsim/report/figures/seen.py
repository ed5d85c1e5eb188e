"""What one detector finds: photo and twins in rows, as the paper's figures 4 and 5, labels with rock ids drawn in."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import Marks, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.photo import HEIGHT, NO_ROCK, ROCK, WIDTH, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import FIGURE_WIDTH, note, page, picture
from polarsim.schemas.detect import INSTANCES, PREDICTIONS
from polarsim.tone import to_8bit

PHOTOS = 2  # side by side, of different terrains where there are
FOUND = (0, 229, 255)  # of predicted boxes
_TITLE_PX = 50


@dataclass(frozen=True)
class Finds:
    """What one detector finds in the domains that it was evaluated on, in the paper's order of these."""

    trained: str  # its own domain
    source: str  # of the run's photos
    instances: pd.DataFrame  # the rocks that it was evaluated on: their keys are those of the test
    predictions: dict[str, pd.DataFrame]  # rocks alone, none below the least confidence
    labels: dict[str, pd.DataFrame]
    picture_of: Callable[[str, PhotoKey], Path | None]  # photo or twin of a domain and a key

    def title(self, domain: str) -> str:
        """A domain's name in figures."""
        return paper.domain_title(paper.display_name(domain, self.source))


def read_finds(
    trained: str,
    source: str,
    *,
    instances: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    picture_of: Callable[[str, PhotoKey], Path | None],
    confidence: float,
) -> Finds:
    """Read the instance table, and predictions and labels of each domain."""
    table = read_parquet(instances, INSTANCES.columns)
    domains = sorted(predictions, key=paper.domain_rank)
    found = {domain: read_parquet(predictions[domain], PREDICTIONS.columns) for domain in domains}
    return Finds(
        trained,
        source,
        table[(table["trained"] == trained) & (table["kind"] == ROCK)],
        {name: rows[(rows["kind"] == ROCK) & (rows["confidence"] >= confidence)] for name, rows in found.items()},
        {domain: read_parquet(labels[domain], LABEL_COLUMNS) for domain in domains},
        picture_of,
    )


def draw_seen(finds: Finds, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of one detector: a row a domain, a column a test photo; each picture has its own white."""
    keys, domains = shown_keys(finds.instances), list(finds.predictions)
    column = width // max(1, len(keys))
    height = round(column * HEIGHT / WIDTH) + _TITLE_PX
    with page(figure, width, height * max(1, len(domains)) if keys else 300) as sheet:
        if not keys:
            note(sheet, "no test photo has a labelled rock in every domain")
            return
        grid = sheet.subplots(len(domains), len(keys), squeeze=False)
        for row, domain in enumerate(domains):
            found, name = finds.predictions[domain], finds.title(domain)
            for axes, key in zip(grid[row], keys, strict=True):
                path = finds.picture_of(domain, key)
                if path is None or not path.exists():
                    axes.set_axis_off()
                    note(axes.figure, f"{name}: no picture of {key}")
                    continue
                labels, own = rows_of(finds.labels[domain], key), found[found["key"] == str(key)]
                picture(axes, _with_boxes(to_8bit(png.read(path)), labels, own, column), f"{name}, {key}")


def shown_keys(instances: pd.DataFrame) -> list[PhotoKey]:
    """Test photos that show most: Sun lamp on, rover light off, near 256 ms, Left, with many rocks; one a terrain.

    Of rows of the rocks that a detector was evaluated on in each domain (`evaluated`, `key`, `rock`); only photos that
    have a labelled rock in all of them count. Where there are fewer terrains than `PHOTOS`, there are fewer photos.
    """
    known = instances[instances["rock"] != NO_ROCK]
    labelled = known.groupby(["key", "evaluated"])["rock"].nunique().reset_index().groupby("key")["rock"]
    everywhere = labelled.count() == instances["evaluated"].nunique()
    counts = labelled.min()[everywhere]
    chosen: dict[int, PhotoKey] = {}  # the best of each terrain, best first
    for *_, key in sorted(_order(PhotoKey.parse(str(key)), int(number)) for key, number in counts.items()):
        chosen.setdefault(key.terrain, key)
    return sorted(list(chosen.values())[:PHOTOS])


def _order(key: PhotoKey, rocks: int) -> tuple[bool, bool, float, bool, int, PhotoKey]:
    return key.azimuth == "no", key.light == "on", key.stops_off_usual, key.camera == "R", -rocks, key


def _with_boxes(pixels: np.ndarray, labels: pd.DataFrame, found: pd.DataFrame, width: int) -> np.ndarray:
    """(h', width, 3) uint8: predicted boxes just outside of what they enclose, rock labels with their ids over them."""
    from PIL import Image, ImageDraw

    size = (width, round(width * pixels.shape[0] / pixels.shape[1]))
    image = Image.fromarray(pixels).resize(size, Image.Resampling.LANCZOS)
    pen, line, scale = ImageDraw.Draw(image), max(1, round(width / 500)), width / WIDTH
    beside = np.array([-1, -1, 1, 1]) * (line + 1)  # a right box would hide the label's
    for box in found[["x0", "y0", "x1", "y1"]].to_numpy(float) * scale + beside:
        pen.rectangle([float(edge) for edge in box], outline=FOUND, width=line)
    return draw_labels(np.asarray(image), labels, width, Marks((ROCK,), confidences=False))
