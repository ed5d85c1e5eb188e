"""Figure of the rocks with the largest difference of IoU between two domains, figure 5 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.geometry import boxes
from polarsim.photo import HEX_COLOURS, ROCK, PhotoKey
from polarsim.report.figures.canvas import (
    BOX_LEGEND,
    FAINT,
    FIGURE_WIDTH,
    PREDICTED,
    box_legend,
    figure_title,
    note,
    page,
    rectangle,
)
from polarsim.report.figures.detector_results import DetectorResults
from polarsim.schemas.photos import BOX
from polarsim.site import Site
from polarsim.tone import to_8bit

ROCKS_PER_SIDE = 2  # rocks with larger IoU in the first domain of a pair, and in the second domain
NEAR_LARGEST = 0.7  # minimum difference of IoU in the shown photo, relative to the largest difference of the rock
CANDIDATES = 3  # maximum number of photos of a rock that are read to find a well exposed one
CONTRAST = 40  # minimum range of the grey values of a crop from the 5th to the 95th percentile
MIN_RANGE = 16  # minimum range of grey values that is stretched from black to white, so that noise stays faint
MAX_WHITE = 0.3  # maximum share of white pixels in a crop
_LEGEND_PX = 50


@dataclass(frozen=True)
class RockShown:
    """A rock in an image of a domain: label, best prediction and IoU."""

    key: str
    rock: int
    domain: str
    label: np.ndarray  # (4,) px
    predicted: np.ndarray | None  # (4,) prediction with the largest IoU, px
    iou: float


def draw_gap_rocks(site: Site, results: DetectorResults, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the figure of one detector: a row per pair of domains, two crops per rock with label and best prediction.

    Rocks are selected by the mean difference of IoU over photos, and shown in a photo with nearly the largest
    difference, preferably of a usual exposure in which the surroundings are neither black nor clipped.
    """
    table = results.instances[results.instances["rock"] > 0]
    rows = []
    for pair in combinations(results.predictions, 2):
        first, second = (table[table["evaluated"] == domain] for domain in pair)
        chosen = most_different(first, second, ROCKS_PER_SIDE, site.usual_exposure_ms)
        rows.append([_most_visible(results, pair, keys, rock, site.images.size) for keys, rock in chosen])
    cell = width / (4 * ROCKS_PER_SIDE)
    with page(figure, width, round(len(rows) * (cell + 50) + 50 + _LEGEND_PX) if any(rows) else 300) as sheet:
        if not any(rows):
            note(sheet, "no rock with different IoU in two domains")
            return
        name = f"Rocks with the largest difference of IoU, detector trained on {results.title(results.trained)}"
        figure_title(sheet, name)
        box_legend(sheet, BOX_LEGEND, dashed={"prediction"})
        sheet.get_layout_engine().set(wspace=0.01, hspace=0.1)
        grid = sheet.subplots(len(rows), 4 * ROCKS_PER_SIDE, squeeze=False)
        for axes in grid.ravel():
            axes.set_axis_off()
        for cells, rocks in zip(grid, rows, strict=True):
            for number, shown in enumerate(rocks):
                _draw_rock(cells[2 * number : 2 * number + 2], shown, results)


