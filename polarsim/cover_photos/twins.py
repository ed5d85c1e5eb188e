"""Cover photos and their twins as 8-bit images with labels, for detectors trained on each domain."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from polarsim.detect import tone
from polarsim.detect.external_sets import identify
from polarsim.detect.pictures import picture_paths
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.formats.files import share_file, writing_folder
from polarsim.photo import FIRST_ID_WITHOUT_MESH, NO_ROCK, ROCK, PhotoKey, Terrain

_SAME_OBJECT_IOU = 0.5  # minimum IoU of a human box and the run's box of the same object
log = logging.getLogger("polarsim")


def pair_covers_with_twins(
    *,
    photos: Path,
    annotated: Path,
    propagated: Path,
    twins: Mapping[str, Path],
    rendered: Path,
    photo_domain: str,
    pictures: Mapping[str, Path],
    labels: Mapping[str, Path],
) -> None:
    """Write the images and labels of each domain for the cover photos with a twin of every model.

    Twins are converted with the tone curve of detectors. Cover photos without a twin are skipped with a warning.

    Parameters
    ----------
    photos, annotated : Path
        Folder of cover photos and table of human boxes, written by `read_covers`.
    propagated : Path
        Label table of the run. The human boxes get the rock ids of overlapping boxes.
    twins : mapping of str to Path
        Folders above `TerrainTT/KEY.png`, by reflectance model.
    rendered : Path
        Table of the exact labels of the twins.
    pictures, labels : mapping of str to Path
        Folder of `KEY.png` and label table to write, for `photo_domain` and every model.
    """
    keys = photo_keys(photos)
    found = {model: picture_paths(folder, keys) for model, folder in twins.items()}
    paired = [key for key in keys if all(key in paths for paths in found.values())]
    for key in sorted(set(keys) - set(paired)):
        model = next(model for model, paths in found.items() if key not in paths)
        log.warning("%s: cover photo without a %s twin, skipped", key, model)
    if len({key.terrain for key in paired}) < 2:
        raise DetectError(
            f"{len(paired)} of {len(keys)} cover photos have twins, expected photos of at least 2 terrains", path=photos
        )
    names = [str(key) for key in paired]
    human, own, exact = (
        table[table["key"].isin(names)].reset_index(drop=True)
        for table in (tables.read_parquet(path, tables.LABEL_COLUMNS) for path in (annotated, propagated, rendered))
    )
    human = with_rock_ids(human, own)
    rocks = human[human["kind"] == ROCK]
    log.info("%d of %d annotated rocks have a mesh", int(_has_mesh(rocks["rock"]).sum()), len(rocks))
    with writing_folder(pictures[photo_domain]) as folder:
        for name in names:
            share_file(photos / f"{name}.png", folder / f"{name}.png")
    tables.write_parquet(labels[photo_domain], tables.label_table(human))
    for model, paths in found.items():
        _write_twins({key: paths[key] for key in paired}, exact, pictures[model], labels[model])


def convert_control(*, photos: Path, twins: Path, rendered: Path, pictures: Path, labels: Path) -> None:
    """Write the images and labels of the control for the photos of `pair_covers_with_twins`.

    Parameters
    ----------
    photos : Path
        Folder of the paired cover photos.
    twins : Path
        Folder above `TerrainTT/KEY.png`. A photo without a twin is an error.
    rendered : Path
        Table of the exact labels of these twins.
    """
    keys = photo_keys(photos)
    found = picture_paths(twins, keys)
    if missing := sorted(set(keys) - set(found)):
        raise DetectError(f"no twin of {missing[0]}, expected a twin of each cover photo", path=twins)
    exact = tables.read_parquet(rendered, tables.LABEL_COLUMNS)
    _write_twins(found, exact[exact["key"].isin(map(str, keys))], pictures, labels)


def photo_keys(photos: Path, terrain: Terrain | None = None) -> list[PhotoKey]:
    """Return the sorted keys of a folder of `KEY.png`, of one terrain or of all terrains."""
    keys = [PhotoKey.parse(path.stem) for path in sorted(photos.glob("*.png"))]
    return [key for key in keys if terrain in (None, key.terrain)]


def _write_twins(twins: Mapping[PhotoKey, Path], exact: pd.DataFrame, pictures: Path, labels: Path) -> None:
    with writing_folder(pictures) as folder:
        for key, path in twins.items():
            png.write_png(folder / f"{key}.png", tone.to_8_bits(png.read_photo(path, None)))
    tables.write_parquet(labels, tables.label_table(exact))


def with_rock_ids(boxes: pd.DataFrame, identified: pd.DataFrame) -> pd.DataFrame:
    """Return the label table `boxes` with the rock ids of the boxes of `identified` in the same photo and of its kind.

    Boxes are matched one to one at an IoU of at least 0.5. Unmatched boxes have no rock id.
    """
    numbered, others = identify(boxes, identified, _SAME_OBJECT_IOU)
    rocks = pd.Series(identified["rock"].to_numpy(int), others["rock"].to_numpy(int))  # by common number
    return boxes.assign(rock=numbered["rock"].map(rocks).fillna(NO_ROCK).to_numpy(int))


def _has_mesh(rocks: pd.Series) -> pd.Series:
    return (rocks != NO_ROCK) & (rocks < FIRST_ID_WITHOUT_MESH)
