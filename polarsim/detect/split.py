"""Which photos train a detector, which choose its weights, which test it."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.detect.options import SplitOptions
from polarsim.errors import DetectError, about
from polarsim.formats import tables
from polarsim.formats.files import write_json
from polarsim.photo import CameraSide, PhotoKey
from polarsim.randomness import generator
from polarsim.schemas.detect import PARTS as PARTS_TABLE

TRAIN, VAL, TEST = PARTS = ("train", "val", "test")
VAL_SHARE = 0.1  # of what is not tested, to select weights; drawn by photo where it is less than half a unit
SPLIT_COLUMNS = PARTS_TABLE.columns
PHOTO, TERRAIN = "photo", "terrain"


def unit(key: PhotoKey, by: str) -> Any:
    """What is drawn as a whole: the photo, its view, its station, or its terrain. Units of one kind have an order."""
    if by == "view":
        return key.view
    if by == "position":
        return key.station
    return key.terrain if by == TERRAIN else key


def draw_split(keys: Sequence[PhotoKey], by: str, options: SplitOptions) -> dict[PhotoKey, str]:
    """Part of every photo, in the order of the keys.

    By photo, the test part is a random share of the photos (the paper's 2 : 1): photos of one view lie on both sides.
    By view, position or terrain whole ones are drawn; terrains may be given. The val part is drawn alike from what is
    left, or by photo where its share is less than half a unit.

    Raises
    ------
    DetectError
        A part would be empty.
    """
    ordered = sorted(set(keys))
    units = sorted({unit(key, by) for key in ordered})
    if by == TERRAIN and options.test_terrains:
        test = _given_terrains(units, options)
    else:
        test = _draw(units, options.test_share, options.seed, "split", by)
    rest = [key for key in ordered if unit(key, by) not in test]
    units = sorted({unit(key, by) for key in rest})
    val_by = by if round(VAL_SHARE * len(units)) else PHOTO
    val = _draw(sorted({unit(key, val_by) for key in rest}), VAL_SHARE, options.seed, "val", by)
    parts = {key: VAL if unit(key, val_by) in val else TRAIN for key in rest}
    if len(rest) == len(ordered) or TRAIN not in parts.values():
        raise DetectError(
            f"{len(ordered)} photos split by {by} leave {len(ordered) - len(rest)} to test and {len(rest)} to train, "
            "each part needs some"
        )
    return {key: parts.get(key, TEST) for key in ordered}


def _draw(units: Sequence[Hashable], share: float, seed: int, *purpose: str) -> set[Hashable]:
    """A share of the units, one at least."""
    order = generator(seed, "detect", *purpose).permutation(len(units))
    return {units[n] for n in order[: max(1, round(share * len(units)))]}


def _given_terrains(terrains: Sequence[int], options: SplitOptions) -> set[Hashable]:
    absent = set(options.test_terrains) - set(terrains)
    if absent:
        raise DetectError(f"test terrain {min(absent)} has no photos, there are terrains {list(terrains)}")
    return set(options.test_terrains)


def draw_val(groups: Iterable[str], options: SplitOptions) -> dict[str, str]:
    """Train or val for every group of pictures that are no photos, such as those of one novel camera."""
    ordered = sorted(set(groups))
    val = _draw(ordered, VAL_SHARE, options.seed, "val", "group")
    return {group: VAL if group in val else TRAIN for group in ordered}


def leaks(parts: Mapping[PhotoKey, str]) -> list[tuple[int, str, CameraSide]]:
    """Views (terrain, position, camera) with photos in the test part and outside it: their scenes are no news."""
    test = {key.view for key, part in parts.items() if part == TEST}
    return sorted(test & {key.view for key, part in parts.items() if part != TEST})


def check_split(parts: Mapping[PhotoKey, str], by: str) -> None:
    """Refuse a strict split with a view, position or terrain in the test part and outside it.

    Raises
    ------
    DetectError
        It has one; named is the first.
    """
    if by == PHOTO:
        return
    test = {unit(key, by) for key, part in parts.items() if part == TEST}
    shared = sorted(test & {unit(key, by) for key, part in parts.items() if part != TEST})
    if shared:
        name = shared[0] if by == TERRAIN else " ".join(map(str, shared[0]))
        raise DetectError(f"split by {by}, but {by} {name} is in the test part and outside it")


def split_photos(*, keys: list[PhotoKey], by: str, split: Path, options: SplitOptions) -> None:
    """Draw the split of these photos and write it as CSV: key, part; beside it, as JSON, how it was drawn."""
    with about(split):
        parts = draw_split(keys, by, options)
        check_split(parts, by)
    rows = [(str(key), part) for key, part in parts.items()]
    tables.write_csv(split, pd.DataFrame(rows, columns=list(SPLIT_COLUMNS)))
    facts = {
        "by": by,
        "seed": options.seed,
        "test_share": options.test_share,
        "test_terrains": sorted({key.terrain for key, part in parts.items() if part == TEST}) if by == TERRAIN else [],
        "val_share": VAL_SHARE,
        "photos": {part: list(parts.values()).count(part) for part in PARTS},
        "views_on_both_sides": len(leaks(parts)),
    }
    write_json(split.with_suffix(".json"), facts)


def read_split(split: Path, by: str = PHOTO) -> dict[PhotoKey, str]:
    """Read a split.

    Raises
    ------
    PolarsimError
        No readable table, a key that is none, an unknown part, or a leak where the split is by more than photos.
    """
    table = tables.read_csv(split, SPLIT_COLUMNS)
    unknown = sorted(set(table["part"].astype(str)) - set(PARTS))
    if unknown:
        raise DetectError(f"part {unknown[0]!r}, expected one of {', '.join(PARTS)}", path=split)
    with about(split):
        parts = {PhotoKey.parse(str(key)): str(part) for key, part in zip(table["key"], table["part"], strict=True)}
        check_split(parts, by)
    return parts


def tested_keys(splits: Sequence[Path]) -> set[PhotoKey]:
    """Keys that are in the test part of some split."""
    return {key for split in splits for key, part in read_split(split).items() if part == TEST}
