"""What detectors of cover photos are trained and tested on: strewn scenes to train on, cover photos to test on."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

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
    val_share: float,
    val_terrains: int,
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
    val_share : float
        Share of each terrain's scenes that is the val part, where `val_terrains` is 0.
    val_terrains : int
        Terrains whose scenes are the val part.

    Raises
    ------
    DetectError
        A terrain is to be trained on and tested, a folder shows rocks of another terrain, or a part would be empty.
    """
    _check_apart(test, scenes)
    if val_terrains and val_terrains >= len(scenes):
        raise DetectError(
            f"{val_terrains} of {len(scenes)} terrains are to select the weights: none is left to train on"
        )
    order = generator(seed, "covers", "val terrains", *sorted(test)).permutation(sorted(scenes)).tolist()
    share_of = dict.fromkeys(order, 0.0 if val_terrains else val_share) | dict.fromkeys(order[:val_terrains], 1.0)
    entries = [
        entry for terrain in sorted(scenes) for entry in _scenes(terrain, scenes[terrain], share_of[terrain], seed)
    ]
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
    scene_pictures: int,
    val_share: float,
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
    scene_pictures : int
        Pictures of scenes, drawn from all of them.
    val_share : float
        Share of the windows, and of each terrain's scenes, that is the val part.

    Raises
    ------
    DetectError
        A terrain is to be trained on and tested, a folder shows rocks of another terrain, or a part would be empty.
    """
    _check_apart(test, scenes)
    random = generator(seed, "covers", "fine tuning", *sorted(test))
    names = [path.stem for path in sorted((windows / "images").glob("*.png")) if terrain_of_window(path) not in test]
    entries = [entry_of(windows, name, VAL if random.random() < val_share else TRAIN) for name in names]
    pictures = [entry for terrain in sorted(scenes) for entry in _scenes(terrain, scenes[terrain], val_share, seed)]
    entries += [pictures[number] for number in random.permutation(len(pictures))[:scene_pictures]]
    with writing_folder(dataset) as folder:
        facts = {"test": sorted(test), "train": sorted(scenes)}
        write_dataset(DOMAIN, dataset, entries, folder, facts, needed=(TRAIN, VAL))


def _check_apart(test: Sequence[int], trained: Collection[int]) -> None:
    both = sorted(set(test) & set(trained))
    if both:
        raise DetectError(f"terrain {both[0]:02d} is to be trained on and to be tested")


def _scenes(terrain: int, folder: Path, share: float, seed: int) -> list[Entry]:
    """Pictures of a terrain's rocks, whole scenes drawn for validation: at least one of a share, or all or none."""
    found: dict[int, list[str]] = {}
    for path in sorted((folder / "images").glob("*.png")):
        name = SCENE_NAME.fullmatch(path.stem)
        if not name or int(name[1]) != terrain:
            raise LabelError(f"{path.stem!r} is no picture of rocks of terrain {terrain:02d}", path=path)
        found.setdefault(int(name[2]), []).append(path.stem)
    if len(found) < 2:
        raise DetectError(f"{len(found)} scenes of terrain {terrain:02d}, at least 2 are needed", path=folder)
    order = generator(seed, "covers", "val", terrain).permutation(sorted(found))
    count = round(share * len(found)) if share in (0, 1) else min(len(found) - 1, max(1, round(share * len(found))))
    val = set(order[:count].tolist())
    return [
        entry_of(folder, name, VAL if scene in val else TRAIN)
        for scene, names in sorted(found.items())
        for name in names
    ]
