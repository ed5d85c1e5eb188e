"""Division of photos into training, validation and test."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.detect.options import SplitOptions
from polarsim.errors import DetectError, with_path
from polarsim.formats import tables
from polarsim.formats.files import write_json
from polarsim.photo import PhotoKey, Terrain
from polarsim.randomness import generator
from polarsim.schemas.detect import PARTS as PARTS_TABLE

TRAIN, VAL, TEST = PARTS = ("train", "val", "test")
VAL_SHARE = 0.1  # share of the photos outside the test part that selects weights
SPLIT_COLUMNS = PARTS_TABLE.columns
PHOTO, TERRAIN = "photo", "terrain"


def split_unit(key: PhotoKey, by: str) -> Any:
    """Return the unit of a photo that is not divided by a split: the key, the view, the station or the terrain."""
    if by == "view":
        return key.view
    if by == "position":
        return key.station
    return key.terrain if by == TERRAIN else key


def draw_split(keys: Sequence[PhotoKey], by: str, options: SplitOptions) -> dict[PhotoKey, str]:
    """Return the part of each photo, in the order of the keys.

    By photo, the test part is a random share of the photos (2 : 1 in the paper), so photos of a view are in several
    parts. By view, position or terrain, entire units are selected; test terrains can be given. The validation part is
    selected from the remaining photos by the same unit, or by photo if its share is less than half a unit. A part that
    would be empty is an error.
    """
    ordered = sorted(set(keys))
    units = sorted({split_unit(key, by) for key in ordered})
    if by == TERRAIN and options.test_terrains:
        test = _configured_terrains(units, options)
    else:
        test = _draw(units, options.test_share, options.seed, "split", by)
    rest = [key for key in ordered if split_unit(key, by) not in test]
    units = sorted({split_unit(key, by) for key in rest})
    val_by = by if round(VAL_SHARE * len(units)) else PHOTO
    val = _draw(sorted({split_unit(key, val_by) for key in rest}), VAL_SHARE, options.seed, "val", by)
    parts = {key: VAL if split_unit(key, val_by) in val else TRAIN for key in rest}
    if len(rest) == len(ordered) or TRAIN not in parts.values():
        raise DetectError(
            f"{len(ordered)} photos split by {by} leave {len(ordered) - len(rest)} to test and {len(rest)} to train, "
            "each part needs some"
        )
    return {key: parts.get(key, TEST) for key in ordered}


def _draw(units: Sequence[Hashable], share: float, seed: int, *purpose: str) -> set[Hashable]:
    """Return a random share of the units, at least one unit."""
    order = generator(seed, "detect", *purpose).permutation(len(units))
    return {units[n] for n in order[: max(1, round(share * len(units)))]}


def _configured_terrains(terrains: Sequence[Terrain], options: SplitOptions) -> set[Hashable]:
    absent = set(options.test_terrains) - set(terrains)
    if absent:
        raise DetectError(f"test terrain {min(absent)} has no photos, available terrains: {list(terrains)}")
    return set(options.test_terrains)


def draw_val(groups: Iterable[str], options: SplitOptions) -> dict[str, str]:
    """Return the part (train or val) of each group of images without photo keys, such as a camera of novel views."""
    ordered = sorted(set(groups))
    val = _draw(ordered, VAL_SHARE, options.seed, "val", "group")
    return {group: VAL if group in val else TRAIN for group in ordered}


def shared_units(parts: Mapping[PhotoKey, str], by: str) -> list[Any]:
    """Return views, positions or terrains with photos both inside and outside the test part."""
    test = {split_unit(key, by) for key, part in parts.items() if part == TEST}
    return sorted(test & {split_unit(key, by) for key, part in parts.items() if part != TEST})


def split_photos(*, keys: list[PhotoKey], by: str, split: Path, options: SplitOptions) -> None:
    """Write a split of the photos as CSV (key, part), and a JSON file with the parameters of the split."""
    with with_path(split):
        parts = draw_split(keys, by, options)
    rows = [(str(key), part) for key, part in parts.items()]
    tables.write_csv(split, pd.DataFrame(rows, columns=list(SPLIT_COLUMNS)))
    facts = {
        "by": by,
        "seed": options.seed,
        "test_share": options.test_share,
        "test_terrains": sorted({key.terrain for key, part in parts.items() if part == TEST}) if by == TERRAIN else [],
        "val_share": VAL_SHARE,
        "photos": {part: list(parts.values()).count(part) for part in PARTS},
        "views_on_both_sides": len(shared_units(parts, "view")),
    }
    write_json(split.with_suffix(".json"), facts)


def read_split(split: Path, by: str = PHOTO) -> dict[PhotoKey, str]:
    """Read a split; a unit both inside and outside the test part is an error."""
    table = tables.read_csv(split, SPLIT_COLUMNS)
    unknown = sorted(set(table["part"].astype(str)) - set(PARTS))
    if unknown:
        raise DetectError(f"part {unknown[0]!r}, expected one of {', '.join(PARTS)}", path=split)
    with with_path(split):
        parts = {PhotoKey.parse(str(key)): str(part) for key, part in zip(table["key"], table["part"], strict=True)}
        if shared := shared_units(parts, by):
            name = shared[0] if by == TERRAIN else " ".join(map(str, shared[0]))
            raise DetectError(f"split by {by}, but {by} {name} is both inside and outside the test part")
    return parts


def tested_keys(splits: Sequence[Path]) -> set[PhotoKey]:
    """Return the keys in the test part of at least one split."""
    return {key for split in splits for key, part in read_split(split).items() if part == TEST}
