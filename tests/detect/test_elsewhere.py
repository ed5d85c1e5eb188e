"""Evaluation on images from outside POLAR: boxes and masks, recall by relative size, false positives, calibration."""

import cv2
import numpy as np
import pytest

from polarsim.annotate.detections import draw_detections
from polarsim.detect import detectors
from polarsim.detect.elsewhere import boxes_of_mask, labelled_images, read_truth, score_elsewhere, score_rows
from polarsim.detect.options import PredictionOptions
from polarsim.errors import FormatError
from polarsim.formats import tables, yolo
from polarsim.report.elsewhere_table import tabulate_elsewhere

LARGE, MEDIUM = np.array([100.0, 100, 300, 250]), np.array([400.0, 100, 430, 120])  # in images of 640 x 400 px
FALSE = np.array([500.0, 300, 560, 350])


def confident(box, confidence):
    return np.append(box, confidence)


def test_recall_by_size_false_positives_and_precision_are_counted():
    truth = [np.stack([LARGE, MEDIUM]), LARGE[None]]
    predicted = [np.stack([confident(LARGE, 0.9), confident(FALSE, 0.8)]), np.zeros((0, 5))]
    every, small, medium, large = score_rows(truth, predicted, np.array([640.0, 640]), 100)
    assert [row["labels"] for row in (every, small, medium, large)] == [3, 0, 1, 2]
    assert (every["recall"], medium["recall"], large["recall"]) == (pytest.approx(1 / 3), 0, 0.5)
    assert np.isnan(small["recall"])
    assert every["false_per_image"] == 0.5
    assert every["map50"] == pytest.approx(34 / 101)  # precision 1 for recalls 0 to 0.33
    assert every["calibration_error"] == pytest.approx(0.45)  # |1 - 0.9| and |0 - 0.8|, equal weights
    assert every["map50_low"] <= every["map50"] <= every["map50_high"]


def test_recall_at_half_a_false_positive_ignores_less_confident_boxes():
    truth = [np.stack([LARGE, MEDIUM])] * 2
    rows = [confident(LARGE, 0.9), confident(FALSE, 0.8), confident(FALSE + 60, 0.7), confident(MEDIUM, 0.6)]
    every, _, medium, large = score_rows(truth, [np.stack(rows), np.zeros((0, 5))], np.array([640.0, 640]), 100)
    assert (every["recall"], every["recall_at_half"]) == (0.5, 0.25)
    assert (medium["recall_at_half"], large["recall_at_half"]) == (0, 0.5)


def test_components_of_a_mask_are_boxes():
    mask = np.zeros((60, 80), bool)
    mask[10:20, 10:30] = mask[20:25, 30:40] = True  # touch at a corner
    mask[50:53, 50:53] = True  # too small
    np.testing.assert_array_equal(boxes_of_mask(mask), [[10, 10, 40, 25]])
    assert boxes_of_mask(np.zeros((5, 5), bool)).shape == (0, 4)


@pytest.fixture
def folder(tmp_path):
    """Return a folder with an image with boxes, an image with a mask, and an image without either."""
    root = tmp_path / "mars"
    for name in ("images", "labels", "masks"):
        (root / name).mkdir(parents=True)
    pixels = np.full((400, 640), 120, np.uint8)
    for name in ("one", "two", "three"):
        cv2.imwrite(str(root / f"images/{name}.png"), pixels)
    yolo.write_boxes(root / "labels/one.txt", np.array([0, 1]), np.stack([LARGE, MEDIUM]), (640, 400))
    mask = np.zeros((400, 640), np.uint8)
    mask[100:250, 100:300] = 255
    cv2.imwrite(str(root / "masks/two.png"), mask)
    return root


def test_labels_and_masks_are_read_and_unlabelled_images_excluded(folder):
    labels = labelled_images(folder)
    assert [path.stem for path in labels] == ["one", "two"]
    for label in labels.values():
        np.testing.assert_allclose(read_truth(label, (640, 400)), LARGE[None], atol=0.01)  # the shadow is no rock


def test_a_mask_of_another_size_and_a_folder_without_labels_are_refused(folder, tmp_path):
    with pytest.raises(FormatError, match="640 x 400"):
        read_truth(folder / "masks/two.png", (320, 200))
    (tmp_path / "none/images").mkdir(parents=True)
    with pytest.raises(FormatError, match="no image"):
        labelled_images(tmp_path / "none")
    cv2.imwrite(str(tmp_path / "none/images/one.png"), np.zeros((9, 9), np.uint8))
    with pytest.raises(FormatError, match="labels/NAME"):
        labelled_images(tmp_path / "none")


def test_a_folder_is_scored_and_tabulated(folder, tmp_path, monkeypatch):
    torch = pytest.importorskip("torch")

    class Family:
        load = staticmethod(lambda *_: lambda pictures: [np.array([[50.0, 50, 150, 125, 0.9, 0]]) for _ in pictures])

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    detectors.write_detector(tmp_path / "d.pt", detectors.Detector("compact", 320, 1, "scratch", {"w": torch.zeros(1)}))
    score_elsewhere(
        name="mars", folder=folder, weights=tmp_path / "d.pt", weights_elsewhere=tmp_path / "d.pt",
        detections=tmp_path / "out",
        scores=tmp_path / "scores.parquet", options=PredictionOptions(), resamples=100, draw=draw_detections,
    )  # fmt: skip
    tabulate_elsewhere(
        scores=[tmp_path / "scores.parquet"], table=tmp_path / "elsewhere",
        origin={"run": "here", "source": "analog", "config": "abc"},
    )  # fmt: skip
    row = tables.read_csv(tmp_path / "elsewhere.csv").iloc[0]
    assert (row["name"], row["images"], row["labels"], row["map50"], row["recall"]) == ("mars", 2, 2, 1.0, 1.0)
    assert row["not_calibrated"] == 1
    assert (tmp_path / "out/pictures/one.jpg").exists()
