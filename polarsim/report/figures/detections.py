"""Figures of the predictions of a detector: photos and twins (figures 4 and 5 of the paper), and crops of rocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.annotate.show import rows_of
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.geometry import boxes
from polarsim.photo import HEIGHT, HEX_COLOURS, NO_ROCK, ROCK, WIDTH, PhotoKey
from polarsim.report import paper
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, figure_title, note, page, rectangle, show_image
from polarsim.run_files.pictures import picture_finder
from polarsim.schemas.detect import INSTANCES, PREDICTIONS
from polarsim.schemas.photos import BOX
from polarsim.tone import to_8bit

ROCKS_PER_SIDE = 2  # rocks with larger IoU in the first domain of a pair, and in the second domain
PHOTOS = 2  # columns, of different terrains
PREDICTED = (0, 229, 255)  # colour of predicted boxes
_LABEL, _PREDICTED = HEX_COLOURS[ROCK], "#{:02x}{:02x}{:02x}".format(*PREDICTED)
_TITLE_PX = 50


@dataclass(frozen=True)
class RockShown:
    """A rock in an image of a domain: label, best prediction and IoU."""

    key: str
    rock: int
    domain: str
    label: np.ndarray  # (4,) px
    predicted: np.ndarray | None  # (4,) prediction with the largest IoU, px
    iou: float


def draw_detector_results(
    *,
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
    picture_of = picture_finder(photo_domain, pictures)
    for number, trained in enumerate(domains):
        of_detector = predictions[number * len(domains) : (number + 1) * len(domains)]
        results = read_detector_results(
            trained,
            origin["source"],
            instances=instances,
            predictions=dict(zip(domains, of_detector, strict=True)),
            labels=labels,
            picture_of=picture_of,
            confidence=float(confidence.iloc[0]) if len(confidence) else 0.0,
        )
        draw_predictions(results, seen[number])
        draw_gap_rocks(results, gap_rocks[number])


def draw_gap_rocks(results: DetectorResults, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of one detector: a row per pair of domains, two crops per rock with label and best prediction.

    Rocks are selected by the mean difference of IoU over photos, and shown in the photo with the largest difference.
    """
    table = results.instances[results.instances["rock"] > 0]
    rows = []
    for pair in combinations(results.predictions, 2):
        first, second = (table[table["evaluated"] == domain] for domain in pair)
        chosen = most_different(first, second, ROCKS_PER_SIDE)
        rows.append([[_rock_shown(results, domain, key, rock) for domain in pair] for key, rock in chosen])
    cell = width / (4 * ROCKS_PER_SIDE)
    with page(figure, width, round(len(rows) * (cell + 50) + 50)) as sheet:
        if not any(rows):
            note(sheet, "no rock with different IoU in two domains")
            return
        name = f"Rocks with the largest difference of IoU, detector trained on {results.title(results.trained)}"
        figure_title(sheet, f"{name} (yellow: label, blue: prediction, number: IoU)")
        sheet.get_layout_engine().set(wspace=0.01, hspace=0.1)
        grid = sheet.subplots(len(rows), 4 * ROCKS_PER_SIDE, squeeze=False)
        for axes in grid.ravel():
            axes.set_axis_off()
        for cells, rocks in zip(grid, rows, strict=True):
            for number, shown in enumerate(rocks):
                _draw_rock(cells[2 * number : 2 * number + 2], shown, results)


def most_different(first: pd.DataFrame, second: pd.DataFrame, count: int) -> list[tuple[str, int]]:
    """Return key and id of `count` rocks with larger IoU in the first domain, then of `count` in the second.

    The tables are rows of the instance table of each domain (key, rock, iou). The key is that of the photo in which the
    rock has the largest difference.
    """
    sides = [table.groupby(["key", "rock"])["iou"].max() for table in (first, second)]
    gain = pd.concat(sides, axis=1, join="inner", keys=["first", "second"])
    gain = (gain["first"] - gain["second"]).rename("gain").reset_index()
    gain["terrain"] = [PhotoKey.parse(str(key)).terrain for key in gain["key"]]
    chosen = []
    for sign in (1, -1):
        signed = gain.assign(gain=(sign * gain["gain"]).round(9))
        means = signed.groupby(["terrain", "rock"])["gain"].mean().reset_index()
        means = means[means["gain"] > 0].sort_values(["gain", "terrain", "rock"], ascending=[False, True, True])
        for terrain, rock in means[["terrain", "rock"]].iloc[:count].itertuples(index=False):
            photos = signed[(signed["terrain"] == terrain) & (signed["rock"] == rock)]
            best = photos.sort_values(["gain", "key"], ascending=[False, True], kind="stable").iloc[0]
            chosen.append((str(best["key"]), int(rock)))
    return chosen


def _rock_shown(results: DetectorResults, domain: str, key: str, rock: int) -> RockShown:
    """Return the pair of label and prediction of a rock with the largest IoU."""
    labels, predictions = results.labels[domain], results.predictions[domain]
    of_rock = labels[(labels["key"] == key) & (labels["kind"] == ROCK) & (labels["rock"] == rock)]
    label = boxes.clip(of_rock[list(BOX.each)].to_numpy(float))
    predicted = predictions.loc[predictions["key"] == key, list(BOX.each)].to_numpy(float)
    if not len(predicted):
        return RockShown(key, rock, domain, label[0], None, 0.0)
    overlap = boxes.iou(label, predicted)
    row, column = np.unravel_index(overlap.argmax(), overlap.shape)
    best = float(overlap[row, column])
    return RockShown(key, rock, domain, label[row], predicted[column] if best > 0 else None, best)


def _draw_rock(cells: Any, shown: list[RockShown], results: DetectorResults) -> None:
    """Draw two crops of the same window, each with a separate white level, as twins may be much darker than photos."""
    reach = boxes.box_around_points(np.concatenate([rock.label.reshape(2, 2) for rock in shown]))
    half = min(max(60.0, 1.1 * float((reach[2:] - reach[:2]).max())), HEIGHT / 2)
    centre = np.clip((reach[:2] + reach[2:]) / 2, half, [WIDTH - half, HEIGHT - half])
    key = PhotoKey.parse(shown[0].key)
    for axes, rock in zip(cells, shown, strict=True):
        path = results.picture_of(rock.domain, key)
        axes.set_title(f"{results.title(rock.domain)} {rock.iou:.2f}", fontsize="small")
        if path is None or not path.exists():
            axes.text(0.5, 0.5, "no image", transform=axes.transAxes, ha="center", color=FAINT)
            continue
        (left, top), side = np.floor(centre - half).astype(int), int(2 * half)
        crop = png.read_png(path)[top : top + side, left : left + side]
        extent = (left, left + crop.shape[1], top + crop.shape[0], top)
        axes.imshow(to_8bit(crop), extent=extent, interpolation="antialiased")
        if rock.predicted is not None:
            rectangle(axes, rock.predicted, _PREDICTED, linestyle="--", linewidth=2)
        rectangle(axes, rock.label, _LABEL, linewidth=2)
        axes.set_xlim(*extent[:2])
        axes.set_ylim(*extent[2:])
    text, style = f"{key}, rock {shown[0].rock}", {"va": "top", "fontsize": "x-small", "color": FAINT}
    name = cells[0].text(0, -0.03, text, transform=cells[0].transAxes, **style)
    name.set_in_layout(False)  # the text extends below the second crop


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
