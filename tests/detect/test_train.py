"""Training, prediction and evaluation of a small YOLO detector."""

import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from polarsim.detect import detectors
from polarsim.detect import train as train_module
from polarsim.detect.dataset import dataset_images
from polarsim.detect.detectors.yolo.library import ultralytics
from polarsim.detect.nms import MAX_BOXES
from polarsim.detect.options import (
    PredictionOptions,
    TrainingOptions,
)
from polarsim.detect.predict import predict
from polarsim.errors import DetectError
from polarsim.formats import png, tables
from polarsim.site import polar
from tests.detect import conftest
from tests.detect.conftest import make_real

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(find_spec("ultralytics") is None, reason="Ultralytics is not installed"),  # imported by polarsim
]
OPTIONS, PREDICTION, IMGSZ = TrainingOptions(epochs=2), PredictionOptions(device="cpu"), 96


@pytest.fixture(scope="module")
def matched(world, keys, tmp_path_factory) -> Path:
    """A folder with split.csv, the data set real/, real.pt, real.csv, real_on_real.parquet."""
    root = tmp_path_factory.mktemp("matched")
    make_real(world, keys, root, IMGSZ)
    before = {path: path.stat().st_mtime_ns for path in (root / "real").rglob("*")}
    train(root, "real", OPTIONS)
    assert {path: path.stat().st_mtime_ns for path in (root / "real").rglob("*")} == before  # no caches in there
    run_predict(root, "real_on_real.parquet")
    return root


def train(root: Path, name: str, options: TrainingOptions, dataset: Path | None = None) -> None:
    conftest.train(dataset or root / "real", root, name, options, IMGSZ)


def run_predict(root: Path, name: str, options: PredictionOptions = PREDICTION) -> None:
    predict(
        weights=root / "real.pt",
        dataset=root / "real",
        predictions=root / name,
        site=polar(),
        options=options,
        threads=1,
    )


def test_the_curve_has_a_row_per_epoch_and_the_class_loss_decreases(matched):
    curve = tables.read_csv(matched / "real.csv")
    assert curve["epoch"].tolist() == [1, 2]
    assert np.isfinite(curve.to_numpy()).all()
    assert curve["val_class_loss"].iloc[-1] < curve["val_class_loss"].iloc[0]


def test_checkpoints_and_settings_are_deleted(matched):
    assert [path.name for path in (matched / "work_real").iterdir() if not path.name.startswith(".ultralytics")] == []
    content = (matched / "real.pt").read_bytes()
    assert str(matched).encode() not in content  # weights hold no paths


def test_training_is_reproducible_and_ignores_foreign_checkpoints(matched):
    (matched / "work_again" / "training" / "out" / "weights").mkdir(parents=True)
    (matched / "work_again" / "training" / "identity.txt").write_text("of another training")
    (matched / "work_again" / "training" / "out" / "weights" / "last.pt").write_bytes(b"of another training")
    train(matched, "again", OPTIONS)
    assert (matched / "again.pt").read_bytes() == (matched / "real.pt").read_bytes()


def test_an_interrupted_training_resumes(matched, monkeypatch, caplog):
    def stop(trainer):
        if trainer.epoch == 1:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(
            "polarsim.detect.detectors.yolo.training._report", stop
        )  # called after the checkpoint of an epoch is written
        with pytest.raises(KeyboardInterrupt):
            train(matched, "stopped", OPTIONS.model_copy(update={"epochs": 3}))
    assert not (matched / "stopped.pt").exists()
    caplog.set_level("INFO", "polarsim")
    train(matched, "stopped", OPTIONS.model_copy(update={"epochs": 3}))
    assert next(line for line in caplog.messages if line.startswith("epoch")).startswith("epoch 3 of 3")
    assert tables.read_csv(matched / "stopped.csv")["epoch"].tolist() == [1, 2, 3]


