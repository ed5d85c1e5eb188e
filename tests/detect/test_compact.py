"""The compact detector: components by hand calculations, and small trainings on blobs."""

import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.detect import detectors
from polarsim.detect.options import PredictionOptions, TrainingOptions
from polarsim.detect.predict import predict
from polarsim.errors import DetectError
from polarsim.formats import obj, tables
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.run_files.rigs import LocalisedRig, write_localised
from tests.detect import conftest
from tests.detect.conftest import make_real
from tests.support.polar_rig import default_rig

torch = pytest.importorskip("torch")

from polarsim.detect.detectors.compact.loss import assign_labels, losses  # noqa: E402
from polarsim.detect.detectors.compact.network import STRIDE  # noqa: E402
from polarsim.detect.detectors.compact.training import _rate  # noqa: E402
from polarsim.detect.detectors.compact.weights import decode_boxes  # noqa: E402
from polarsim.detect.detectors.devices import computes_bfloat16  # noqa: E402
from polarsim.site import polar  # noqa: E402

pytestmark = pytest.mark.slow
OPTIONS = TrainingOptions(model="compact", epochs=4, batch=2)
PREDICTION, IMGSZ = PredictionOptions(device="cpu"), 128


@pytest.fixture(scope="module")
def dataset(world, keys, tmp_path_factory) -> Path:
    return make_real(world, keys, tmp_path_factory.mktemp("compact"), IMGSZ)


def train(dataset: Path, folder: Path, name: str, options: TrainingOptions = OPTIONS, seed: int = 0) -> bytes:
    return conftest.train(dataset, folder, name, options, IMGSZ, seed).read_bytes()


@pytest.fixture(scope="module")
def matched(dataset, tmp_path_factory) -> Path:
    """Folder of a detector trained without Ultralytics, which has another licence."""
    folder = tmp_path_factory.mktemp("matched")
    with pytest.MonkeyPatch.context() as patch:
        for name in ("ultralytics", "torchvision"):
            patch.setitem(sys.modules, name, None)
        train(dataset, folder, "real")
    return folder


@given(steps=st.integers(1, 5000))
def test_the_learning_rate_reaches_the_configured_peak_in_trainings_of_any_length(steps):
    rates = [_rate(step, steps) for step in range(steps)]
    assert max(rates) == pytest.approx(1, abs=0.15)
    assert np.argmax(rates) <= min(100, 0.3 * steps)
    assert steps < 20 or rates[-1] < 0.05


def test_it_learns(matched):
    curve = tables.read_csv(matched / "real.csv")
    assert curve["epoch"].tolist() == [1, 2, 3, 4]
    assert curve["val_map50"].max() > 0.5
    assert curve["train_box_loss"].is_monotonic_decreasing
    state = detectors.read_detector(matched / "real.pt").state
    assert {value.dtype for value in state.values() if value.is_floating_point()} == {torch.float16}
    assert not [name for name in (*state, *curve) if "mask" in name]


def test_it_learns_in_the_other_precision_and_with_another_seed(dataset, matched, tmp_path):
    other = "float32" if computes_bfloat16("auto", "cpu") else "bfloat16"
    train(dataset, tmp_path, "other", OPTIONS.model_copy(update={"precision": other}), seed=1)
    curves = [tables.read_csv(path) for path in (tmp_path / "other.csv", matched / "real.csv")]
    assert curves[0]["val_map50"].max() > 0.5
    assert (curves[0]["train_box_loss"] != curves[1]["train_box_loss"]).all()


@pytest.mark.parametrize("bfloat16", [True, False])
@pytest.mark.parametrize("amx", [True, False])
@pytest.mark.parametrize("maker", ["GenuineIntel", "AuthenticAMD"])
def test_automatic_precision_is_bfloat16_where_it_is_faster(monkeypatch, bfloat16, amx, maker):
    """Without AMX, Intel's bfloat16 is slower than float32; a processor with AMX has bfloat16."""
    monkeypatch.setattr(torch.cpu, "_is_avx512_bf16_supported", lambda: bfloat16)
    monkeypatch.setattr(torch.cpu, "_is_amx_tile_supported", lambda: amx)
    monkeypatch.setattr(Path, "read_text", lambda _: f"vendor_id\t: {maker}\n")
    assert computes_bfloat16("auto", "cpu") is (bfloat16 and (amx or maker == "AuthenticAMD"))
    assert computes_bfloat16("bfloat16", "cpu")
    assert not computes_bfloat16("float32", "cpu")


