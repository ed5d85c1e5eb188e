"""Detections of the onboard detector."""

import shutil

import numpy as np
import pytest

from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.formats.tables import read_parquet
from polarsim.rover.cameras.layout import DETECTION_COLUMNS, picture_folder
from polarsim.rover.perception.detections import detect_drive
from polarsim.rover.perception.options import OnboardDetector
from polarsim.rover.vehicle.mounts import FRONT
from tests.rover import driven


def test_boxes_of_the_packaged_detector_are_in_the_pictures_and_current_files_are_kept(drive, tmp_path, monkeypatch):
    made, options = drive[0], drive[1].model_copy(update={"suns": ("2",)})
    folder = shutil.copytree(made, tmp_path / "drive")
    prediction = PredictionOptions(confidence=0.01, nms_iou=0.5, widths=(256,), device="cpu")
    onboard = OnboardDetector(weights=PACKAGED, prediction=prediction)
    detect_drive(folder, driven.vehicle(), options, onboard, 3)
    for sun in options.suns:
        pictures = picture_folder(folder, FRONT, sun, "hapke", 256)
        found = read_parquet(pictures / "detections.parquet", DETECTION_COLUMNS)
        frames = {int(path.stem) for path in pictures.glob("*.png")}
        assert set(found["frame"]) <= frames
        assert len(found) > 0
        assert (found["x0"] < found["x1"]).all()
        assert found["x0"].min() >= 0
        assert found["x1"].max() <= 387.2  # a fifth of the camera's 1936
    monkeypatch.setattr("polarsim.detect.detectors.load_detector", lambda *_: pytest.fail("detected again"))
    detect_drive(folder, driven.vehicle(), options, onboard, 3)
    other = onboard.model_copy(update={"prediction": prediction.model_copy(update={"precision": "bfloat16"})})
    with pytest.raises(pytest.fail.Exception, match="detected again"):
        detect_drive(folder, driven.vehicle(), options, other, 3)


def test_inference_widths_are_limited_to_the_width_of_pictures(drive, tmp_path, monkeypatch):
    made, options = drive
    folder = shutil.copytree(made, tmp_path / "drive")
    prediction = PredictionOptions(widths=(256, 1792), gates_px=(64.0,), device="cpu")
    onboard = OnboardDetector(weights=PACKAGED, prediction=prediction)
    calls = []

    def recorded(loaded, pictures, sizes, nms_iou, full):
        calls.append((sizes.widths, [picture.shape[1] for picture in pictures]))
        return [np.zeros((0, 6))] * len(pictures)

    monkeypatch.setattr("polarsim.rover.perception.detections.predict_images", recorded)
    detect_drive(folder, driven.vehicle(), options, onboard, 3)
    assert {tuple(widths) for widths, _ in calls} == {(256, 384)}  # at most a fifth of the camera's 1936
    assert {width for _, pictures in calls for width in pictures} <= {384, 387}
