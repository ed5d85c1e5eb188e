"""Data sets of scenes and cover photos share no terrains or scenes between parts."""

import re

import numpy as np
import pytest

from polarsim.cover_photos.datasets import make_cover_dataset, make_twin_dataset
from polarsim.detect.dataset import dataset_images, read_parts
from polarsim.errors import DetectError, LabelError
from polarsim.formats import png, yolo
from tests.cover_photos.conftest import KEY


def make_scenes(folder, terrain, scenes, lamps=3):
    for scene in range(scenes):
        for lamp in range(lamps):
            name = f"t{terrain:02d}_s{scene:03d}_l{lamp}"
            png.write_png(folder / "images" / f"{name}.png", np.full((80, 128), scene, np.uint8))
            yolo.write_boxes(folder / "labels" / f"{name}.txt", [0], [[20, 20, 40, 40]], (128, 80))
    return folder


@pytest.fixture
def covers(tmp_path):
    for key in (str(KEY), "03_A_off_30_R_0256"):
        png.write_png(tmp_path / "photos" / f"{key}.png", np.zeros((80, 128), np.uint8))
    return tmp_path / "photos"


def test_a_data_set_has_scenes_to_train_and_covers_to_test_without_labels(tmp_path, covers):
    dataset = tmp_path / "dataset"
    make_cover_dataset(
        scenes={3: make_scenes(tmp_path / "T3", 3, 20), 4: make_scenes(tmp_path / "T4", 4, 10)},
        covers=covers, test=[1], dataset=dataset, seed=0,
    )  # fmt: skip
    assert [len(dataset_images(dataset, part)) for part in ("train", "val", "test")] == [81, 9, 1]
    assert dataset_images(dataset, "test") == [str(KEY)]
    assert not list((dataset / "labels" / "test").iterdir())
    name = dataset_images(dataset, "train")[0]
    assert (dataset / "labels/train" / f"{name}.txt").samefile(tmp_path / "T3/labels" / f"{name}.txt")


def test_parts_share_no_terrain_and_no_scene(tmp_path, covers):
    """Checks the files, not the index."""
    scenes = {terrain: make_scenes(tmp_path / f"T{terrain}", terrain, 8) for terrain in (1, 3, 4)}
    source = {path.stat().st_ino: path for folder in scenes.values() for path in (folder / "images").iterdir()}
    for tested in (1, 3):
        dataset = tmp_path / f"dataset{tested}"
        make_cover_dataset(
            scenes={terrain: folder for terrain, folder in scenes.items() if terrain != tested},
            covers=covers, test=[tested], dataset=dataset, seed=5,
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


@pytest.mark.parametrize(
    ("shown", "scenes", "test", "error"),
    [(3, 4, [3], DetectError), (1, 4, [1], LabelError), (3, 1, [1], DetectError), (3, 4, [2], DetectError)],
    ids=["trained on and tested", "another terrain's rocks", "one scene", "no cover photo to test on"],
)
def test_invalid_data_sets_are_an_error(tmp_path, covers, shown, scenes, test, error):
    folder = make_scenes(tmp_path / "T3", shown, scenes)
    with pytest.raises(error):
        make_cover_dataset(scenes={3: folder}, covers=covers, test=test, dataset=tmp_path / "d", seed=0)


def make_domain(folder):
    """Write pictures and windows of two terrains."""
    keys = ("01_A_off_30_L_0256", "03_A_off_30_R_0256", "04_C_off_350_L_0256")
    for key in keys:
        png.write_png(folder / "pictures" / f"{key}.png", np.zeros((80, 128), np.uint8))
        for number in range(20):
            name = f"{key}_w{number:02d}"
            png.write_png(folder / "windows/images" / f"{name}.png", np.full((80, 128), number, np.uint8))
            yolo.write_boxes(folder / "windows/labels" / f"{name}.txt", [0], [[20, 20, 40, 40]], (128, 80))
    return folder


def test_windows_of_a_domain_exclude_test_terrains_and_have_equal_parts_in_all_domains(tmp_path):
    parts = []
    for domain in ("real", "hapke"):
        made, dataset = make_domain(tmp_path / domain), tmp_path / f"dataset_{domain}"
        make_twin_dataset(
            domain=domain, pictures=made / "pictures", windows=made / "windows", test=[1, 4], dataset=dataset, seed=0
        )
        parts.append(read_parts(dataset))
    assert parts[0] == parts[1]
    assert parts[0]["test"] == ["01_A_off_30_L_0256", "04_C_off_350_L_0256"]
    assert {name[:2] for part in ("train", "val") for name in parts[0][part]} == {"03"}
    assert len(parts[0]["train"]) + len(parts[0]["val"]) == 20
    assert not list((tmp_path / "dataset_real/labels/test").iterdir())


def test_a_domain_without_photos_of_the_test_terrains_is_an_error(tmp_path):
    made = make_domain(tmp_path / "real")
    with pytest.raises(DetectError):
        make_twin_dataset(
            domain="real",
            pictures=made / "pictures",
            windows=made / "windows",
            test=[2],
            dataset=tmp_path / "d",
            seed=0,
        )
