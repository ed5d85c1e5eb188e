"""Fine-tuning of a detector on pictures of drives."""

import shutil

import numpy as np
import pytest

from polarsim.detect import detectors
from polarsim.detect.dataset import read_parts
from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.errors import PolarsimError, RoverError
from polarsim.formats import png, yolo
from polarsim.rover.perception import fine_tuning
from polarsim.rover.perception.fine_tuning import fine_tune, make_drive_dataset
from polarsim.rover.perception.options import DriveTuningOptions
from polarsim.rover.vehicle.camera_names import FRONT


@pytest.fixture(autouse=True)
def small(monkeypatch):
    for name, value in {"_WINDOW_PX": 128, "_WIDEST_PX": 256, "_VAL_SHARE": 0.5}.items():
        monkeypatch.setattr(fine_tuning, name, value)


def options_of(*drives, **changes):
    return DriveTuningOptions(**{"windows": 2, "epochs": 1, "drives": drives} | changes)


def test_windows_of_all_picture_sets_are_8_bit_images_with_labels(drive, tmp_path):
    folder, _ = drive
    make_drive_dataset(dataset=tmp_path / "dataset", options=options_of(folder))
    parts = read_parts(tmp_path / "dataset")
    names = [name for part in ("train", "val") for name in parts[part]]
    frames = {path.stem for path in (folder / FRONT / "1_hapke_0256").glob("*.png")}
    assert not parts["test"]
    assert len(names) == 2 * 2 * len(frames)  # windows, Suns
    assert {name.split("_")[-5] for name in names} == {"1", "2"}
    of_picture = {part: {name.rpartition("_w")[0] for name in parts[part]} for part in ("train", "val")}
    assert not of_picture["train"] & of_picture["val"]
    labelled = 0
    for part in ("train", "val"):
        for name in parts[part]:
            picture = png.read_png(tmp_path / f"dataset/images/{part}/{name}.png")
            assert picture.shape[1] == 128
            assert picture.dtype == np.uint8
            labelled += len(yolo.read_boxes(tmp_path / f"dataset/labels/{part}/{name}.txt", picture.shape[::-1])[1])
    assert labelled > len(names)  # on average more than one label per window


def test_pictures_of_any_exposure_and_of_all_drives_are_used(drive, tmp_path):
    other = shutil.copytree(drive[0], tmp_path / drive[0].name)
    for sun, name in (("1", "1_lunar_lambert_12.5"), ("2", "2_hapke_1000000")):
        (other / FRONT / f"{sun}_hapke_0256").rename(other / FRONT / name)
    make_drive_dataset(dataset=tmp_path / "dataset", options=options_of(drive[0], other, windows=1, every=3))
    names = {name for part in read_parts(tmp_path / "dataset").values() for name in part}
    assert len({name for name in names if name.startswith("drive1_")}) == len(names) / 2
    for exposure in ("12.5", "1000000"):
        assert any(f"_{exposure}_" in name for name in names)


def test_a_fine_tuned_detector_keeps_its_inference_widths(drive, tmp_path):
    options = options_of(drive[0], windows=1, every=3)
    make_drive_dataset(dataset=tmp_path / "dataset", options=options)
    fine_tune(
        dataset=tmp_path / "dataset", start=PACKAGED, weights=tmp_path / "tuned.pt", curve=tmp_path / "tuned.csv",
        options=options, prediction=PredictionOptions(), threads=1, work=tmp_path / "work",
    )  # fmt: skip
    before, after = detectors.read_detector(PACKAGED), detectors.read_detector(tmp_path / "tuned.pt")
    assert after.sizes == before.sizes != ()
    assert after.calibration == ()
    assert any((after.state[name] != tensor).any() for name, tensor in before.state.items())
    assert not list((tmp_path / "work").rglob("*.pt"))


def test_the_error_of_a_drive_without_pictures_or_labels_has_its_path(drive, tmp_path):
    empty = tmp_path / "seed7"
    empty.mkdir()
    with pytest.raises(RoverError) as error:
        make_drive_dataset(dataset=tmp_path / "dataset", options=options_of(empty))
    assert error.value.path == empty
    bare = shutil.copytree(drive[0], tmp_path / "bare")
    shutil.rmtree(bare / FRONT / "2_labels")
    with pytest.raises(PolarsimError, match="2_labels"):
        make_drive_dataset(dataset=tmp_path / "dataset", options=options_of(bare))
    assert not (tmp_path / "dataset").exists()
