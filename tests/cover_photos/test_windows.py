"""Windows of labelled cover photos agree with their labels and exclude test terrains."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.cover_photos.datasets import make_fine_tuning_dataset
from polarsim.cover_photos.photos import annotation_rows
from polarsim.cover_photos.windows import cut_windows
from polarsim.detect.dataset import dataset_images
from polarsim.detect.training_windows import draw_windows
from polarsim.errors import DetectError, PolarsimError
from polarsim.formats import png, tables, yolo
from polarsim.photo import PhotoKey
from polarsim.run_files import class_masks
from tests.cover_photos.test_datasets import make_scenes
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

KEYS = ("01_A_off_30_L_0256", "01_C_off_30_L_0256", "03_A_off_30_R_0256")
BOXES = np.array([[400.0, 300, 800, 700], [1200, 800, 1500, 1000]])
BRIGHT = 200


def photo_of(boxes):
    photo = np.zeros((HEIGHT, WIDTH), np.uint8)
    for x0, y0, x1, y1 in boxes.astype(int):
        photo[y0:y1, x0:x1] = BRIGHT
    return photo


@pytest.fixture
def covers(tmp_path):
    """Three labelled photos of two terrains with two bright rocks each."""
    rows = []
    for key in KEYS:
        png.write_png(tmp_path / "photos" / f"{key}.png", photo_of(BOXES))
        yolo.write_boxes(tmp_path / f"{key}.txt", [0, 1], BOXES, size=SIZE)
        rows += annotation_rows(PhotoKey.parse(key), tmp_path / f"{key}.txt", (WIDTH, HEIGHT))
    tables.write_parquet(tmp_path / "labels.parquet", tables.label_table(rows))
    return {"photos": tmp_path / "photos", "labels": tmp_path / "labels.parquet"}


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from([128, 512, 1280]))
def test_a_window_is_bright_where_its_boxes_are_and_dark_elsewhere(seed, width):
    """Except for objects cut off too much for a box."""
    random = np.random.default_rng(seed)
    drawn = list(draw_windows(photo_of(BOXES), np.array([0, 1]), BOXES, range(11), width, 1024, random))
    assert {window.pixels.shape for window in drawn} == {(round(width * HEIGHT / WIDTH), width)}
    assert [len(drawn[number].boxes) for number in (0, 10)] == [2, 2]  # the entire photo
    for window in drawn:
        inside = np.zeros(window.pixels.shape, bool)
        for (x0, y0, x1, y1), kind in zip(window.boxes, window.classes, strict=True):
            shown = window.pixels[int(np.ceil(y0)) : int(y1), int(np.ceil(x0)) : int(x1)]
            assert shown.min(initial=BRIGHT) == BRIGHT
            assert kind in (0, 1)
            inside[int(y0) : int(np.ceil(y1)), int(x0) : int(np.ceil(x1))] = True
        left = window.pixels[~inside] > 0
        assert not left.any() or len(window.boxes) < 2


def test_windows_do_not_depend_on_the_location(covers, tmp_path):
    for name in ("one", "two"):
        cut_windows(**covers, windows=tmp_path / name, size=(WIDTH, HEIGHT), count=3, stored_px=64, seed=4)
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*"))
    assert len(files) == 3 * 3 * len(KEYS)
    assert all((tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes() for path in files)
    mask = class_masks.read_class_mask(tmp_path / "one/masks" / f"{KEYS[0]}_w02.png")
    assert mask.shape == (40, 64)
    assert (mask == class_masks.IGNORED).all()


def test_no_window_of_a_tested_terrain_is_trained_on(covers, tmp_path, monkeypatch):
    monkeypatch.setattr("polarsim.cover_photos.datasets.SCENE_PICTURES", 12)
    cut_windows(**covers, windows=tmp_path / "windows", size=(WIDTH, HEIGHT), count=10, stored_px=64, seed=0)
    scenes = {3: make_scenes(tmp_path / "T3", 3, 10)}
    dataset = tmp_path / "dataset"
    fine_tuning = {"windows": tmp_path / "windows", "dataset": dataset, "seed": 0}
    make_fine_tuning_dataset(scenes=scenes, test=[1], **fine_tuning)
    names = [name for part in ("train", "val") for name in dataset_images(dataset, part)]
    assert sum(name.startswith("t03_") for name in names) == 12
    assert sum(name.startswith(KEYS[2]) for name in names) == 10
    assert len(names) == 22  # none of terrain 1
    assert not dataset_images(dataset, "test")
    with pytest.raises(DetectError):
        make_fine_tuning_dataset(scenes=scenes, test=[3], **fine_tuning)


def test_an_invalid_window_name_is_an_error(tmp_path):
    png.write_png(tmp_path / "windows/images/photo.png", np.zeros((40, 64), np.uint8))
    with pytest.raises(PolarsimError) as error:
        make_fine_tuning_dataset(
            scenes={3: make_scenes(tmp_path / "T3", 3, 4)}, windows=tmp_path / "windows", test=[1],
            dataset=tmp_path / "dataset", seed=0,
        )  # fmt: skip
    assert error.value.path == tmp_path / "windows/images/photo.png"
