import pandas as pd
import pytest

from polarsim.detect.detectors import Detector, read_detector, write_detector
from polarsim.errors import ConfigError
from polarsim.formats.files import write_json
from polarsim.formats.tables import write_parquet
from polarsim.publish.run import publish_forms
from tests.publish.tiny import content, make_run

torch = pytest.importorskip("torch")


def score(**own) -> dict[str, object]:
    row = {"trained": "hapke", "evaluated": "analog", "kind": "rock", "split": "position", "seed": 0}
    row |= {
        "shares_views": False,
        "detector": "compact (polarsim's own)",
        "start": "packaged",
        "epochs": 3,
        "imgsz": 640,
    }
    row |= {"images": 8, "labels": 106, "map50": 0.625, "map50_low": 0.5, "map50_high": 0.75}
    return row | {"map50_95": 0.25, "map50_95_low": 0.125, "map50_95_high": 0.375} | own


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """The tiny run with two detectors, each scored on one domain."""
    run = make_run(tmp_path_factory.mktemp("trained"))
    folder = run / "detect/position/seed0/detectors"
    for number, name in enumerate(("hapke", "real")):
        state = {"head.weight": torch.full((2, 3), float(number)).half()}
        write_detector(folder / f"{name}.pt", Detector("compact", 640, 3, "packaged", state))
    counts = {"pictures": {"train": 42, "val": 7, "test": 0}}
    write_json(run / "detect/position/datasets/hapke/dataset.json", counts)
    rows = [score(), score(trained="real", detector="yolov5n (YOLOv5u)", shares_views=True), score(seed=1, map50=0.9)]
    write_parquet(run / "detect/detection.parquet", pd.DataFrame(rows))
    return run


def test_weights_are_read_back_and_cards_describe_training_and_scores(trained, tmp_path):
    publish_forms(trained, tmp_path, ["detectors"])
    for name in ("hapke", "real"):
        published = read_detector(tmp_path / f"detectors/position/seed0/{name}.pt")
        original = read_detector(trained / f"detect/position/seed0/detectors/{name}.pt")
        assert published.state.keys() == original.state.keys()
        assert all(torch.equal(published.state[part], original.state[part]) for part in original.state)
    compact, yolo = ((tmp_path / f"detectors/position/seed0/{name}.md").read_text() for name in ("hapke", "real"))
    assert "| analog | rock | 8 | 106 | 0.625 [0.500, 0.750] | 0.250 [0.125, 0.375] |" in compact
    assert "0.900" not in compact  # score of another seed
    assert "compact (polarsim's own), start packaged, epochs 3, image width 640 px" in compact
    assert "42 images for training, 7 for" in compact
    assert "BSD-3-Clause" in compact
    assert "share views" not in compact
    assert "AGPL-3.0" in yolo
    assert "NASA Ames" in yolo
    assert "share views" in yolo
    first = content(tmp_path / "detectors")
    publish_forms(trained, tmp_path / "again", ["detectors"])
    assert content(tmp_path / "again/detectors") == first


def test_publishing_detectors_of_a_run_without_detectors_is_an_error(run, tmp_path):
    with pytest.raises(ConfigError):
        publish_forms(run, tmp_path, ["detectors"])
