"""Detections of the onboard detector, and labels with contrast."""

import shutil

import numpy as np
import pytest

from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.formats.tables import read_parquet
from polarsim.rover.cameras.layout import DETECTION_COLUMNS, picture_folder
from polarsim.rover.perception import detections
from polarsim.rover.perception.detections import boxes_with_contrast, detect_drive
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.camera_names import FRONT
from tests.rover import driven

PICTURE = np.full((60, 80), 10, np.uint8)
PICTURE[20:40, 10:30] = 200
BOXES = np.array([[10, 20, 30, 40], [50, 20, 70, 40], [0, 0, 80, 60], [40, 50, 80, 60], [31, 20, 35, 40]], float)


def test_boxes_of_the_packaged_detector_are_in_the_pictures(drive, tmp_path):
    made, options = drive[0], drive[1].model_copy(update={"suns": ("2",)})
    folder = shutil.copytree(made, tmp_path / "drive")
    prediction = PredictionOptions(confidence=0.01, nms_iou=0.5, widths=(256,), device="cpu")
    detect_drive(folder, driven.vehicle(), options, OnboardDetector(weights=PACKAGED, prediction=prediction), 3)
    pictures = picture_folder(folder, FRONT, "2", "hapke", 256)
    found = read_parquet(pictures / "detections.parquet", DETECTION_COLUMNS)
    assert set(found["frame"]) <= {int(path.stem) for path in pictures.glob("*.png")}
    assert len(found) > 0
    assert (found["x0"] < found["x1"]).all()
    assert found["x0"].min() >= 0
    assert found["x1"].max() <= 387.2  # a fifth of the camera's 1936


def test_inference_widths_are_limited_to_the_width_of_pictures(drive, tmp_path, monkeypatch):
    made, options = drive
    folder = shutil.copytree(made, tmp_path / "drive")
    prediction = PredictionOptions(widths=(256, 1792), gates_px=(64.0,), device="cpu")
    calls = []

    def recorded(loaded, pictures, sizes, nms_iou, full):
        calls.append((sizes.widths, [picture.shape[1] for picture in pictures]))
        return [np.zeros((0, 6))] * len(pictures)

    monkeypatch.setattr(detections, "predict_images", recorded)
    detect_drive(folder, driven.vehicle(), options, OnboardDetector(weights=PACKAGED, prediction=prediction), 3)
    assert {tuple(widths) for widths, _ in calls} == {(256, 384)}  # at most a fifth of the camera's 1936
    assert {width for _, pictures in calls for width in pictures} <= {384, 387}


@pytest.mark.parametrize(
    ("picture", "least", "shown"),
    [(PICTURE, 0.06, "10101"), (np.zeros_like(PICTURE), 0.01, "00000"), (np.zeros_like(PICTURE), 0.0, "11111")],
)
def test_a_bright_rock_has_contrast_and_a_rock_in_the_dark_or_outside_the_picture_has_none(
    picture, least, shown, monkeypatch
):
    monkeypatch.setattr(detections, "MIN_CONTRAST", least)
    outside = np.array([[-20, 5, -10, 9], [90, 5, 99, 9.0]])
    found = boxes_with_contrast(picture, np.concatenate([BOXES, outside]))
    assert found.tolist() == [digit == "1" for digit in shown + "00"]
    assert boxes_with_contrast(picture, np.zeros((0, 4))).tolist() == []
