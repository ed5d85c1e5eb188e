"""What detectors of cover photos are trained and tested on: strewn scenes to train on, cover photos to test on."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from polarsim.cover_photos.options import SCENE_PICTURES, VAL_SHARE
from polarsim.cover_photos.windows import terrain_of_window
from polarsim.detect.dataset import Entry, entry_of, write_dataset
from polarsim.detect.split import PARTS, TEST, TRAIN, VAL
from polarsim.errors import DetectError, LabelError, about
from polarsim.formats.files import writing_folder
from polarsim.photo import PhotoKey
from polarsim.randomness import generator
from polarsim.scenes.names import SCENE_NAME

DOMAIN = "covers"  # of the data sets


def make_cover_dataset(
    *,
    scenes: Mapping[int, Path],
    covers: Path | None,
    test: Sequence[int],
    dataset: Path,
    seed: int,
) -> None:
    """Write a data set as `detect.dataset.share_pictures` does: scenes to train and validate, cover photos to test.

    A scene lies in one part with all its pictures.

    Parameters
    ----------
    scenes : mapping of int to Path
        Folders that `render_scenes` wrote, by the terrain whose rocks they show.
    covers : Path, optional
        Folder of cover photos that `read_covers` wrote. Labels of these are not part of the data set.
    test : sequence of int
        Terrains whose cover photos are the test part; without any there is no test part.

    Raises
    ------
    DetectError
        A terrain is to be trained on and tested, a folder shows rocks of another terrain, or a part would be empty.
    """
    _check_apart(test, scenes)
    entries = [entry for terrain in sorted(scenes) for entry in _scenes(terrain, scenes[terrain], seed)]
    for path in sorted(covers.glob("*.png")) if covers else []:
        with about(path):
            if PhotoKey.parse(path.stem).terrain in test:
                entries.append(Entry(path.stem, TEST, path, None))
    with writing_folder(dataset) as folder:
        facts = {"test": sorted(test), "train": sorted(scenes)}
        write_dataset(DOMAIN, dataset, entries, folder, facts, needed=PARTS if test else (TRAIN, VAL))


def make_fine_tuning_dataset(
    *,
    scenes: Mapping[int, Path],
    windows: Path,
    test: Sequence[int],
    dataset: Path,
    seed: int,
) -> None:
    """Write a data set of windows of the cover photos of all terrains but some, and of pictures of scenes.

    Parameters
    ----------
    scenes : mapping of int to Path
        Folders that `render_scenes` wrote, by the terrain whose rocks they show.
    windows : Path
        Folder that `cut_windows` wrote.
    test : sequence of int
        Terrains that are left out.

    Raises
    ------
    DetectError
        A terrain is to be trained on and tested, a folder shows rocks of another terrain, or a part would be empty.
    """
    _check_apart(test, scenes)
    random = generator(seed, "covers", "fine tuning", *sorted(test))
    names = [path.stem for path in sorted((windows / "images").glob("*.png")) if terrain_of_window(path) not in test]
    entries = [entry_of(windows, name, VAL if random.random() < VAL_SHARE else TRAIN) for name in names]
    pictures = [entry for terrain in sorted(scenes) for entry in _scenes(terrain, scenes[terrain], seed)]
    entries += [pictures[number] for number in random.permutation(len(pictures))[:SCENE_PICTURES]]
    with writing_folder(dataset) as folder:
        facts = {"test": sorted(test), "train": sorted(scenes)}
        write_dataset(DOMAIN, dataset, entries, folder, facts, needed=(TRAIN, VAL))


def _check_apart(test: Sequence[int], trained: Collection[int]) -> None:
    both = sorted(set(test) & set(trained))
    if both:
        raise DetectError(f"terrain {both[0]:02d} is to be trained on and to be tested")


def _scenes(terrain: int, folder: Path, seed: int) -> list[Entry]:
    """Return the pictures of a terrain's rocks, whole scenes drawn for validation, at least one."""
    found: dict[int, list[str]] = {}
    for path in sorted((folder / "images").glob("*.png")):
        name = SCENE_NAME.fullmatch(path.stem)
        if not name or int(name[1]) != terrain:
            raise LabelError(f"{path.stem!r} is no picture of rocks of terrain {terrain:02d}", path=path)
        found.setdefault(int(name[2]), []).append(path.stem)
    if len(found) < 2:
        raise DetectError(f"{len(found)} scenes of terrain {terrain:02d}, at least 2 are needed", path=folder)
    order = generator(seed, "covers", "val", terrain).permutation(sorted(found))
    val = set(order[: max(1, round(VAL_SHARE * len(found)))].tolist())
    return [
        entry_of(folder, name, VAL if scene in val else TRAIN)
        for scene, names in sorted(found.items())
        for name in names
    ]
