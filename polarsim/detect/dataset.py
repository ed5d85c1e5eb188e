"""Data sets in YOLO layout: links to the converted images of a domain, divided by a split."""

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
from polarsim.photo import BOX_CLASSES, PhotoKey, parse_terrain
from polarsim.randomness import generator
from polarsim.schemas.detect import PARTS as PARTS_TABLE

PICTURE_COLUMNS = PARTS_TABLE.columns
KINDS = (("images", ".png"), ("labels", ".txt"))  # YOLO folders and file name extensions
MASKS = "masks"  # folder of class masks, if available
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Entry:
    """Image of a data set: name, part and source files."""

    name: str
    part: str
    image: Path
    label: Path | None  # None: labels are excluded from the data set
    mask: Path | None = None  # class of every pixel, see `class_masks`


def make_dataset(
    *,
    domain: str,
    pictures: Path,
    labels: Path,
    split: Path,
    dataset: Path,
    size: tuple[int, int],
    options: PicturesOptions,
    by: str = PHOTO,
    wanted: Sequence[str] = PARTS,
) -> None:
    """Apply `convert_photos` and `share_pictures` in one folder. Parts that are not in `wanted` are empty."""
    parts = {key: part for key, part in read_split(split, by).items() if part in wanted}
    with writing_folder(dataset) as folder:
        convert_photos(
            domain=domain,
            pictures=pictures,
            labels=labels,
            keys=list(parts),
            size=size,
            folder=folder / "pictures",
            options=options,
        )
        part_of = {str(key): part for key, part in parts.items()}
        _share(domain, dataset, folder / "pictures", part_of, by, folder, wanted)


def share_pictures(*, domain: str, pictures: Path, split: Path, by: str, dataset: Path, options: SplitOptions) -> None:
    """Write the folder of the data set of one domain.

    The part of photos and twins follows from the key. Novel views are divided by camera into training and validation
    and have no test part. In a split by terrain, views that show a test terrain are excluded.

    Parameters
    ----------
    pictures : Path
        Folder of `convert_photos` or `convert_views`.
    dataset : Path
        Folder to write: `images/<part>/NAME.png` and `labels/<part>/NAME.txt`, `data.yaml`, `pictures.csv`,
        `dataset.json`, and `left_out.csv` if corrupt images were skipped.
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
    """Write a training data set of images of several domains, without a test part.

    The number of images of a domain in each part is multiplied by the weight: 0.5 selects half of the images, 1.5 all
    images and a second copy of half of them. Image names are `<domain>-<name>`, copies end with `-2`, `-3`.
    """
    entries, left_out = [], []
    for source, weight in sorted(weights.items()):
        folder = datasets[source]
        for part in (TRAIN, VAL):
            names = dataset_images(folder, part)
            order = generator(options.seed, "detect", "mix", domain, source, part).permutation(len(names))
            for n in range(round(weight * len(names))):
                name, copy = names[order[n % len(names)]], n // len(names) + 1
                named = f"{source}-{name}" + (f"-{copy}" if copy > 1 else "")
                entries.append(image_entry(folder, name, part, part, named))
        left_out += [(f"{source}-{name}", part) for name, part in _left_out(folder) if part != TEST]
    with writing_folder(dataset) as made:
        write_yolo_dataset(domain, dataset, entries, made, {"weights": dict(weights)}, left_out, (TRAIN, VAL))


def image_entry(folder: Path, name: str, part: str, below: str = "", named: str = "") -> Entry:
    """Return the entry of an image with files in `images/`, `labels/` and optionally `masks/`, or `below` these."""
    image, label = (folder / kind / below / f"{name}{ending}" for kind, ending in KINDS)
    mask = folder / MASKS / below / f"{name}.png"
    return Entry(named or name, part, image, label, mask if mask.is_file() else None)


def read_parts(dataset: Path) -> dict[str, list[str]]:
    """Return the sorted names of the existing images in each part of a data set; photo keys for photos and twins."""
    table = tables.read_csv(dataset / "pictures.csv", PICTURE_COLUMNS)
    return {part: sorted(table.loc[table["part"] == part, "key"].astype(str)) for part in PARTS}


def dataset_images(dataset: Path, part: str) -> list[str]:
    """Return the sorted names of the images in one part."""
    return read_parts(dataset)[part]


def count_left_out(dataset: Path, parts: Sequence[str]) -> int:
    """Return the number of images of these parts that were skipped because of corrupt images or labels."""
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
            entries.append(image_entry(pictures, key, part))
        elif part and state == CORRUPT:
            left_out.append((key, part))
    write_yolo_dataset(domain, dataset, entries, folder, {"split": by}, left_out, needed)


def _parts_of_views(
    states: pd.DataFrame, parts: Mapping[PhotoKey, str], by: str, options: SplitOptions
) -> dict[str, str]:
    """Return the part of each novel view, by camera. In a split by terrain, views of test terrains have no part."""
    part_of_camera = draw_val(states["camera"], options)
    test_terrains = {key.terrain for key, part in parts.items() if part == TEST} if by == TERRAIN else set()
    return {
        str(key): part_of_camera[str(camera)]
        for key, camera, terrains in zip(states["key"], states["camera"], states["terrains"], strict=True)
        if not test_terrains & set(map(parse_terrain, terrains.split()))
    }


def write_yolo_dataset(
    domain: str,
    dataset: Path,
    entries: Sequence[Entry],
    folder: Path,
    facts: Mapping[str, object],
    left_out: Sequence[tuple[str, str]] = (),
    needed: Sequence[str] = PARTS,
) -> None:
    """Link the files of the entries into `folder`, the temporary folder of `dataset`, and write the index files.

    A part in `needed` without images is an error. `facts` are additional entries of `dataset.json`, `left_out` the
    names and parts of corrupt images.
    """
    for part in PARTS:
        for kind, _ in KINDS:
            (folder / kind / part).mkdir(parents=True)
        if any(entry.mask for entry in entries if entry.part == part):
            (folder / MASKS / part).mkdir(parents=True)
    counts = {part: sum(entry.part == part for entry in entries) for part in PARTS}
    for part in needed:
        if not counts[part]:
            raise DetectError(f"no {domain} image in the {part} part", path=dataset)
    for entry in entries:
        for (kind, ending), file in zip((*KINDS, (MASKS, ".png")), (entry.image, entry.label, entry.mask), strict=True):
            if file is not None:
                share_file(file, folder / kind / entry.part / f"{entry.name}{ending}")
    log.info("%s: %d train, %d val, %d test images", domain, *counts.values())
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
