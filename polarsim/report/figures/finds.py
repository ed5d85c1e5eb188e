"""What one detector finds in photo and twins, and crops of the rocks that it finds most differently in two domains."""

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
from polarsim.report.figures.canvas import FAINT, FIGURE_WIDTH, heading, note, page, rectangle
from polarsim.report.figures.seen import Finds, draw_seen, read_finds
from polarsim.run_files.pictures import picture_finder
from polarsim.schemas.photos import BOX
from polarsim.tone import to_8bit

ROCKS_A_SIDE = 2  # of each pair of domains, that the detector finds better in the first, and in the second
_LABEL, _FOUND = HEX_COLOURS[ROCK], "#00e5ff"


@dataclass(frozen=True)
class RockShown:
    """One rock in one picture."""

    key: str
    rock: int
    domain: str
    label: np.ndarray  # (4,) px
    found: np.ndarray | None  # (4,) the box that overlaps it best
    iou: float


def draw_finds(
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
    """Write both figures of the detector of each domain; the minimum confidence of a prediction is that of the IPD.

    Parameters
    ----------
    predictions
        Of each detector in each domain, the domains of a detector in turn.
    photo_domain, pictures
        Tables of photos, the domain that they are of, and folders of twins: see `picture_finder`.
    """
    confidence = read_parquet(ipd, ["confidence"])["confidence"]
    picture_of = picture_finder(photo_domain, pictures)
    for number, trained in enumerate(domains):
        own = predictions[number * len(domains) : (number + 1) * len(domains)]
        finds = read_finds(
            trained,
            origin["source"],
            instances=instances,
            predictions=dict(zip(domains, own, strict=True)),
            labels=labels,
            picture_of=picture_of,
            confidence=float(confidence.iloc[0]) if len(confidence) else 0.0,
        )
        draw_seen(finds, seen[number])
        draw_gap_rocks(finds, gap_rocks[number])


def draw_gap_rocks(finds: Finds, figure: Path, width: int = FIGURE_WIDTH) -> None:
    """Write the page of one detector: a row a pair of domains, two crops a rock, label and best box drawn in.

    Rocks are chosen by their mean difference over photos, and shown in the photo in which they differ most.
    """
    table = finds.instances[finds.instances["rock"] > 0]
    rows = []
    for pair in combinations(finds.predictions, 2):
        first, second = (table[table["evaluated"] == domain] for domain in pair)
        chosen = most_different(first, second, ROCKS_A_SIDE)
        rows.append([[_rock_shown(finds, domain, key, rock) for domain in pair] for key, rock in chosen])
    cell = width / (4 * ROCKS_A_SIDE)
    with page(figure, width, round(len(rows) * (cell + 50) + 50)) as sheet:
        if not any(rows):
            note(sheet, "no rock is found differently in two domains")
            return
        name = f"Rocks that the detector trained on {finds.title(finds.trained)} finds most differently"
        heading(sheet, f"{name} (yellow: label, blue: box, number: IoU)")
        sheet.get_layout_engine().set(wspace=0.01, hspace=0.1)
        grid = sheet.subplots(len(rows), 4 * ROCKS_A_SIDE, squeeze=False)
        for axes in grid.ravel():
            axes.set_axis_off()
        for cells, rocks in zip(grid, rows, strict=True):
            for number, shown in enumerate(rocks):
                _draw_rock(cells[2 * number : 2 * number + 2], shown, finds)


def most_different(first: pd.DataFrame, second: pd.DataFrame, count: int) -> list[tuple[str, int]]:
    """Key and id of rocks that are found better in the first domain, then of those better in the second.

    Of rows of the instance table in each domain: key, rock, iou. Each rock is shown by its most different photo.
    """
    sides = [table.groupby(["key", "rock"])["iou"].max() for table in (first, second)]
    gain = pd.concat(sides, axis=1, join="inner", keys=["first", "second"])
    gain = (gain["first"] - gain["second"]).rename("gain").reset_index()
    gain["terrain"] = [PhotoKey.parse(str(key)).terrain for key in gain["key"]]
    found = []
    for sign in (1, -1):
        signed = gain.assign(gain=(sign * gain["gain"]).round(9))
        means = signed.groupby(["terrain", "rock"])["gain"].mean().reset_index()
        means = means[means["gain"] > 0].sort_values(["gain", "terrain", "rock"], ascending=[False, True, True])
        for terrain, rock in means[["terrain", "rock"]].iloc[:count].itertuples(index=False):
            own = signed[(signed["terrain"] == terrain) & (signed["rock"] == rock)]
            best = own.sort_values(["gain", "key"], ascending=[False, True], kind="stable").iloc[0]
            found.append((str(best["key"]), int(rock)))
    return found


def _rock_shown(finds: Finds, domain: str, key: str, rock: int) -> RockShown:
    """The label of a rock and the prediction that overlaps it best; of several labels the one found best."""
    labels, predictions = finds.labels[domain], finds.predictions[domain]
    own = labels[(labels["key"] == key) & (labels["kind"] == ROCK) & (labels["rock"] == rock)]
    label = boxes.clip(own[list(BOX.each)].to_numpy(float))
    found = predictions.loc[predictions["key"] == key, list(BOX.each)].to_numpy(float)
    if not len(found):
        return RockShown(key, rock, domain, label[0], None, 0.0)
    overlap = boxes.iou(label, found)
    row, column = np.unravel_index(overlap.argmax(), overlap.shape)
    best = float(overlap[row, column])
    return RockShown(key, rock, domain, label[row], found[column] if best > 0 else None, best)


def _draw_rock(cells: Any, shown: list[RockShown], finds: Finds) -> None:
    """Both crops show the same window, each with its own white: twins may be much darker than their photo."""
    reach = boxes.around(np.concatenate([one.label.reshape(2, 2) for one in shown]))
    half = min(max(60.0, 1.1 * float((reach[2:] - reach[:2]).max())), HEIGHT / 2)
    centre = np.clip((reach[:2] + reach[2:]) / 2, half, [WIDTH - half, HEIGHT - half])
    key = PhotoKey.parse(shown[0].key)
    for axes, one in zip(cells, shown, strict=True):
        path = finds.picture_of(one.domain, key)
        axes.set_title(f"{finds.title(one.domain)} {one.iou:.2f}", fontsize="small")
        if path is None or not path.exists():
            axes.text(0.5, 0.5, "no picture", transform=axes.transAxes, ha="center", color=FAINT)
            continue
        (left, top), side = np.floor(centre - half).astype(int), int(2 * half)
        crop = png.read(path)[top : top + side, left : left + side]
        extent = (left, left + crop.shape[1], top + crop.shape[0], top)
        axes.imshow(to_8bit(crop), extent=extent, interpolation="antialiased")
        if one.found is not None:
            rectangle(axes, one.found, _FOUND, linestyle="--", linewidth=2)
        rectangle(axes, one.label, _LABEL, linewidth=2)
        axes.set_xlim(*extent[:2])
        axes.set_ylim(*extent[2:])
    text, look = f"{key}, rock {shown[0].rock}", {"va": "top", "fontsize": "x-small", "color": FAINT}
    name = cells[0].text(0, -0.03, text, transform=cells[0].transAxes, **look)
    name.set_in_layout(False)  # it reaches below the second crop
