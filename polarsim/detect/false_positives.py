"""False positive rocks: number per photo and share of the area.

mAP does not separate false positives from misses and ignores photos without rocks. These rates are computed on regions
without rocks: entire photos of terrains without rock labels, and rock-free tiles of the remaining photos.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from polarsim import intervals
from polarsim.detect.grouping import BOX_COLUMNS, Unit, units_of, values_by
from polarsim.geometry import boxes
from polarsim.photo import ROCK, PhotoKey, terrain_text
from polarsim.schemas.detect import FALSE_POSITIVES

TERRAIN, TILES = REGIONS = ("rock-free terrain", "rock-free tiles")
COLUMNS_OF_TILES, ROWS_OF_TILES = 8, 4  # 242 x 304 px each in photos of 1936 x 1216
MIN_MATCH_SHARE = 0.1  # minimum intersection of a matching prediction and label, relative to the smaller box
RATES = ("per_photo", "area_share")
FALSE_POSITIVE_COLUMNS = FALSE_POSITIVES.without("split", "seed", "trained", "evaluated")


def false_positives(
    keys: Sequence[str],
    labels: pd.DataFrame,
    predictions: pd.DataFrame,
    *,
    size: tuple[int, int],
    confidence: float,
    unit: Unit = "view",
    resamples: int = 1000,
) -> pd.DataFrame:
    """Return `FALSE_POSITIVE_COLUMNS`, one row for each region present in the photos.

    Parameters
    ----------
    labels, predictions : DataFrame
        key, kind, x0, y0, x1, y1 of the full photo; predictions also confidence.
    size : (int, int)
        Width and height of the photos, px.

    Returns
    -------
    DataFrame
        `photo_areas`: rock-free area (a photo has area 1). `per_photo`: false positives per rock-free area; the centre
        of a box determines its tile. `area_share`: share of the rock-free area covered by false positives, overlaps
        counted once.
    """
    by_photo = false_positives_of_photos(keys, labels, predictions, confidence, size)
    parts = [(region, by_photo[by_photo["region"] == region]) for region in REGIONS]
    rows = [_rates(region, part, unit, resamples) for region, part in parts if len(part)]
    return pd.DataFrame(rows, columns=list(FALSE_POSITIVE_COLUMNS))


def false_positives_of_photos(
    keys: Sequence[str],
    labels: pd.DataFrame,
    predictions: pd.DataFrame,
    confidence: float,
    size: tuple[int, int],
) -> pd.DataFrame:
    """Return a row per photo: key, region, free (rock-free area), false_positives, area (that these cover)."""
    confident = predictions[predictions["confidence"] >= confidence]
    tiles = Tiles(size)
    marked = mark_false_positives(labels, confident, size)
    counts = confident["key"][marked["false_positive"].to_numpy()].value_counts()
    rocks = values_by(labels[labels["kind"] == ROCK], ["key"], BOX_COLUMNS)
    unlabelled = values_by(confident[marked["unlabelled"].to_numpy()], ["key"], BOX_COLUMNS)
    empty = np.zeros((0, 4))
    with_rocks = {PhotoKey.parse(str(key)).terrain for key in rocks}
    rows = []
    for key in keys:
        free = tiles.free(rocks.get(key, empty))
        region = TILES if PhotoKey.parse(key).terrain in with_rocks else TERRAIN
        area = tiles.area_on(unlabelled.get(key, empty), free) / (size[0] * size[1])
        rows.append((key, region, float(free.mean()), int(counts.get(key, 0)), area))
    return pd.DataFrame(rows, columns=["key", "region", "free", "false_positives", "area"])


def mark_false_positives(labels: pd.DataFrame, predictions: pd.DataFrame, size: tuple[int, int]) -> pd.DataFrame:
    """Return `unlabelled` and `false_positive` of each prediction. Tables and explorer share this definition.

    `unlabelled`: a predicted rock that intersects every rock label by less than `MIN_MATCH_SHARE` of the smaller box.
    Predictions inside or around a label are thus matched. `false_positive`: an unlabelled rock with its centre in a
    tile without rock labels. Shadows are never false positives. `size`: width and height of the photos, px.
    """
    tiles, rocks = Tiles(size), values_by(labels[labels["kind"] == ROCK], ["key"], BOX_COLUMNS)
    unlabelled, counted = np.zeros(len(predictions), bool), np.zeros(len(predictions), bool)
    corners = predictions[list(BOX_COLUMNS)].to_numpy(float)
    is_rock = (predictions["kind"] == ROCK).to_numpy(bool)
    for key, rows in predictions.groupby("key").indices.items():
        rock_rows = rows[is_rock[rows]]
        label = rocks.get(str(key), np.zeros((0, 4)))
        unlabelled[rock_rows] = boxes.largest_covered_share(corners[rock_rows], label) < MIN_MATCH_SHARE
        counted[rock_rows] = (
            unlabelled[rock_rows] & tiles.free(label)[tiles.at(*boxes.box_centres(corners[rock_rows]).T)]
        )
    return pd.DataFrame({"unlabelled": unlabelled, "false_positive": counted}, index=predictions.index)


def _rates(region: str, rows: pd.DataFrame, unit: Unit, resamples: int) -> dict[str, object]:
    """Return one row. Rates are ratios of sums, so photos are weighted by their rock-free area."""
    keys = rows["key"].tolist()
    free, false_positives, area = rows[["free", "false_positives", "area"]].to_numpy(float).T
    owner = units_of(keys, unit)
    units = int(owner.max()) + 1
    drawn = intervals.bootstrap_draws(units, resamples)
    terrains = sorted({PhotoKey.parse(key).terrain for key in keys})
    row: dict[str, object] = {
        "region": region,
        "terrains": " ".join(map(terrain_text, terrains)),
        "images": len(keys),
        "units": units,
        "photo_areas": float(free.sum()),
        "false_positives": int(false_positives.sum()),
    }
    for name, values in zip(RATES, (false_positives, area), strict=True):
        low, high = intervals.percentile_interval(intervals.resampled_ratios(values, free, owner, drawn), units)
        value = float(values.sum() / free.sum()) if free.sum() else float("nan")
        row |= {name: value, f"{name}_low": low, f"{name}_high": high}
    return row


class Tiles:
    """Tiles of photos of a size (width, height), px."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        self._x = np.linspace(0, size[0], COLUMNS_OF_TILES + 1)  # edges, px
        self._y = np.linspace(0, size[1], ROWS_OF_TILES + 1)

    def free(self, rocks: np.ndarray) -> np.ndarray:
        """Return a mask (rows, columns) of the tiles of a photo without rock labels (n, 4)."""
        across = (rocks[:, None, 0] < self._x[1:]) & (rocks[:, None, 2] > self._x[:-1])
        down = (rocks[:, None, 1] < self._y[1:]) & (rocks[:, None, 3] > self._y[:-1])
        return np.asarray(~(down[:, :, None] & across[:, None, :]).any(axis=0))

    def at(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows of tiles of y and the columns of tiles of x, px."""
        row, column = (np.searchsorted(edges, each, side="right") - 1 for edges, each in ((self._y, y), (self._x, x)))
        return row.clip(0, ROWS_OF_TILES - 1), column.clip(0, COLUMNS_OF_TILES - 1)

    def area_on(self, false_positives: np.ndarray, free: np.ndarray) -> float:
        """Return the area of the union of boxes inside free tiles, px^2, by a grid of all box and tile edges."""
        corners = boxes.clip(false_positives, *self._size)
        x, y = (
            np.unique(np.concatenate([edges, corners[:, n], corners[:, n + 2]]))
            for n, edges in enumerate((self._x, self._y))
        )
        centre_x, centre_y = (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2
        across = (corners[:, None, 0] <= centre_x) & (corners[:, None, 2] >= centre_x)
        down = (corners[:, None, 1] <= centre_y) & (corners[:, None, 3] >= centre_y)
        covered = (down[:, :, None] & across[:, None, :]).any(axis=0)
        row, column = self.at(centre_x, centre_y)
        return float((np.diff(y)[:, None] * np.diff(x)[None])[covered & free[row][:, column]].sum())
