"""Which photos train a judge, which choose its weights, which test it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from polarsim.detect.options import DetectOptions
from polarsim.errors import DetectError, about
from polarsim.formats import tables
from polarsim.photo import Camera, PhotoKey
from polarsim.randomness import generator

TRAIN, VAL, TEST = PARTS = ("train", "val", "test")
SPLIT_COLUMNS = ("key", "part")


def draw_split(keys: Sequence[PhotoKey], options: DetectOptions) -> dict[PhotoKey, str]:
    """Part of every photo, in the order of the keys.

    By photo, the test part is a random share of the photos (the paper's 2 : 1): photos of one view lie on both sides.
    By terrain, whole terrains are the test part, the given ones or a random share.

    Raises
    ------
    DetectError
        A part would be empty.
    """
    ordered = sorted(set(keys))
    random = generator(options.seed, "detect", "split", options.split)
    if options.split == "terrain":
        terrains = _test_terrains(ordered, options)
        test = {key for key in ordered if key.terrain in terrains}
    else:
        order = random.permutation(len(ordered))
        test = {ordered[n] for n in order[: round(options.test_share * len(ordered))]}
    rest = [key for key in ordered if key not in test]
    order = generator(options.seed, "detect", "val", options.split).permutation(len(rest))
    val = {rest[n] for n in order[: max(1, round(options.val_share * len(rest)))]}
    if not test or len(rest) <= len(val):
        raise DetectError(
            f"{len(ordered)} photos split by {options.split} leave {len(test)} to test and {len(rest)} to train, "
            "each part needs some"
        )
    return {key: TEST if key in test else VAL if key in val else TRAIN for key in ordered}


def _test_terrains(keys: Sequence[PhotoKey], options: DetectOptions) -> set[int]:
    terrains = sorted({key.terrain for key in keys})
    if options.test_terrains:
        absent = set(options.test_terrains) - set(terrains)
        if absent:
            raise DetectError(f"test terrain {min(absent)} has no photos, there are terrains {terrains}")
        return set(options.test_terrains)
    count = max(1, round(options.test_share * len(terrains)))
    drawn = generator(options.seed, "detect", "terrains").permutation(len(terrains))[:count]
    return {terrains[n] for n in drawn}


def leaks(parts: dict[PhotoKey, str]) -> list[tuple[int, str, Camera]]:
    """Views (terrain, position, camera) with photos in the test part and outside it: their scenes are no news."""
    test = {key.view for key, part in parts.items() if part == TEST}
    return sorted(test & {key.view for key, part in parts.items() if part != TEST})


def split_photos(*, keys: list[PhotoKey], split: Path, options: DetectOptions) -> None:
    """Draw the split of these photos and write it as CSV: key, part."""
    with about(split):
        parts = draw_split(keys, options)
    rows = [(str(key), part) for key, part in parts.items()]
    tables.write_csv(split, pd.DataFrame(rows, columns=list(SPLIT_COLUMNS)))


def read_split(split: Path) -> dict[PhotoKey, str]:
    """Read a split.

    Raises
    ------
    PolarsimError
        No readable table, a key that is none, or an unknown part.
    """
    table = tables.read_csv(split, SPLIT_COLUMNS)
    unknown = sorted(set(table["part"].astype(str)) - set(PARTS))
    if unknown:
        raise DetectError(f"{split}: part {unknown[0]!r}, expected one of {', '.join(PARTS)}")
    with about(split):
        return {PhotoKey.parse(str(key)): str(part) for key, part in zip(table["key"], table["part"], strict=True)}
