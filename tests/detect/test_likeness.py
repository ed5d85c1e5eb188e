"""Images unlike POLAR's cause a warning, and their confidences are marked as not calibrated."""

import json
import logging
from dataclasses import replace

import cv2
import numpy as np
import pytest

from polarsim.detect import detectors
from polarsim.detect.detect_pictures import detect_in_images
from polarsim.detect.likeness import MIN_EXTREME_SHARE, extreme_share, is_like_polar
from polarsim.detect.options import PredictionOptions


def daylight(shape=(400, 640)):
    """Return an image of medium grey values with a bright block, as in daylight."""
    pixels = np.clip(np.random.default_rng(0).normal(140, 20, shape), 60, 225).astype(np.uint8)
    pixels[80:140, 100:180] = 250
    return pixels


def low_sun():
    pixels = daylight()
    pixels[:80] = 5  # dark hall
    return pixels


def test_dark_and_clipped_pixels_count():
    grey = np.full((100, 200), 120, np.uint8)
    assert extreme_share(grey) == 0
    grey[:10], grey[90:] = 47, 240
    assert extreme_share(grey) == pytest.approx(0.2)
    assert not is_like_polar(daylight())
    assert is_like_polar(low_sun())


def test_the_share_depends_neither_on_the_size_nor_on_fine_noise():
    small = low_sun()
    large = cv2.resize(small, None, fx=4, fy=4, interpolation=cv2.INTER_LINEAR)
    noise = np.random.default_rng(1).normal(0, 60, large.shape)
    noisy = np.clip(large + noise, 0, 255).astype(np.uint8)
    assert extreme_share(large) == pytest.approx(extreme_share(small), abs=0.01)
    assert extreme_share(noisy) == pytest.approx(extreme_share(small), abs=0.05)
    assert (
        extreme_share(
            np.clip(daylight((1600, 2560)) + np.random.default_rng(1).normal(0, 60, (1600, 2560)), 0, 255).astype(
                np.uint8
            )
        )
        < MIN_EXTREME_SHARE
    )


@pytest.fixture
def calibrated(tmp_path, monkeypatch):
    """Return the path of a detector with a calibration that finds the block."""
    torch = pytest.importorskip("torch")

    class Family:
        load = staticmethod(lambda *_: lambda pictures: [np.array([[50.0, 40, 90, 70, 0.9, 0]]) for _ in pictures])

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    detector = detectors.Detector("compact", 320, 1, "scratch", {"w": torch.zeros(1)})
    detectors.write_detector(tmp_path / "plain.pt", detector)
    detectors.write_detector(tmp_path / "calibrated.pt", replace(detector, calibration=((1.0, 0.0), (1.0, 0.0))))
    return tmp_path / "calibrated.pt"


@pytest.mark.parametrize("name", ["calibrated", "plain"])
def test_detections_state_whether_confidences_are_calibrated(calibrated, tmp_path, caplog, name):
    folder = tmp_path / "in"
    folder.mkdir()
    cv2.imwrite(str(folder / "day.png"), daylight())
    cv2.imwrite(str(folder / "night.png"), low_sun())
    with caplog.at_level(logging.WARNING):
        found = detect_in_images(
            pictures=[folder], weights=[calibrated.with_stem(name)], out=tmp_path / "out", options=PredictionOptions(),
            threads=2,
        )  # fmt: skip
    expected = {"day.png": False, "night.png": name == "calibrated"}
    assert dict(zip(found["picture"], found["calibrated"], strict=True)) == expected
    images = json.loads((tmp_path / "out/coco.json").read_text())["images"]
    assert {row["file_name"].rpartition("/")[2]: row["calibrated"] for row in images} == expected
    warned = [record.getMessage() for record in caplog.records if "unlike POLAR" in record.getMessage()]
    assert len(warned) == (name == "calibrated")
    assert all("1 of 2" in text and "day.png" in text for text in warned)


def test_images_unlike_polar_are_searched_by_another_detector(calibrated, tmp_path, caplog, monkeypatch):
    def load(detector, *_):
        return lambda pictures: [np.array([[50.0, 40, 90, 70, detector.imgsz / 1000, 0]]) for _ in pictures]

    class Family:
        pass

    Family.load = staticmethod(load)
    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    other = replace(detectors.read_detector(calibrated), imgsz=640, calibration=())
    detectors.write_detector(tmp_path / "other.pt", other)
    folder = tmp_path / "in"
    folder.mkdir()
    cv2.imwrite(str(folder / "day.png"), daylight())
    cv2.imwrite(str(folder / "night.png"), low_sun())
    with caplog.at_level(logging.WARNING):
        found = detect_in_images(
            pictures=[folder], weights=[calibrated], elsewhere=[tmp_path / "other.pt"], out=tmp_path / "out",
            options=PredictionOptions(), threads=2,
        )  # fmt: skip
    rows = found.set_index("picture")
    assert rows["detector"].to_dict() == {"day.png": "other.pt", "night.png": "calibrated.pt"}
    assert rows["confidence"].to_dict() == {"day.png": 0.64, "night.png": 0.32}
    assert rows["calibrated"].to_dict() == {"day.png": False, "night.png": True}
    images = json.loads((tmp_path / "out/coco.json").read_text())["images"]
    assert [row["detector"] for row in images] == ["other.pt", "calibrated.pt"]
    assert any("other.pt is used" in record.getMessage() for record in caplog.records)
