"""Published detector of field scenes: held-out scenes select widths and calibration; the card states their metrics."""

import cv2
import numpy as np
import pytest

from polarsim.cover_photos.field import WIDTHS, predict_held_out, publish_field_detector
from polarsim.detect import detectors
from polarsim.detect.dataset import image_entry, write_yolo_dataset
from polarsim.detect.options import PredictionOptions
from polarsim.detect.split import VAL
from polarsim.errors import DetectError
from polarsim.formats import yolo
from polarsim.photo import REFERENCE_WIDTH_PX

torch = pytest.importorskip("torch")
SIZE = (640, 402)


def brightest(pictures):
    """Return the box of the bright block, and a false box with the same confidence in every image."""
    found = []
    for picture in pictures:
        rows, columns = np.nonzero(picture > 200)
        block = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1, 0.9, 0]
        found.append(np.array([block, [0, 0, 20, 20, 0.9, 0]], float))
    return found


@pytest.fixture
def dataset(tmp_path, monkeypatch):
    class Family:
        load = staticmethod(lambda *_: brightest)

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    pictures = tmp_path / "pictures"
    names = [f"t00_s{scene:03d}_l{lamp}" for scene in (3, 8, 20, 41) for lamp in (0, 1)]
    for kind in ("images", "labels"):
        (pictures / kind).mkdir(parents=True)
    for number, name in enumerate(names):
        pixels = np.full(SIZE[::-1], 60, np.uint8)
        box = np.array([100 + 20 * number, 80, 200 + 20 * number, 180], float)
        x0, y0, x1, y1 = box.astype(int)
        pixels[y0:y1, x0:x1] = 250
        cv2.imwrite(str(pictures / "images" / f"{name}.png"), pixels)
        yolo.write_boxes(pictures / "labels" / f"{name}.txt", np.array([0]), box[None], SIZE)
    entries = [image_entry(pictures, name, VAL) for name in names]
    (tmp_path / "data").mkdir()
    write_yolo_dataset("covers", tmp_path / "data", entries, tmp_path / "data", {}, needed=[VAL])
    return tmp_path / "data"


def test_halves_are_of_different_scenes_and_boxes_are_in_pixels_of_a_photo(dataset):
    images = predict_held_out(brightest, dataset, WIDTHS, 0.5)
    assert images.scenes.tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    first, second = images.half(0), images.half(1)
    assert set(first.scenes) == {0, 2}
    assert set(second.scenes) == {1, 3}
    for labels, rows in zip(images.labels, images.found[640], strict=True):
        np.testing.assert_allclose(rows[0, :4], labels[1][0], atol=2)
    assert images.labels[0][1][0, 0] == pytest.approx(100 * REFERENCE_WIDTH_PX / SIZE[0], abs=0.1)


def test_the_published_detector_has_widths_calibration_and_a_card(dataset, tmp_path):
    detector = detectors.Detector("compact", 384, 3, "rocks.pt", {"w": torch.zeros(5)})
    detectors.write_detector(tmp_path / "trained.pt", detector)
    publish_field_detector(
        weights=tmp_path / "trained.pt", dataset=dataset, detector=tmp_path / "field.pt", card=tmp_path / "field.md",
        options=PredictionOptions(nms_iou=0.5, widths=(640,)), threads=1,
    )  # fmt: skip
    published = detectors.read_detector(tmp_path / "field.pt")
    assert published.sizes == (((640,), ()),) * 2
    assert len(published.calibration) == 2
    slope, offset = published.calibration[0]
    calibrated = 1 / (1 + np.exp(-(slope * np.log(9) + offset)))
    assert 0.4 < calibrated < 0.7  # half of the boxes are right, few boxes: between 0.5 and the confidence of 0.9
    card = (tmp_path / "field.md").read_text()
    assert "3\n  epochs at 384 px, initialised with rocks.pt" in card
    assert "| rock | 8 | " in card


def test_images_of_other_data_sets_are_refused(dataset):
    (dataset / "pictures.csv").write_text("key,part\n01_A_off_30_L_0256,val\n")
    with pytest.raises(DetectError, match="not an image of a scene"):
        predict_held_out(brightest, dataset, WIDTHS, 0.5)