def most_different(
    first: pd.DataFrame, second: pd.DataFrame, count: int, usual_exposure_ms: int
) -> list[tuple[list[str], int]]:
    """Return keys and id of `count` rocks with larger IoU in the first domain, then of `count` in the second.

    The tables are rows of the instance table of each domain (key, rock, iou). The keys are those of the photos in which
    the rock has a difference of at least `NEAR_LARGEST` of its largest difference, usual exposures first.
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
            large = photos[photos["gain"] >= NEAR_LARGEST * photos["gain"].max()]
            ranked = sorted(
                (PhotoKey.parse(str(key)).stops_from(usual_exposure_ms), -gain, str(key))
                for key, gain in zip(large["key"], large["gain"], strict=True)
            )
            chosen.append(([key for *_, key in ranked], int(rock)))
    return chosen


def _most_visible(
    results: DetectorResults, pair: Sequence[str], keys: Sequence[str], rock: int, size: tuple[int, int]
) -> list[RockShown]:
    """Return a rock in the first photo whose crops are well exposed in both domains, or in the first photo."""
    for key in keys[:CANDIDATES]:
        shown = [_rock_shown(results, domain, key, rock, size) for domain in pair]
        crops = [_crop(results, side, shown) for side in shown]
        if all(crop is not None and is_well_exposed(crop[0]) for crop in crops):
            return shown
    return [_rock_shown(results, domain, keys[0], rock, size) for domain in pair]


def is_well_exposed(crop: np.ndarray) -> bool:
    """Return whether a displayed crop (h, w, 3) uint8 has visible contrast and is not mostly white."""
    low, high = np.percentile(crop[..., 0], [5, 95])
    return bool(high - low >= CONTRAST and (crop[..., 0] == 255).mean() <= MAX_WHITE)


def _stretched(crop: np.ndarray) -> np.ndarray:
    """Return a crop (h, w, 3) uint8 whose darkest pixels are black and whose brightest are white."""
    low, high = np.percentile(crop[..., 0], [0.5, 99.5])
    share = (crop - low) / max(high - low, MIN_RANGE)
    return np.rint(255 * share.clip(0, 1)).astype(np.uint8)


def _rock_shown(results: DetectorResults, domain: str, key: str, rock: int, size: tuple[int, int]) -> RockShown:
    """Return the pair of label and prediction of a rock with the largest IoU."""
    labels, predictions = results.labels[domain], results.predictions[domain]
    of_rock = labels[(labels["key"] == key) & (labels["kind"] == ROCK) & (labels["rock"] == rock)]
    label = boxes.clip(of_rock[list(BOX.each)].to_numpy(float), *size)
    predicted = predictions.loc[predictions["key"] == key, list(BOX.each)].to_numpy(float)
    if not len(predicted):
        return RockShown(key, rock, domain, label[0], None, 0.0)
    overlap = boxes.iou(label, predicted)
    row, column = np.unravel_index(overlap.argmax(), overlap.shape)
    best = float(overlap[row, column])
    return RockShown(key, rock, domain, label[row], predicted[column] if best > 0 else None, best)


def _crop(
    results: DetectorResults, rock: RockShown, shown: Sequence[RockShown]
) -> tuple[np.ndarray, tuple[int, int, int, int]] | None:
    """Return the surroundings of a rock (h, w, 3) uint8, and left, right, bottom and top; None without an image.

    All `shown` domains of a photo have the same window, each with a separate white level, as twins may be much darker
    than photos.
    """
    pixels = results.pixels_of(rock.domain, PhotoKey.parse(rock.key))
    if pixels is None:
        return None
    reach = boxes.box_around_points(np.concatenate([other.label.reshape(2, 2) for other in shown]))
    half = min(max(60.0, 1.1 * float((reach[2:] - reach[:2]).max())), pixels.shape[0] / 2)
    centre = np.clip((reach[:2] + reach[2:]) / 2, half, [pixels.shape[1] - half, pixels.shape[0] - half])
    left, top = np.floor(centre - half).astype(int).tolist()
    side = int(2 * half)
    crop = pixels[top : top + side, left : left + side]
    return to_8bit(crop), (left, left + crop.shape[1], top + crop.shape[0], top)


def _draw_rock(cells: Any, shown: list[RockShown], results: DetectorResults) -> None:
    for axes, rock in zip(cells, shown, strict=True):
        axes.set_title(f"{results.title(rock.domain)}, IoU {rock.iou:.2f}", fontsize="small")
        crop = _crop(results, rock, shown)
        if crop is None:
            axes.text(0.5, 0.5, "no image", transform=axes.transAxes, ha="center", color=FAINT)
            continue
        pixels, extent = crop
        axes.imshow(_stretched(pixels), extent=extent, interpolation="antialiased")
        if rock.predicted is not None:
            rectangle(axes, rock.predicted, PREDICTED, linestyle="--", linewidth=2)
        rectangle(axes, rock.label, HEX_COLOURS[ROCK], linewidth=2)
        axes.set_xlim(*extent[:2])
        axes.set_ylim(*extent[2:])
    text, style = f"{shown[0].key}, rock {shown[0].rock}", {"va": "top", "fontsize": "x-small", "color": FAINT}
    name = cells[0].text(0, -0.03, text, transform=cells[0].transAxes, **style)
    name.set_in_layout(False)  # the text extends below the second crop
