"""Scenes and cover photos become a data set that leaks neither terrains nor scenes."""

import re

import numpy as np
import pytest

from polarsim.cover_photos.datasets import make_cover_dataset
from polarsim.detect.dataset import read_pictures
from polarsim.errors import DetectError, LabelError
from polarsim.formats import png, yolo
from polarsim.scenes.names import scene_name
from tests.cover_photos.conftest import KEY


def make_scenes(folder, terrain, scenes, lamps=3):
    for scene in range(scenes):
        for lamp in range(lamps):
            name = scene_name(terrain, scene, lamp)
            png.write(folder / "images" / f"{name}.png", np.full((80, 128), scene, np.uint8))
            yolo.write_boxes(folder / "labels" / f"{name}.txt", [0], [[20, 20, 40, 40]], (128, 80))
    return folder


@pytest.fixture
def covers(tmp_path):
    for key in (str(KEY), "03_A_off_30_R_0256"):
        png.write(tmp_path / "photos" / f"{key}.png", np.zeros((80, 128), np.uint8))
    return tmp_path / "photos"


def test_a_data_set_has_scenes_to_train_and_covers_to_test_without_labels(tmp_path, covers):
    dataset = tmp_path / "dataset"
    make_cover_dataset(
        scenes={3: make_scenes(tmp_path / "T3", 3, 20), 4: make_scenes(tmp_path / "T4", 4, 10)},
        covers=covers, test=[1], dataset=dataset, val_share=0.2, val_terrains=0, seed=0,
    )  # fmt: skip
    assert [len(read_pictures(dataset, part)) for part in ("train", "val", "test")] == [72, 18, 1]
    assert read_pictures(dataset, "test") == [str(KEY)]
    assert not list((dataset / "labels" / "test").iterdir())
    name = read_pictures(dataset, "train")[0]
    assert (dataset / "labels/train" / f"{name}.txt").samefile(tmp_path / "T3/labels" / f"{name}.txt")


def test_no_rock_of_a_tested_terrain_and_no_scene_on_both_sides(tmp_path, covers):
    """By the files themselves, not by what the code says about itself."""
    scenes = {terrain: make_scenes(tmp_path / f"T{terrain}", terrain, 8) for terrain in (1, 3, 4)}
    source = {path.stat().st_ino: path for folder in scenes.values() for path in (folder / "images").iterdir()}
    for tested in (1, 3):
        dataset = tmp_path / f"dataset{tested}"
        make_cover_dataset(
            scenes={terrain: folder for terrain, folder in scenes.items() if terrain != tested},
            covers=covers, test=[tested], dataset=dataset, val_share=0.3, val_terrains=0, seed=5,
        )  # fmt: skip
        behind = {
            part: [source[path.stat().st_ino] for path in (dataset / "images" / part).iterdir()]
            for part in ("train", "val")
        }
        assert {path.parent.parent.name for path in behind["train"] + behind["val"]} == {
            f"T{terrain}" for terrain in scenes if terrain != tested
        }
        in_part = {part: {re.match(r"t\d+_s\d+", path.name)[0] for path in paths} for part, paths in behind.items()}
        assert not in_part["train"] & in_part["val"]
        assert min(map(len, in_part.values())) > 0


def test_a_terrain_is_never_both_trained_on_and_tested(tmp_path, covers):
    with pytest.raises(DetectError, match="terrain 01 is to be trained on and to be tested"):
        make_cover_dataset(
            scenes={1: tmp_path}, covers=covers, test=[1], dataset=tmp_path / "d", val_share=0.1, val_terrains=0, seed=0
        )


def test_scenes_of_another_terrains_rocks_are_refused(tmp_path, covers):
    wrong = make_scenes(tmp_path / "T3", 1, 4)
    with pytest.raises(LabelError, match="no picture of rocks of terrain 03"):
        make_cover_dataset(
            scenes={3: wrong}, covers=covers, test=[1], dataset=tmp_path / "d", val_share=0.1, val_terrains=0, seed=0
        )


@pytest.mark.parametrize(
    ("scenes", "test", "error"), [(1, [1], "1 scenes of terrain 03"), (4, [2], "no covers picture in the test part")]
)
def test_what_is_missing_is_named(tmp_path, covers, scenes, test, error):
    with pytest.raises(DetectError, match=error):
        make_cover_dataset(
            scenes={3: make_scenes(tmp_path / "T3", 3, scenes)}, covers=covers, test=test, dataset=tmp_path / "d",
            val_share=0.1, val_terrains=0, seed=0,
        )  # fmt: skip


def test_weights_can_be_chosen_by_terrains_that_are_not_trained_on(tmp_path, covers):
    scenes = {terrain: make_scenes(tmp_path / f"T{terrain}", terrain, 4) for terrain in (3, 4, 8)}
    chosen = {}
    for seed in range(8):
        dataset = tmp_path / f"dataset{seed}"
        make_cover_dataset(
            scenes=scenes, covers=covers, test=[1], dataset=dataset, val_share=0.1, val_terrains=1, seed=seed
        )
        terrains = {part: {name[:3] for name in read_pictures(dataset, part)} for part in ("train", "val")}
        assert [len(names) for names in terrains.values()] == [2, 1]
        assert not terrains["train"] & terrains["val"]
        chosen[seed] = terrains["val"].pop()
    assert len(set(chosen.values())) > 1
    with pytest.raises(DetectError, match="none is left to train on"):
        make_cover_dataset(
            scenes=scenes, covers=covers, test=[1], dataset=tmp_path / "d", val_share=0.1, val_terrains=3, seed=0
        )
