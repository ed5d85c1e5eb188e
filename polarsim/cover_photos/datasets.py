"""Data sets of detectors for cover photos: scenes or windows of photos and twins for training, photos for the test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from polarsim.cover_photos.options import SCENE_PICTURES, VAL_SHARE
from polarsim.cover_photos.windows import terrain_of_window
from polarsim.detect.dataset import Entry, image_entry, write_yolo_dataset
from polarsim.detect.split import PARTS, TEST, TRAIN, VAL
from polarsim.errors import DetectError, LabelError, with_path
from polarsim.formats.files import writing_folder
from polarsim.photo import PhotoKey, Terrain, parse_terrain, terrain_text
from polarsim.randomness import generator
from polarsim.scenes.options import SCENE_NAME

DOMAIN = "covers"  # domain of the data sets


def make_cover_dataset(
    *, scenes: Mapping[Terrain, Path], covers: Path | None, test: Sequence[Terrain], dataset: Path, seed: int
) -> None:
    """Write a data set of scenes for training and validation, and cover photos for the test.

    All images of a scene are in the same part. The layout is described in `detect.dataset.share_pictures`.

    Parameters
    ----------
    scenes : mapping of Terrain to Path
        Folders written by `render_scenes`, by the terrain of the rocks.
    covers : Path, optional
        Folder of cover photos written by `read_covers`. The data set does not include their labels.
    test : sequence of Terrain
        Test terrains. If empty, the data set has no test part.
    """
    entries = _all_scenes(scenes, test, seed)
    for path in sorted(covers.glob("*.png")) if covers else []:
        with with_path(path):
            if PhotoKey.parse(path.stem).terrain in test:
                entries.append(Entry(path.stem, TEST, path, None))
    _write(scenes, test, dataset, entries, PARTS if test else (TRAIN, VAL))


def make_fine_tuning_dataset(
    *, scenes: Mapping[Terrain, Path], windows: Path, test: Sequence[Terrain], dataset: Path, seed: int
) -> None:
    """Write a data set of windows of cover photos (`cut_windows`) without test terrains, and of images of scenes."""
    pictures = _all_scenes(scenes, test, seed)
    random = generator(seed, "covers", "fine tuning", *sorted(test))
    names = _windows_without(windows, test)
    entries = [image_entry(windows, name, VAL if random.random() < VAL_SHARE else TRAIN) for name in names]
    entries += [pictures[number] for number in random.permutation(len(pictures))[:SCENE_PICTURES]]
    _write(scenes, test, dataset, entries, (TRAIN, VAL))


def make_twin_dataset(
    *, domain: str, pictures: Path, windows: Path, test: Sequence[Terrain], dataset: Path, seed: int
) -> None:
    """Write a data set of a domain of `pair_covers_with_twins`, with entire images without labels for the test.

    Windows (`cut_windows`) of the same images are in the training part or the validation part, except windows of test
    terrains. The part of a window is equal in all domains.
    """
    names = _windows_without(windows, test)
    order = generator(seed, "covers", "domains", *sorted(test)).permutation(len(names))
    val = set(order[: max(1, round(VAL_SHARE * len(names)))].tolist())
    entries = [image_entry(windows, name, VAL if number in val else TRAIN) for number, name in enumerate(names)]
    for path in sorted(pictures.glob("*.png")):
        with with_path(path):
            if PhotoKey.parse(path.stem).terrain in test:
                entries.append(Entry(path.stem, TEST, path, None))
    with writing_folder(dataset) as folder:
        write_yolo_dataset(domain, dataset, entries, folder, {"test": sorted(test)})


def _windows_without(windows: Path, test: Sequence[Terrain]) -> list[str]:
    """Return the sorted names of the windows without windows of test terrains."""
    return [path.stem for path in sorted((windows / "images").glob("*.png")) if terrain_of_window(path) not in test]


def _write(
    scenes: Mapping[Terrain, Path],
    test: Sequence[Terrain],
    dataset: Path,
    entries: Sequence[Entry],
    needed: Sequence[str],
) -> None:
    with writing_folder(dataset) as folder:
        facts = {"test": sorted(test), "train": sorted(scenes)}
        write_yolo_dataset(DOMAIN, dataset, entries, folder, facts, needed=needed)


def _all_scenes(scenes: Mapping[Terrain, Path], test: Sequence[Terrain], seed: int) -> list[Entry]:
    """Return the images of all scenes, none of which may have rocks of a test terrain."""
    if shared := sorted(set(test) & set(scenes)):
        raise DetectError(f"terrain {terrain_text(shared[0])} is in both training and test, remove it from one of them")
    return [entry for terrain in sorted(scenes) for entry in _scenes(terrain, scenes[terrain], seed)]


def _scenes(terrain: Terrain, folder: Path, seed: int) -> list[Entry]:
    """Return the images of the scenes of a terrain; a random share of the scenes, at least one, is for validation."""
    images: dict[int, list[str]] = {}
    for path in sorted((folder / "images").glob("*.png")):
        name = SCENE_NAME.fullmatch(path.stem)
        if not name or parse_terrain(name[1]) != terrain:
            raise LabelError(f"{path.stem!r} is not an image of rocks of terrain {terrain_text(terrain)}", path=path)
        images.setdefault(int(name[2]), []).append(path.stem)
    if len(images) < 2:
        raise DetectError(f"{len(images)} scenes of terrain {terrain_text(terrain)}, expected at least 2", path=folder)
    order = generator(seed, "covers", "val", terrain).permutation(sorted(images))
    val = set(order[: max(1, round(VAL_SHARE * len(images)))].tolist())
    return [
        image_entry(folder, name, VAL if scene in val else TRAIN)
        for scene, names in sorted(images.items())
        for name in names
    ]
