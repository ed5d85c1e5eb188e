"""Figures of a detector's predictions: photo and twins, and crops of rocks with different IoU in two domains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import png
from polarsim.formats.tables import read_parquet
from polarsim.geometry import boxes
from polarsim.photo import HEIGHT, HEX_COLOURS, ROCK, WIDTH, PhotoKey
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, figure_title, note, page, rectangle
from polarsim.report.figures.detection_grid import DetectorResults, draw_predictions, read_detector_results
from polarsim.run_files.pictures import picture_finder
from polarsim.schemas.photos import BOX
from polarsim.tone import to_8bit

ROCKS_PER_SIDE = 2  # rocks with larger IoU in the first domain of a pair, and in the second domain
_LABEL, _PREDICTED = HEX_COLOURS[ROCK], "#00e5ff"


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