def test_a_resumed_training_gives_the_same_bytes(dataset, matched, tmp_path, monkeypatch):
    from polarsim.detect.detectors.compact import training

    written = training._write_checkpoint

    def stop_after_two(state, path):
        written(state, path)
        if len(state.curve) == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(training, "_write_checkpoint", stop_after_two)
        with pytest.raises(KeyboardInterrupt):
            train(dataset, tmp_path, "stopped")
    assert not (tmp_path / "stopped.pt").exists()
    trained = []
    epoch = training._train_epoch
    monkeypatch.setattr(training, "_train_epoch", lambda *given: trained.append(given[2]) or epoch(*given))
    assert train(dataset, tmp_path, "stopped") == (matched / "real.pt").read_bytes()
    assert trained == [2, 3]
    assert (tmp_path / "stopped.csv").read_bytes() == (matched / "real.csv").read_bytes()
    assert list((tmp_path / "work_stopped").iterdir()) == []


@pytest.mark.parametrize("first", [1, 2])
def test_a_training_that_diverges_keeps_the_best_weights_until_then(dataset, tmp_path, monkeypatch, caplog, first):
    """Losses of epoch `first` are NaN. Without a finished epoch there are no weights to return."""
    from polarsim.detect.detectors.compact import training

    train_epoch = training._train_epoch

    def broken(state, pictures, epoch, *rest):
        row = train_epoch(state, pictures, epoch, *rest)
        return dict.fromkeys(row, math.nan) if epoch + 1 == first else row

    monkeypatch.setattr(training, "_train_epoch", broken)
    options = OPTIONS.model_copy(update={"epochs": 3})
    if first == 1:
        with pytest.raises(DetectError, match=r"detect\.training\.learning_rate"):
            train(dataset, tmp_path, "one", options)
        return
    train(dataset, tmp_path, "two", options)
    assert "diverged in epoch 2 of 3" in caplog.text
    assert tables.read_csv(tmp_path / "two.csv")["epoch"].tolist() == [1]
    assert detectors.read_detector(tmp_path / "two.pt").state


def test_predictions_are_well_formed_and_find_the_blobs(dataset, matched, tmp_path, world):
    predict(
        weights=matched / "real.pt",
        dataset=dataset,
        predictions=tmp_path / "real_on_real.parquet",
        site=polar(),
        options=PREDICTION,
        threads=1,
    )
    table = tables.read_parquet(tmp_path / "real_on_real.parquet")
    assert table["confidence"].between(PREDICTION.confidence, 1).all()
    assert ((table["x0"] >= 0) & (table["x0"] < table["x1"]) & (table["x1"] <= 1936)).all()
    assert ((table["y0"] >= 0) & (table["y0"] < table["y1"]) & (table["y1"] <= 1216)).all()
    labels = tables.read_parquet(world / "labels.parquet")
    labels = labels[labels["key"].isin(table["key"]) & (labels["kind"] == "rock")]
    surest = table[table["kind"] == "rock"].groupby("key").head(5)
    centres = ((surest["x0"] + surest["x1"]) / 2).groupby(surest["key"]).apply(list)
    near = [any(abs(x - (row.x0 + row.x1) / 2) < 30 for x in centres.get(row.key, [])) for row in labels.itertuples()]
    assert np.mean(near) > 0.6  # less than 1/6 for random points


def test_boxes_outside_the_sand_are_dropped_with_known_poses(dataset, matched, tmp_path):
    """A camera that is pointed at the ceiling shows no sand."""
    up = LocalisedRig(default_rig(), camera_pose(np.array([-3.2, 0, 1.0]), 0.0, np.radians(-80)), "labels")
    triangle = np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]])
    obj.write_obj(tmp_path / "Terrain01/terrain01_ground.obj", Mesh(triangle, np.array([[0, 1, 2]])), "ground")
    for position in "ABCDEFG":
        write_localised(tmp_path / f"Terrain01/Pos{position}.json", up)
    for folders, name in (([], "all"), ([tmp_path / "Terrain01"], "on_sand")):
        predict(
            weights=matched / "real.pt",
            dataset=dataset,
            predictions=tmp_path / f"{name}.parquet",
            site=polar(),
            options=PREDICTION,
            threads=1,
            cameras=folders,
            meshes=folders,
        )
    found, kept = (tables.read_parquet(tmp_path / f"{name}.parquet") for name in ("all", "on_sand"))
    elsewhere = found[~found["key"].str.startswith("01")].reset_index(drop=True)
    assert len(elsewhere) < len(found)
    pd.testing.assert_frame_equal(kept, elsewhere)


