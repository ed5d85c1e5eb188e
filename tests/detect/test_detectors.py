"""Detector files, and the import of Ultralytics."""

import ast
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import polarsim.detect
from polarsim.detect.detectors import Detector, choose_device, detector_name, read_detector, write_detector
from polarsim.detect.detectors.yolo.weights import load_start, network
from polarsim.errors import DetectError

torch = pytest.importorskip("torch")


@pytest.fixture(scope="module")
def detector(tmp_path_factory) -> Detector:
    from polarsim.detect.detectors.yolo.library import ultralytics

    torch.manual_seed(0)
    module = ultralytics(tmp_path_factory.mktemp("yolo")).DetectionModel("yolov5n.yaml", nc=2, verbose=False)
    state = {name: value.half() for name, value in module.state_dict().items()}
    return Detector("yolov5n", 160, 2, "scratch", state)


def test_a_detector_reads_back(detector, tmp_path):
    write_detector(tmp_path / "real.pt", detector)
    write_detector(tmp_path / "other" / "hapke.pt", detector)
    assert (tmp_path / "real.pt").read_bytes() == (tmp_path / "other" / "hapke.pt").read_bytes()
    back = read_detector(tmp_path / "real.pt")
    assert (back.model, back.imgsz, back.epochs, back.start) == ("yolov5n", 160, 2, "scratch")
    assert all(torch.equal(back.state[name], value) for name, value in detector.state.items())


@pytest.mark.parametrize("model", ["yolov5n", "yolo11n", "yolov10n", "yolo26n"])
def test_networks_in_bfloat16_place_boxes_as_in_float32(tmp_path, model):
    from polarsim.detect.detectors.yolo.library import ultralytics

    torch.manual_seed(0)
    module = ultralytics(tmp_path).DetectionModel(f"{model}.yaml", nc=2, verbose=False).eval()
    for branch in module.model[-1].cv2:
        torch.nn.init.normal_(branch[-1].weight, std=0.3)  # initial boxes are equal
    image = torch.rand(1, 3, 160, 160)
    with torch.inference_mode():
        exact = module(image)[0]
        with torch.autocast("cpu", torch.bfloat16):
            fast = module(image)[0]
    exact, fast = ((output if torch.is_tensor(output) else output[0])[0, :4] for output in (exact, fast))
    assert fast.dtype == torch.float32
    assert exact.std(dim=1).min() > 10  # px
    assert (fast - exact).abs().max() < 1  # px


class Evil:
    def __reduce__(self):
        return (Path.touch, (Path("executed"),))


@pytest.mark.parametrize(
    ("content", "read"),
    [
        ({"format": "polarsim judge 1"}, lambda path: read_detector(path)),
        ({"ema": None, "train_args": {}}, lambda path: load_start(path, "yolov5n", path.parent)),
    ],
)
def test_code_in_a_weights_file_is_not_executed(tmp_path, monkeypatch, content, read):
    monkeypatch.chdir(tmp_path)
    torch.save(content | {"model": Evil()}, tmp_path / "evil.pt", pickle_module=pickle)
    with pytest.raises(DetectError, match=r"evil\.pt") as caught:
        read(tmp_path / "evil.pt")
    assert len(str(caught.value).splitlines()) == 1  # without the PyTorch advice to execute the file
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize("model", ["yolov5s", "compact"])
def test_weights_of_another_model_do_not_start_a_training(detector, tmp_path, model):
    write_detector(tmp_path / "own.pt", Detector(model, 160, 2, "scratch", detector.state))
    with pytest.raises(DetectError, match=rf"own\.pt.*{model}"):
        load_start(tmp_path / "own.pt", "yolov5n", tmp_path)


def test_the_error_of_invalid_weights_has_the_path(tmp_path):
    torch.save({"weights": torch.zeros(3)}, tmp_path / "other.pt")
    with pytest.raises(DetectError, match=r"other\.pt"):
        read_detector(tmp_path / "other.pt")
    with pytest.raises(DetectError, match=r"absent\.pt"):
        read_detector(tmp_path / "absent.pt")


@pytest.mark.parametrize(
    "wrong",
    [
        {"classes": None}, {"classes": ["rock"]}, {"model": "foo"}, {"model": 3}, {"imgsz": "wide"}, {"state": [1]},
        {"sizes": (((640, 1792), ()),) * 2}, {"sizes": (((640,), ()),)}, {"calibration": ((1.0, 2.0),)},
    ],
)  # fmt: skip
def test_weights_with_an_invalid_field_are_a_one_line_error(detector, tmp_path, wrong):
    write_detector(tmp_path / "own.pt", detector)
    torch.save(torch.load(tmp_path / "own.pt", weights_only=True) | wrong, tmp_path / "bent.pt")
    with pytest.raises(DetectError, match=r"bent\.pt") as refused:
        read_detector(tmp_path / "bent.pt")
    assert "\n" not in str(refused.value)


def test_weights_of_another_size_do_not_fit(detector, tmp_path):
    with pytest.raises(DetectError):
        network(Detector("yolov5s", 160, 2, "scratch", detector.state), tmp_path)


def test_unavailable_cuda_is_an_error(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert choose_device("auto") == choose_device("cpu") == "cpu"
    with pytest.raises(DetectError):
        choose_device("cuda")


@pytest.mark.parametrize(
    ("model", "name"),
    [("yolov5n", "yolov5n (YOLOv5u)"), ("yolo11s", "yolo11s"), ("compact", "compact (polarsim's own)")],
)
def test_detector_names_in_tables(model, name):
    assert detector_name(model) == name


def test_only_one_module_imports_ultralytics_and_common_modules_do_not_import_torch():
    importers = set()
    root = Path(polarsim.detect.__file__).parent
    for path in root.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        heavy = {"ultralytics", "torchvision", "cv2"} | (set() if path.parent.name == "compact" else {"torch"})
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if any(name.split(".")[0] == "ultralytics" for name in names):
                importers.add(str(path.relative_to(root)))
            if node in tree.body:
                assert not {name.split(".")[0] for name in names} & heavy
                assert path.parent.name == "compact" or not any(".compact." in name for name in names)
    assert importers == {"detectors/yolo/library.py"}


def test_the_import_of_ultralytics_does_not_change_the_environment(tmp_path):
    """The import sets thread limits, which libraries of subprocesses report on standard error."""
    script = (
        "import os, sys; from pathlib import Path;"
        "from polarsim.detect.detectors.yolo.library import ultralytics;"
        "os.environ.pop('OMP_NUM_THREADS', None); before = dict(os.environ); ultralytics(Path(sys.argv[1]));"
        "print({k: v for k, v in os.environ.items() if before.get(k) != v and not k.startswith(('YOLO_', 'ULTRA'))})"
    )
    call = [sys.executable, "-c", script, str(tmp_path)]
    assert subprocess.run(call, capture_output=True, text=True, check=True).stdout == "{}\n"
