"""The seeds: the few label files that propagation starts from, chosen by rule among all that are there."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np

from polarsim.acquire.options import NO_SEEDS, SeedOptions
from polarsim.errors import FormatError, LabelError
from polarsim.formats import release, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.consensus import rocks_called_shadows
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey, by_bracket

log = logging.getLogger("polarsim")


def best_exposure(boxes: Mapping[PhotoKey, int]) -> PhotoKey:
    """The photo of an exposure bracket with most boxes; then that nearest the usual one, then the longer."""

    def rank(key: PhotoKey) -> tuple[int, float, int]:
        return boxes[key], -key.stops_off_usual, key.exposure_ms

    return max(boxes, key=rank)


def find_labels(root: Path, terrain: int) -> tuple[dict[PhotoKey, Path], Path]:
    """Return the label files of a terrain and their folder.

    Parameters
    ----------
    root : Path
        A folder in the layout of the release, or a folder of label files. In the release's layout, polygons are used
        for a terrain without boxes.

    Raises
    ------
    FormatError
        No such folder.
    """
    if not root.is_dir():
        reason = "a file, expected a folder of label files" if root.exists() else "no such folder of label files"
        raise FormatError(f"{reason}; `labels.seeds: {NO_SEEDS}` runs without seeds", path=root)
    if not any((root / name).is_dir() for name in (release.BOXES, release.POLYGONS)):
        return {key: path for key, path in release.key_files(root).files.items() if key.terrain == terrain}, root
    boxes = release.label_files(root, terrain)
    if not boxes and (polygons := release.polygon_files(root, terrain)):
        return polygons, release.polygon_folder(root, terrain)
    return boxes, release.label_folder(root, terrain)


def no_seed_error(terrain: int, options: SeedOptions, files: Mapping[PhotoKey, Path], folder: Path) -> LabelError:
    """Return the error for a terrain without a single seed.

    Parameters
    ----------
    files
        The label files of the terrain, none of which the options allow.
    folder
        The folder in which label files were searched.
    """
    wanted = (
        f"light {options.light}, azimuth {', '.join(options.azimuths)}, camera {options.camera}, "
        f"exposure {options.exposure}"
    )
    reason = f"no seed of terrain {terrain:02d} ({wanted}) among {len(files)} label files"
    if stray := [path.name for path in release.key_files(folder).stray if path.suffix.lower() == ".txt"]:
        reason += f"; {len(stray)} text files have no photo key as name, such as {stray[0]!r}"
    return LabelError(f"{reason}; `labels.seeds: {NO_SEEDS}` runs without seeds", path=folder)


def choose_seeds(
    files: Mapping[PhotoKey, Path], positions: Sequence[str], options: SeedOptions
) -> list[tuple[PhotoKey, Path]]:
    """At most one file an exposure bracket, by key.

    Raises
    ------
    FormatError
        A file that might be a seed is broken.
    """
    possible = [
        key
        for key in files
        if key.position in positions and options.allow(key) and options.exposure in ("best", key.exposure_ms)
    ]
    names = cache(_stated_names)
    chosen = [
        best_exposure({key: len(yolo.read_boxes_or_polygons(files[key], names(files[key].parent))[0]) for key in keys})
        for keys in by_bracket(possible).values()
    ]
    return [(key, files[key]) for key in sorted(chosen)]


def _stated_names(folder: Path) -> tuple[str, ...] | None:
    """Names of the class numbers in a folder; None without a class list."""
    classes = yolo.find_classes(folder)
    return classes.names if classes.path else None


def copy_seeds(chosen: Sequence[tuple[PhotoKey, Path]], seeds: Path) -> None:
    """Write the chosen files anew as the folder's only content: boxes, also of polygons, all in one number format.

    Shadows that other azimuths show to be rocks become rocks: one such file would mislead cameras and labels alike.
    """
    names = cache(_stated_names)  # labelImg writes its own order into classes.txt
    annotated = {key: yolo.read_boxes_or_polygons(path, names(path.parent)) for key, path in chosen}
    with writing_folder(seeds) as folder:
        for key, (_, boxes) in annotated.items():
            yolo.write_boxes(folder / f"{key}.txt", _unswapped(key, annotated), boxes)


def _unswapped(key: PhotoKey, annotated: Mapping[PhotoKey, tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """(n,) classes of a seed, put right where at least two other azimuths of its view tell otherwise."""
    rock, shadow = BOX_CLASSES.index(ROCK), BOX_CLASSES.index(SHADOW)
    classes, boxes = annotated[key]
    elsewhere = [
        others[numbers == rock]
        for other, (numbers, others) in annotated.items()
        if other.view == key.view and other.light == key.light and other.azimuth != key.azimuth
    ]
    shadows = np.flatnonzero(classes == shadow)
    swapped = shadows[rocks_called_shadows(boxes[shadows], boxes[classes == rock], elsewhere)]
    if len(swapped):
        log.warning(
            "%s: %d of %d shadows lie where other azimuths have rocks, taken for rocks: `polarsim validate` lists them",
            key, len(swapped), len(shadows),
        )  # fmt: skip
    right = classes.copy()
    right[swapped] = rock
    return right