def test_training_can_start_from_a_polarsim_detector(dataset, matched, tmp_path):
    options = OPTIONS.model_copy(update={"pretrained": matched / "real.pt", "epochs": 1, "augment": True})
    train(dataset, tmp_path, "tuned", options)
    assert detectors.read_detector(tmp_path / "tuned.pt").start == "real.pt"
    first, tuned = (
        tables.read_csv(path)["val_map50"].iloc[0] for path in (matched / "real.csv", tmp_path / "tuned.csv")
    )
    assert tuned > first


def test_weights_of_another_network_are_refused_by_name(dataset, matched, tmp_path):
    options = OPTIONS.model_copy(update={"pretrained": matched / "real.pt", "model": "compact-l"})
    with pytest.raises(DetectError, match=r"real\.pt"):
        train(dataset, tmp_path, "none", options)


def test_a_cell_is_assigned_to_the_smallest_label_of_a_class():
    classes = torch.tensor([0, 0, 1])
    boxes = torch.tensor([[0.0, 0, 32, 32], [12, 12, 20, 20], [0, 0, 32, 32]])
    owner = assign_labels(classes, boxes, (2, 8, 8))  # cells of 4 px, centres at 2, 6, 10, ...
    centre = (owner[1] == 2).nonzero()
    assert centre.min() == 2  # centres 10 to 22 are within a quarter of 32 px from the centre of the box
    assert centre.max() == 5
    assert sorted(map(tuple, (owner[0] == 1).nonzero().tolist())) == [(3, 3), (3, 4), (4, 3), (4, 4)]
    assert (owner[0] == 0).sum() == 16 - 4


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 60), st.floats(0, 60), st.floats(0.5, 40), st.floats(0.5, 40)), min_size=1))
def test_a_single_label_is_assigned_to_the_cell_of_its_centre(sides):
    for x, y, width, height in sides:
        box = torch.tensor([[x, y, x + width, y + height]])
        owner = assign_labels(torch.tensor([1]), box, (2, 32, 32))
        column, row = (int((low + side / 2) / STRIDE) for low, side in ((x, width), (y, height)))
        assert owner[1, row, column] == 0
        assert (owner[0] == -1).all()


def test_correct_boxes_have_no_loss():
    boxes = torch.tensor([4.0, 4, 12, 16]).view(1, 1, 4, 1, 1).repeat(1, 1, 1, 8, 8)
    labels = [(torch.tensor([0]), torch.tensor([[4.0, 4, 12, 16]]))]
    owned = assign_labels(*labels[0], (1, 8, 8)) == 0
    logits = torch.where(owned, 30.0, -30.0)[None]
    assert float(sum(losses(logits, boxes, labels))) == pytest.approx(0, abs=1e-6)
    class_loss, box_loss = losses(-logits, boxes + 100, labels)
    assert class_loss > 10
    # Separate boxes: 1 - GIoU is 1 plus the empty share of the hull, 108 x 112 minus twice 96.
    assert float(box_loss) == pytest.approx(2 * (2 - 2 * 96 / (108 * 112)), rel=1e-5)


def test_images_without_labels_have_a_differentiable_loss():
    logits = torch.zeros(1, 2, 4, 4, requires_grad=True)
    class_loss, box_loss = losses(
        logits, torch.ones(1, 2, 4, 4, 4), [(torch.zeros(0, dtype=torch.long), torch.zeros(0, 4))]
    )
    assert float(box_loss) == 0
    assert class_loss.item() == pytest.approx(32 * 0.25 * math.log(2))
    class_loss.backward()


def test_suppression_is_per_class_and_limits_the_number_of_boxes(monkeypatch):
    logits = torch.full((1, 2, 2, 2), -9.0)
    logits[0, 0, 0, 0], logits[0, 0, 1, 1], logits[0, 1, 0, 0] = 2.0, 1.0, 0.0
    boxes = torch.tensor([0.0, 0, 10, 10]).view(1, 1, 4, 1, 1).repeat(1, 2, 1, 2, 2)
    rows = decode_boxes(logits, boxes, PREDICTION)[0]
    assert rows[:, 5].tolist() == [0, 1]  # the second rock duplicates the first rock
    np.testing.assert_allclose(rows[:, 4], [1 / (1 + math.exp(-2)), 0.5], rtol=1e-6)
    monkeypatch.setattr("polarsim.detect.nms.MAX_BOXES", 1)
    assert len(decode_boxes(logits, boxes, PREDICTION)[0]) == 1
