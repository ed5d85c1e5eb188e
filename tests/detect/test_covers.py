"""Cover photos become a test set, paired with their labels; twins become what judges of it are trained on."""

import numpy as np
import pandas as pd
import pytest

from polarsim.detect.covers import (
    CoverOptions,
    cover_figures,
    make_cover_dataset,
    pair_covers,
    read_covers,
    shrink,
    tone_twin,
)
from polarsim.detect.dataset import read_pictures
from polarsim.detect.strokes import REDS, draw_strokes
from polarsim.errors import DetectError
from polarsim.formats import png, tables, yolo
from polarsim.photo import BLACK_LEVEL, HEIGHT, WHITE_LEVEL, WIDTH, PhotoKey

KEY = PhotoKey.parse("01_A_off_30_L_0256")
ROCKS = np.array([[200.0, 300, 300, 380], [900, 500, 1000, 620]])


@pytest.fixture
def made_release(tmp_path):
    """Terrain 1 with a cover photo at A and labels of both cameras, the right one's elsewhere."""
    photo = np.full((HEIGHT, WIDTH), 90, np.uint8)
    cover = draw_strokes(photo, ROCKS + np.array([-4, -4, 4, 4]), [1, 2], REDS[0], 3, 26)
    png.write(tmp_path / "CoverPhotoOfIndices" / "cover_photo_indexed_01_A.png", cover)
    for camera, shift in (("L", 0), ("R", 150)):
        moved = np.array([shift, 0, shift, 0])
        path = tmp_path / "Labels" / "Terrain01" / f"01_A_off_30_{camera}_0256.txt"
        yolo.write_boxes(path, np.array([0, 0, 1]), np.vstack([ROCKS, [[300, 320, 400, 380]]]) + moved)
    return tmp_path


def test_a_cover_fits_the_labels_of_its_own_camera_only(made_release):
    pair_covers(made_release, [KEY], made_release / "pairing.csv")
    table = tables.read_csv(made_release / "pairing.csv").set_index("camera")
    assert table.loc["L", "shown"]
    assert not table.loc["R", "shown"]
    assert (table[["drawn", "labels"]] == 2).all(axis=None)
    assert table.loc["L", "score"] > 0.8
    assert table.loc["R", "score"] == 0


def test_a_cover_is_read_without_strokes_and_with_its_published_boxes(made_release):
    read_covers(root=made_release, keys=[KEY], pictures=made_release / "photos", labels=made_release / "labels.parquet")
    np.testing.assert_allclose(png.read(made_release / "photos" / f"{KEY}.png").astype(int), 90, atol=2)
    table = tables.read_parquet(made_release / "labels.parquet", tables.LABEL_COLUMNS)
    rocks = table.loc[table["kind"] == "rock", ["x0", "y0", "x1", "y1"]].to_numpy()
    np.testing.assert_allclose(rocks[np.argsort(rocks[:, 0])], ROCKS, atol=0.01)


@pytest.mark.parametrize("key", ["01_C_off_30_L_0256", "02_A_off_30_L_0256"])
def test_a_cover_that_is_not_there_is_named(made_release, key):
    with pytest.raises(DetectError, match="no cover photo"):
        read_covers(
            root=made_release, keys=[PhotoKey.parse(key)], pictures=made_release / "p", labels=made_release / "l"
        )


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


def labelled(key, boxes, **more):
    return pd.DataFrame(boxes, columns=["x0", "y0", "x1", "y1"]).assign(key=key, kind="rock", **more)


def test_figures_are_pooled_over_photos_and_intervals_hold_them():
    """By hand, hit, miss, hit of 4 labels: precision 1 to recall 1/4, 2/3 to 1/2: (26 + 25 * 2/3) / 101."""
    boxes = np.array([[10.0, 10, 50, 50], [100, 100, 150, 150]])
    labels = pd.concat([labelled("a", boxes), labelled("b", boxes)])
    predictions = pd.concat(
        [
            labelled("a", boxes[:1], confidence=0.9),
            labelled("b", [[300.0, 300, 340, 340]], confidence=0.8),
            labelled("b", boxes[1:], confidence=0.3),
        ]
    )
    row = cover_figures(labels, predictions, ["a", "b"], seed=0, resamples=200).set_index("kind").loc["rock"]
    assert row["map50"] == pytest.approx((26 + 25 * 2 / 3) / 101)
    assert row["map50_low"] <= row["map50"] <= row["map50_high"]
    assert row["iou_mean"] == pytest.approx(0.5)
    assert row["labels"] == 4
