"""Data sets in YOLO's layout: a domain's converted pictures by further names, shared out to parts by a split."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from polarsim.detect.options import VIEWS, PicturesOptions, SplitOptions
from polarsim.detect.pictures import CORRUPT, USED, convert_photos, read_states
from polarsim.detect.split import PARTS, PHOTO, TERRAIN, TEST, TRAIN, VAL, draw_val, read_split
from polarsim.errors import DetectError
from polarsim.formats import tables
from polarsim.formats.files import share_file, write_json, write_text, writing_folder
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.randomness import generator
from polarsim.schemas.detect import PARTS as PARTS_TABLE

PICTURE_COLUMNS = PARTS_TABLE.columns
KINDS = (("images", ".png"), ("labels", ".txt"))  # YOLO's folders, and how the names of their files end
MASKS = "masks"  # the folder beside them, of pictures whose masks are known
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Entry:
    """A picture of a data set: its name in it, its part, and its files."""

    name: str
    part: str
    image: Path
    label: Path | None  # None: it has labels that nobody may read here
    mask: Path | None = None  # what every pixel shows, see `formats.class_masks`, where that is known


def make_dataset(
    *,
    domain: str,
    pictures: Path,
    labels: Path,
    split: Path,
    dataset: Path,
    options: PicturesOptions,
    by: str = PHOTO,
    wanted: Sequence[str] = PARTS,
) -> None:
    """Convert a domain's photos or twins and share them out, all in one folder: `convert_photos`, `share_pictures`.

    Parts that are not wanted stay empty.

    Raises
    ------
    PolarsimError
        A broken file, or a part without any picture.
    """
    parts = {key: part for key, part in read_split(split, by).items() if part in wanted}
    with writing_folder(dataset) as folder:
        convert_photos(
            domain=domain,
            pictures=pictures,
            labels=labels,
            keys=list(parts),
            folder=folder / "pictures",
            options=options,
        )
        part_of = {str(key): part for key, part in parts.items()}
        _share(domain, dataset, folder / "pictures", part_of, by, folder, wanted)


def share_pictures(*, domain: str, pictures: Path, split: Path, by: str, dataset: Path, options: SplitOptions) -> None:
    """Write the folder of one domain's data set.

    Photos and twins lie in the part of their key. Novel views train and choose weights, parted by their cameras, and
    test nothing; split by terrain, those that show a terrain of the test part are left out.

    Parameters
    ----------
    pictures : Path
        Folder of `convert_photos` or `convert_views`.
    split : Path
        CSV of key and part.
    by : str
        What the split is by.
    dataset : Path
        Folder to write: `images/<part>/NAME.png` and `labels/<part>/NAME.txt`, `data.yaml`, `pictures.csv`,
        `dataset.json`, and, where corrupt pictures are left out, `left_out.csv`.

    Raises
    ------
    PolarsimError
        A broken file, a split that leaks, or a part without any picture.
    """
    parts = read_split(split, by)
    views = domain == VIEWS
    part_of = {str(key): part for key, part in parts.items()}
    if views:
        part_of = _parts_of_views(read_states(pictures), parts, by, options)
    with writing_folder(dataset) as folder:
        _share(domain, dataset, pictures, part_of, by, folder, (TRAIN, VAL) if views else PARTS)


def mix_datasets(
    *, domain: str, weights: Mapping[str, float], datasets: Mapping[str, Path], dataset: Path, options: SplitOptions
) -> None:
    """Write a data set to train on, of pictures of other data sets; it has no test part.

    Of each part of a domain as many pictures are drawn as its weight says: 0.5 takes half of them, 1.5 takes all and
    half of them once more. A picture is called `<domain>-<name>`, and `-2`, `-3` behind it where it is taken again.

    Raises
    ------
    PolarsimError
        A broken data set, or a part without any picture.
    """
    entries, left_out = [], []
    for source, weight in sorted(weights.items()):
        folder = datasets[source]
        for part in (TRAIN, VAL):
            names = read_pictures(folder, part)
            order = generator(options.seed, "detect", "mix", domain, source, part).permutation(len(names))
            for n in range(round(weight * len(names))):
                name, copy = names[order[n % len(names)]], n // len(names) + 1
                named = f"{source}-{name}" + (f"-{copy}" if copy > 1 else "")
                entries.append(entry_of(folder, name, part, part, named))
        left_out += [(f"{source}-{name}", part) for name, part in _left_out(folder) if part != TEST]
    with writing_folder(dataset) as made:
        write_dataset(domain, dataset, entries, made, {"weights": dict(weights)}, left_out, (TRAIN, VAL))


def entry_of(folder: Path, name: str, part: str, below: str = "", named: str = "") -> Entry:
    """The entry of a picture whose files lie in `images/`, `labels/` and perhaps `masks/`, or `below` these."""
    image, label = (folder / kind / below / f"{name}{ending}" for kind, ending in KINDS)
    mask = folder / MASKS / below / f"{name}.png"
    return Entry(named or name, part, image, label, mask if mask.is_file() else None)


def read_parts(dataset: Path) -> dict[str, list[str]]:
    """Names of the pictures that each part of a data set really has, sorted; those of photos and twins are keys."""
    table = tables.read_csv(dataset / "pictures.csv", PICTURE_COLUMNS)
    return {part: sorted(table.loc[table["part"] == part, "key"].astype(str)) for part in PARTS}


def read_pictures(dataset: Path, part: str) -> list[str]:
    """Those of one part."""
    return read_parts(dataset)[part]


def count_left_out(dataset: Path, parts: Sequence[str]) -> int:
    """How many pictures of these parts are left out since they or their labels are corrupt."""
    return sum(part in parts for _, part in _left_out(dataset))


def _share(
    domain: str,
    dataset: Path,
    pictures: Path,
    part_of: Mapping[str, str],
    by: str,
    folder: Path,
    needed: Sequence[str],
) -> None:
    states = read_states(pictures)
    entries, left_out = [], []
    for key, state in zip(states["key"], states["state"], strict=True):
        part = part_of.get(key)
        if part and state == USED:
            entries.append(entry_of(pictures, key, part))
        elif part and state == CORRUPT:
            left_out.append((key, part))
    write_dataset(domain, dataset, entries, folder, {"split": by}, left_out, needed)


def _parts_of_views(
    states: pd.DataFrame, parts: Mapping[PhotoKey, str], by: str, options: SplitOptions
) -> dict[str, str]:
    """Train or val for novel views, by their cameras; split by terrain, those that show a test terrain have no part."""
    part_of_camera = draw_val(states["camera"], options)
    left = {key.terrain for key, part in parts.items() if part == TEST} if by == TERRAIN else set()
    return {
        str(key): part_of_camera[str(camera)]
        for key, camera, shown in zip(states["key"], states["camera"], states["terrains"], strict=True)
        if not left & set(map(int, shown.split()))
    }


def write_dataset(
    domain: str,
    dataset: Path,
    entries: Sequence[Entry],
    folder: Path,
    facts: Mapping[str, object],
    left_out: Sequence[tuple[str, str]] = (),
    needed: Sequence[str] = PARTS,
) -> None:
    """Fill the folder that will be called `dataset` with the files of its entries, and with what tells of it.

    Parameters
    ----------
    facts
        More of `dataset.json`.
    left_out
        Names and parts of corrupt pictures.

    Raises
    ------
    DetectError
        A part that is needed has no picture.
    """
    for part in PARTS:
        for kind, _ in KINDS:
            (folder / kind / part).mkdir(parents=True)
        if any(entry.mask for entry in entries if entry.part == part):
            (folder / MASKS / part).mkdir(parents=True)
    counts = {part: sum(entry.part == part for entry in entries) for part in PARTS}
    for part in needed:
        if not counts[part]:
            raise DetectError(f"no {domain} picture in the {part} part", path=dataset)
    for entry in entries:
        for (kind, ending), file in zip((*KINDS, (MASKS, ".png")), (entry.image, entry.label, entry.mask), strict=True):
            if file is not None:
                share_file(file, folder / kind / entry.part / f"{entry.name}{ending}")
    log.info("%s: %d train, %d val, %d test pictures", domain, *counts.values())
    rows = [(entry.name, entry.part) for entry in entries]
    tables.write_csv(folder / "pictures.csv", pd.DataFrame(rows, columns=list(PICTURE_COLUMNS)))
    if left_out:
        tables.write_csv(folder / "left_out.csv", pd.DataFrame(left_out, columns=list(PICTURE_COLUMNS)))
    write_text(folder / "data.yaml", _data_yaml())
    corrupt = {part: sum(row[1] == part for row in left_out) for part in PARTS}
    write_json(folder / "dataset.json", {"domain": domain, "pictures": counts, "left_out": corrupt, **facts})


def _left_out(dataset: Path) -> list[tuple[str, str]]:
    path = dataset / "left_out.csv"
    if not path.is_file():
        return []
    table = tables.read_csv(path, PICTURE_COLUMNS)
    return list(zip(table["key"].astype(str), table["part"].astype(str), strict=True))


def _data_yaml() -> str:
    parts = "".join(f"{part}: images/{part}\n" for part in PARTS)
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    return f"# Paths are relative to this file.\n{parts}names:\n{names}"
