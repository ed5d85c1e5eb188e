"""Selection of the seeds: the label files from which propagation starts."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from polarsim.acquire.options import NO_SEEDS, SeedOptions
from polarsim.errors import FormatError, LabelError
from polarsim.formats import class_lists, release
from polarsim.formats.files import writing_folder
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey, Terrain, by_bracket, terrain_text
from polarsim.site import Site

if TYPE_CHECKING:
    import numpy as np  # a plan needs the paths of seeds only

log = logging.getLogger("polarsim")


def best_exposure(boxes: Mapping[PhotoKey, int], usual_exposure_ms: int) -> PhotoKey:
    """Return the photo of an exposure bracket with most boxes; ties: nearest to the usual exposure, then the longer."""

    def rank(key: PhotoKey) -> tuple[int, float, int]:
        return boxes[key], -key.stops_from(usual_exposure_ms), key.exposure_ms

    return max(boxes, key=rank)


def find_labels(
    root: Path, terrain: Terrain, key_of: release.KeyOf = PhotoKey.parse
) -> tuple[dict[PhotoKey, Path], Path]:
    """Return the label files of a terrain and their folder.

    Parameters
    ----------
    root : Path
        A folder in the layout of the release, or a folder of label files. In the layout of the release, polygons are
        used for terrains without boxes.
    """
    if not root.is_dir():
        reason = "a file, expected a folder of label files" if root.exists() else "no such folder of label files"
        raise FormatError(f"{reason}; `labels.seeds: {NO_SEEDS}` runs without seeds", path=root)
    if not any((root / name).is_dir() for name in (release.BOXES, release.POLYGONS)):
        files = release.key_files(root, key_of).files
        return {key: path for key, path in files.items() if key.terrain == terrain}, root
    boxes = release.label_files(root, terrain, key_of)
    if not boxes and (polygons := release.polygon_files(root, terrain, key_of)):
        return polygons, release.polygon_folder(root, terrain)
    return boxes, release.label_folder(root, terrain)


def no_seed_error(
    terrain: Terrain, options: SeedOptions, files: Mapping[PhotoKey, Path], folder: Path, key_of: release.KeyOf
) -> LabelError:
    """Return the error for a terrain without seeds.

    Parameters
    ----------
    files
        Label files of the terrain; the options exclude all of them.
    folder
        Folder in which label files were searched.
    """
    selection = (
        f"light {options.light}, azimuth {', '.join(options.azimuths or ['any'])}, camera {options.camera}, "
        f"exposure {options.exposure}"
    )
    reason = f"no seed of terrain {terrain_text(terrain)} ({selection}) among {len(files)} label files"
    if stray := [path.name for path in release.key_files(folder, key_of).stray if path.suffix.lower() == ".txt"]:
        reason += f"; the names of {len(stray)} text files are no photo keys, such as {stray[0]!r}"
    return LabelError(f"{reason}; `labels.seeds: {NO_SEEDS}` runs without seeds", path=folder)


def choose_seed_files(
    site: Site, files: Mapping[PhotoKey, Path], positions: Sequence[str], options: SeedOptions
) -> list[tuple[PhotoKey, Path]]:
    """Return at most a single file per exposure bracket, sorted by photo key."""
    from polarsim.formats import yolo  # imports NumPy

    possible = [
        key
        for key in files
        if key.position in positions and options.allow(key) and options.exposure in ("best", key.exposure_ms)
    ]
    names, size = cache(_stated_names), site.images.size
    chosen = [
        best_exposure(
            {key: len(yolo.read_boxes_or_polygons(files[key], size, names(files[key].parent))[0]) for key in keys},
            site.usual_exposure_ms,
        )
        for keys in by_bracket(possible).values()
    ]
    return [(key, files[key]) for key in sorted(chosen)]


def _stated_names(folder: Path) -> tuple[str, ...] | None:
    """Return the names of the class numbers in a folder; None without a class list."""
    classes = class_lists.find_classes(folder)
    return classes.names if classes.path else None


def copy_seeds(chosen: Sequence[tuple[PhotoKey, Path]], seeds: Path, size: tuple[int, int]) -> None:
    """Replace the folder of seeds by the chosen files, as boxes (also of polygons) in the same number format.

    `size`: width and height of the photos, px.

    Shadows that are rocks in photos of other azimuths are changed to rocks, because a file with swapped classes causes
    errors of cameras and labels.
    """
    from polarsim.formats import yolo

    names = cache(_stated_names)  # labelImg changes the order of the classes in classes.txt
    annotated = {key: yolo.read_boxes_or_polygons(path, size, names(path.parent)) for key, path in chosen}
    with writing_folder(seeds) as folder:
        for key, (_, boxes) in annotated.items():
            yolo.write_boxes(folder / f"{key}.txt", _unswapped(key, annotated), boxes, size)


def _unswapped(key: PhotoKey, annotated: Mapping[PhotoKey, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the classes (n,) of a seed, with shadows changed to rocks if at least two other azimuths show rocks."""
    from polarsim.geometry.consensus import find_rocks_labelled_shadow

    rock, shadow = BOX_CLASSES.index(ROCK), BOX_CLASSES.index(SHADOW)
    classes, boxes = annotated[key]
    rocks_of_other_azimuths = [
        other_boxes[numbers == rock]
        for other, (numbers, other_boxes) in annotated.items()
        if other.view == key.view and other.light == key.light and other.azimuth != key.azimuth
    ]
    (shadows,) = (classes == shadow).nonzero()
    swapped = shadows[find_rocks_labelled_shadow(boxes[shadows], boxes[classes == rock], rocks_of_other_azimuths)]
    if len(swapped):
        log.warning(
            "%s: %d of %d shadows changed to rocks, because photos of other azimuths have rocks at the same places: "
            "`polarsim validate` lists them",
            key, len(swapped), len(shadows),
        )  # fmt: skip
    corrected = classes.copy()
    corrected[swapped] = rock
    return corrected