def test_checkpoints_of_changed_code_are_discarded(matched, monkeypatch):
    def identities():
        found = []
        with monkeypatch.context() as patch:
            patch.setattr("polarsim.detect.predict.write_in_parts", lambda *asked: found.append(asked[-1]))
            run_predict(matched, "code_on_real.parquet")
        folder = matched / "work_code"
        train_module._prepare(detectors.Training(matched / "real", folder, OPTIONS, PREDICTION, IMGSZ, 0, 1))
        left = folder / "left"
        found.append(left.exists())
        left.touch()
        return found

    first, same = identities(), identities()
    for module in ("predict", "train"):
        monkeypatch.setattr(f"polarsim.detect.{module}.code_digest", lambda name: f"other code of {name}")
    other = identities()
    assert first[0] == same[0] != other[0]
    assert (first[1], same[1], other[1]) == (False, True, False)


def test_predictions_agree_with_the_ultralytics_predictor(matched):
    library = ultralytics(matched)
    detector = detectors.read_detector(matched / "real.pt")
    model = library.YOLO("yolov5n.yaml")
    model.model = library.DetectionModel("yolov5n.yaml", nc=2, verbose=False)
    model.model.load_state_dict({name: value.float() for name, value in detector.state.items()})
    model.model.names = {0: "rock", 1: "shadow"}
    key = dataset_images(matched / "real", "test")[0]
    picture = png.read_png(matched / "real" / "images" / "test" / f"{key}.png")
    found = model.predict(
        picture[..., None].repeat(3, axis=2), imgsz=96, conf=0.001, iou=PREDICTION.nms_iou, verbose=False
    )[0].boxes
    table = tables.read_parquet(matched / "real_on_real.parquet")
    # Ultralytics keeps one class per cell, polarsim all classes above the threshold: compare the most confident box.
    surest = table[table["key"] == key].sort_values("confidence", ascending=False).iloc[0]
    assert surest["confidence"] == pytest.approx(float(found.conf.max()), abs=1e-4)


def test_training_can_start_from_a_polarsim_detector(matched):
    options = OPTIONS.model_copy(update={"pretrained": matched / "real.pt", "epochs": 1})
    train(matched, "tuned", options)
    tuned = detectors.read_detector(matched / "tuned.pt")
    assert tuned.start == "real.pt"
    first, second = (tables.read_csv(matched / f"{name}.csv")["val_class_loss"].iloc[0] for name in ("real", "tuned"))
    assert second < first  # starts from the weights of the first training


def test_a_data_set_without_labels_is_refused(matched, tmp_path):
    empty = tmp_path / "empty"
    shutil.copytree(matched / "real", empty)
    for path in empty.glob("labels/*/*.txt"):
        path.write_text("")
    with pytest.raises(DetectError):
        train(tmp_path, "none", OPTIONS, dataset=empty)


def test_missing_pretrained_weights_are_named(matched, tmp_path):
    options = OPTIONS.model_copy(update={"pretrained": tmp_path / "absent.pt"})
    with pytest.raises(DetectError, match=r"absent\.pt"):
        train(tmp_path, "none", options, dataset=matched / "real")


def test_ultralytics_trains_in_either_precision(matched, tmp_path):
    losses = []
    for precision in ("float32", "bfloat16"):
        options = OPTIONS.model_copy(update={"epochs": 1, "precision": precision})
        train(tmp_path, precision, options, dataset=matched / "real")
        losses.append(tables.read_csv(tmp_path / f"{precision}.csv")["train_class_loss"].iloc[0])
    assert losses[0] != losses[1]
    assert losses[0] == pytest.approx(losses[1], rel=0.1)


@pytest.mark.parametrize("model", ["yolov10n", "yolo26n"])  # two heads that differ from YOLOv5u, YOLOv8 and YOLO11
def test_newer_models_train_and_predict_by_name(matched, tmp_path, model):
    options = OPTIONS.model_copy(update={"model": model, "epochs": 1})
    train(tmp_path, model, options, dataset=matched / "real")
    curve = tables.read_csv(tmp_path / f"{model}.csv")
    assert np.isfinite(curve["val_box_loss"]).all()
    predict(
        weights=tmp_path / f"{model}.pt",
        dataset=matched / "real",
        predictions=tmp_path / "found.parquet",
        site=polar(),
        options=PredictionOptions(confidence=1e-6),
        threads=1,
    )
    table = tables.read_parquet(tmp_path / "found.parquet")
    assert set(table["key"]) == set(dataset_images(matched / "real", "test"))
    assert table.groupby("key").size().max() <= MAX_BOXES
