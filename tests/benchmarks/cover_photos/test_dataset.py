"""Twins become what detectors of cover photos are trained on."""

import numpy as np
import pytest

from benchmarks.cover_photos.dataset import CoverOptions, make_cover_dataset, shrink, tone_twin
from benchmarks.cover_photos.photos import read_covers
from polarsim.detect.dataset import read_pictures
from polarsim.errors import DetectError
from polarsim.formats import png, yolo
from polarsim.photo import BLACK_LEVEL, HEIGHT, WHITE_LEVEL, WIDTH
from tests.benchmarks.cover_photos.conftest import KEY


def make_twins(folder, count):
    for number in range(count):
        png.write(folder / "images" / f"03_A_30_L_v{number:02d}.png", np.full((76, 121), 1000 + number, np.uint16))
        yolo.write_boxes(folder / "labels" / f"03_A_30_L_v{number:02d}.txt", [0], [[20, 20, 40, 40]], (121, 76))
    return folder


def test_a_data_set_has_twins_to_train_and_covers_to_test_without_labels(made_release):
    read_covers(root=made_release, keys=[KEY], pictures=made_release / "photos", labels=made_release / "l.parquet")
    dataset = made_release / "dataset"
    make_cover_dataset(
        twins={3: make_twins(made_release / "T3", 20)}, covers=made_release / "photos", test=[KEY],
        dataset=dataset, imgsz=128, options=CoverOptions(val_share=0.2),
    )  # fmt: skip
    assert [len(read_pictures(dataset, part)) for part in ("train", "val", "test")] == [16, 4, 1]
    assert png.read(dataset / "images" / "test" / f"{KEY}.png").shape == (80, 128)
    assert not list((dataset / "labels" / "test").iterdir())
    name = read_pictures(dataset, "train")[0]
    assert (dataset / "labels/train" / f"{name}.txt").read_bytes() == (
        made_release / "T3" / "labels" / f"{name}.txt"
    ).read_bytes()


def test_a_terrain_is_never_both_trained_on_and_tested(made_release):
    with pytest.raises(DetectError, match="terrain 01 is to be trained on and to be tested"):
        make_cover_dataset(
            twins={1: made_release}, covers=made_release, test=[KEY], dataset=made_release / "d", imgsz=64,
            options=CoverOptions(),
        )  # fmt: skip


def test_a_terrain_without_twins_is_named(made_release):
    with pytest.raises(DetectError, match="T4: no varied twins"):
        make_cover_dataset(
            twins={3: make_twins(made_release / "T3", 3), 4: made_release / "T4"}, covers=made_release, test=[KEY],
            dataset=made_release / "d", imgsz=64, options=CoverOptions(),
        )  # fmt: skip


def test_tones_go_from_black_to_white_whatever_the_curve(rng):
    pixels = np.full((60, 90), BLACK_LEVEL, np.uint16)
    pixels[:, 45:] = WHITE_LEVEL
    picture = tone_twin(pixels, 90, CoverOptions(strokes=0), rng)
    assert (picture[:, :40] == 0).all()
    assert (picture[:, 50:] == 255).all()


def test_a_shrunk_photo_keeps_its_shape_and_mean(rng):
    photo = rng.integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8)
    small = shrink(photo, 484)
    assert small.shape == (304, 484)
    assert small.mean() == pytest.approx(photo.mean(), abs=0.6)
