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
from polarsim.photo import HEIGHT, ROCK, WIDTH, PhotoKey
from polarsim.schemas.detect import FALSE_POSITIVES

TERRAIN, TILES = REGIONS = ("rock-free terrain", "rock-free tiles")
COLUMNS_OF_TILES, ROWS_OF_TILES = 8, 4  # 242 x 304 px each
MIN_MATCH_SHARE = 0.1  # minimum intersection of a matching prediction and label, relative to the smaller box
RATES = ("per_photo", "area_share")
FALSE_POSITIVE_COLUMNS = FALSE_POSITIVES.without("split", "seed", "trained", "evaluated")


def false_positives(
    keys: Sequence[str],
    labels: pd.DataFrame,
    predictions: pd.DataFrame,
    *,
    confidence: float,
    unit: Unit = "view",
    resamples: int = 1000,
) -> pd.DataFrame:
    """Return `FALSE_POSITIVE_COLUMNS`, one row for each region present in the photos.

    Parameters
    ----------
    labels, predictions : DataFrame
        key, kind, x0, y0, x1, y1 of the full photo; predictions also confidence.

    Returns
    -------
    DataFrame
        `photo_areas`: rock-free area (a photo has area 1). `per_photo`: false positives per rock-free area; the centre
        of a box determines its tile. `area_share`: share of the rock-free area covered by false positives, overlaps
        counted once.
    """
    by_photo = false_positives_of_photos(keys, labels, predictions, confidence)
    parts = [(region, by_photo[by_photo["region"] == region]) for region in REGIONS]
    rows = [_rates(region, part, unit, resamples) for region, part in parts if len(part)]
    return pd.DataFrame(rows, columns=list(FALSE_POSITIVE_COLUMNS))


def false_positives_of_photos(
    keys: Sequence[str], labels: pd.DataFrame, predictions: pd.DataFrame, confidence: float
) -> pd.DataFrame:
    """Return a row per photo: key, region, free (rock-free area), false_positives, area (that these cover)."""
    confident = predictions[predictions["confidence"] >= confidence]
    marked = mark_false_positives(labels, confident)
    counts = confident["key"][marked["false_positive"].to_numpy()].value_counts()
    rocks = values_by(labels[labels["kind"] == ROCK], ["key"], BOX_COLUMNS)
    unlabelled = values_by(confident[marked["unlabelled"].to_numpy()], ["key"], BOX_COLUMNS)
    empty = np.zeros((0, 4))
    with_rocks = {PhotoKey.parse(str(key)).terrain for key in rocks}
    rows = []
    for key in keys:
        free = _free_tiles(rocks.get(key, empty))
        region = TILES if PhotoKey.parse(key).terrain in with_rocks else TERRAIN
        area = _area_on(unlabelled.get(key, empty), free) / (WIDTH * HEIGHT)
        rows.append((key, region, float(free.mean()), int(counts.get(key, 0)), area))
    return pd.DataFrame(rows, columns=["key", "region", "free", "false_positives", "area"])


def mark_false_positives(labels: pd.DataFrame, predictions: pd.DataFrame) -> pd.DataFrame:
    """Return `unlabelled` and `false_positive` of each prediction. Tables, explorer and FiftyOne share this definition.

    `unlabelled`: a predicted rock that intersects every rock label by less than `MIN_MATCH_SHARE` of the smaller box.
    Predictions inside or around a label are thus matched. `false_positive`: an unlabelled rock with its centre in a
    tile without rock labels. Shadows are never false positives.
    """
    rocks = values_by(labels[labels["kind"] == ROCK], ["key"], BOX_COLUMNS)
    unlabelled, counted = np.zeros(len(predictions), bool), np.zeros(len(predictions), bool)
    corners = predictions[list(BOX_COLUMNS)].to_numpy(float)
    is_rock = (predictions["kind"] == ROCK).to_numpy(bool)
    for key, rows in predictions.groupby("key").indices.items():
        rock_rows = rows[is_rock[rows]]
        label = rocks.get(str(key), np.zeros((0, 4)))
        unlabelled[rock_rows] = boxes.largest_covered_share(corners[rock_rows], label) < MIN_MATCH_SHARE
        counted[rock_rows] = unlabelled[rock_rows] & _centre_in(corners[rock_rows], _free_tiles(label))
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
        "terrains": " ".join(f"{terrain:02d}" for terrain in terrains),
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


def _free_tiles(rocks: np.ndarray) -> np.ndarray:
    """Return a mask (rows, columns) of the tiles of a photo without rock labels (n, 4)."""
    x, y = _edges()
    across = (rocks[:, None, 0] < x[1:]) & (rocks[:, None, 2] > x[:-1])
    down = (rocks[:, None, 1] < y[1:]) & (rocks[:, None, 3] > y[:-1])
    return np.asarray(~(down[:, :, None] & across[:, None, :]).any(axis=0))


def _centre_in(corners: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Return a mask (n,) of boxes (n, 4) with their centre in a free tile."""
    x, y = _edges()
    centre = boxes.box_centres(corners)
    column = (np.searchsorted(x, centre[:, 0], side="right") - 1).clip(0, COLUMNS_OF_TILES - 1)
    row = (np.searchsorted(y, centre[:, 1], side="right") - 1).clip(0, ROWS_OF_TILES - 1)
    return np.asarray(free[row, column])


def _area_on(false_positives: np.ndarray, free: np.ndarray) -> float:
    """Return the area of the union of boxes inside free tiles, px^2, by a grid of all box and tile edges."""
    if not len(false_positives):
        return 0.0
    tiles_x, tiles_y = _edges()
    x, y = (
        np.unique(np.concatenate([edges, false_positives[:, n], false_positives[:, n + 2]]))
        for n, edges in enumerate((tiles_x, tiles_y))
    )
    centre_x, centre_y = (x[1:] + x[:-1]) / 2, (y[1:] + y[:-1]) / 2
    across = (false_positives[:, None, 0] <= centre_x) & (false_positives[:, None, 2] >= centre_x)
    down = (false_positives[:, None, 1] <= centre_y) & (false_positives[:, None, 3] >= centre_y)
    covered = (down[:, :, None] & across[:, None, :]).any(axis=0)
    column, row = (
        np.searchsorted(edges, centre, side="right") - 1 for edges, centre in ((tiles_x, centre_x), (tiles_y, centre_y))
    )
    inside = ((column >= 0) & (column < COLUMNS_OF_TILES))[None] & ((row >= 0) & (row < ROWS_OF_TILES))[:, None]
    in_free = inside & free[row.clip(0, ROWS_OF_TILES - 1)][:, column.clip(0, COLUMNS_OF_TILES - 1)]
    return float((np.diff(y)[:, None] * np.diff(x)[None])[covered & in_free].sum())


def _edges() -> tuple[np.ndarray, np.ndarray]:
    """Return the tile edges, px: columns + 1 along x, rows + 1 along y."""
    return np.linspace(0, WIDTH, COLUMNS_OF_TILES + 1), np.linspace(0, HEIGHT, ROWS_OF_TILES + 1)
