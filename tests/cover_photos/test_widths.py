"""Choice of inference widths by cross-validation, and publication of a detector."""

import numpy as np
import pandas as pd
import pytest

from polarsim.cover_photos.publish import publish_detector
from polarsim.cover_photos.widths import choose_widths, predict_multiscale, read_found
from polarsim.detect import detectors
from polarsim.detect.detectors.compact.weights import network
from polarsim.detect.options import PredictionOptions
from polarsim.errors import DetectError
from polarsim.formats import obj, png, tables
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.schemas.covers import COVER_FOUND, COVER_SCORES
from polarsim.schemas.detect import PREDICTIONS
from polarsim.site import polar
from tests.cover_photos.test_scores import label_rows_of
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

KEYS = {"01": "01_A_off_30_L_0256", "03": "03_A_off_30_R_0256", "04": "04_A_off_30_L_0256"}
SMALL, LARGE = np.array([10.0, 10, 30, 30]), np.array([100.0, 100, 400, 400])
OPTIONS = PredictionOptions(nms_iou=0.5)


def finds(key, width, boxes, kind="rock", confidence=0.9):
    return [(key, width, kind, confidence, *box) for box in boxes]


def write_found(path, rows):
    tables.write_parquet(path, tables.typed(rows, COVER_FOUND))
    return path


@pytest.fixture
def folds(tmp_path):
    """Three folds of one photo each. Large rocks are detected at 512 px, small rocks at 1,024 px; in 04 all at 1024."""
    found, datasets, labels = {}, {}, []
    for fold, key in KEYS.items():
        rows = finds(key, 512, [LARGE]) + finds(key, 1024, [SMALL]) + finds(key, 512, [LARGE], "shadow")
        if fold == "04":
            rows = (
                finds(key, 512, [SMALL + 700]) + finds(key, 1024, [SMALL, LARGE]) + finds(key, 1024, [LARGE], "shadow")
            )
        found[fold] = write_found(tmp_path / f"found{fold}.parquet", rows)
        datasets[fold] = tmp_path / f"dataset{fold}"
        tables.write_csv(datasets[fold] / "pictures.csv", pd.DataFrame({"key": [key], "part": ["test"]}))
        labels += label_rows_of(key, np.array([SMALL, LARGE]))
        labels += [row | {"kind": "shadow"} for row in label_rows_of(key, LARGE[None])]
    tables.write_parquet(tmp_path / "labels.parquet", tables.label_table(labels))
    return {"labels": tmp_path / "labels.parquet", "found": found, "datasets": datasets}


def choose(folds, tmp_path, options=OPTIONS):
    choose_widths(
        site=polar(),
        **folds,
        predictions=tmp_path / "predictions.parquet",
        sizes=tmp_path / "sizes.csv",
        imgsz=512,
        options=options,
    )
    sizes = tables.read_csv(tmp_path / "sizes.csv", ("fold", "kind", "widths")).astype({"fold": str, "widths": str})
    sizes = sizes[sizes["kind"] == "rock"]
    found = tables.read_parquet(tmp_path / "predictions.parquet", PREDICTIONS.columns)
    return dict(zip([f"{int(fold):02d}" for fold in sizes["fold"]], sizes["widths"], strict=True)), found


def test_the_widths_of_a_fold_come_from_the_remaining_folds(folds, tmp_path):
    """Fold 04 prefers only 1,024 px, folds 01 and 03 prefer both widths."""
    widths, found = choose(folds, tmp_path)
    assert widths["04"] == "512 1024"
    own = found[found["key"] == KEYS["04"]]
    assert own["x0"].tolist() == [SMALL[0]]  # large boxes are taken from 512 px
    assert set(found["key"]) == set(KEYS.values())


def test_boxes_outside_the_sand_are_dropped_before_the_choice_of_widths(folds, tmp_path):
    """The camera of fold 03 is pointed at the ceiling, so its boxes do not affect the choice."""
    up = LocalisedRig(default_rig(), camera_pose(np.array([-3.2, 0, 1.0]), 0.0, np.radians(-80)), "labels")
    write_localised(tmp_path / "Terrain03/PosA.json", up)
    triangle = Mesh(np.array([[-1.0, -1, 0], [1, -1, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    obj.write_obj(tmp_path / "Terrain03/terrain03_ground.obj", triangle, "ground")
    folders = [tmp_path / "Terrain03"]
    widths, found = choose(folds | {"cameras": folders, "meshes": folders}, tmp_path)
    assert set(found["key"]) == {KEYS["01"], KEYS["04"]}
    assert widths["04"] == "512 1024"


def test_widths_of_a_single_fold_and_of_the_options(folds, tmp_path):
    alone = {"labels": folds["labels"]} | {name: {"01": folds[name]["01"]} for name in ("found", "datasets")}
    assert choose(alone, tmp_path)[0] == {"01": "512"}
    assert set(choose(folds, tmp_path, PredictionOptions(nms_iou=0.5, widths=[1024]))[0].values()) == {"1024"}


def test_a_detector_without_predictions_is_an_error(tmp_path):
    path = write_found(tmp_path / "none.parquet", [])
    with pytest.raises(DetectError) as error:
        read_found(path, ["a"])
    assert error.value.path == path


def test_predictions_include_the_training_width(tmp_path):
    weights = tmp_path / "detector.pt"
    detectors.write_detector(weights, detectors.Detector("compact", 96, 1, "scratch", network("compact").state_dict()))
    key = KEYS["01"]
    dataset = tmp_path / "dataset"
    png.write_png(dataset / "images" / "test" / f"{key}.png", np.full((80, 128), 60, np.uint8))
    tables.write_csv(dataset / "pictures.csv", pd.DataFrame({"key": [key], "part": ["test"]}))
    predict_multiscale(
        weights=weights, dataset=dataset, found=tmp_path / "found.parquet", size=SIZE, widths=[64, 128],
        options=PredictionOptions(nms_iou=0.5, confidence=0.001), threads=1,
    )  # fmt: skip
    by_width = read_found(tmp_path / "found.parquet", [key])[key]
    assert sorted(by_width) == [64, 96, 128]


def test_a_published_detector_has_widths_calibration_and_a_card(folds, tmp_path):
    weights, state = tmp_path / "all.pt", network("compact").state_dict()
    detectors.write_detector(weights, detectors.Detector("compact", 512, 3, "carved", state))
    scores = pd.DataFrame(
        [("all", "rock", 0.41, 0.3, 0.5, 6), ("03", "rock", 0.2, np.nan, np.nan, 2), ("01", "rock", 0.6, 0.5, 0.7, 4)],
        columns=["terrain", "kind", "map50", "map50_low", "map50_high", "labels"],
    )
    texts = {"trained": "fine_tuned", "detectors": "one", "detector": "compact", "start": "carved"}
    counts = {"seed": 0, "epochs": 3, "folds": 3, "pictures": 9, "images": 3}
    scores = scores.assign(**texts, **counts, map50_95=0.1, iou_mean=0.2, calibration_error=0.04)
    tables.write_parquet(tmp_path / "scores.parquet", scores[list(COVER_SCORES.columns)].astype(COVER_SCORES.dtypes))
    publish_detector(
        weights=weights, **folds, scores=tmp_path / "scores.parquet", detector=tmp_path / "detector.pt",
        card=tmp_path / "detector.md", width=1936, options=OPTIONS,
    )  # fmt: skip
    detector = detectors.read_detector(tmp_path / "detector.pt")
    (rock_widths, rock_gates), (shadow_widths, _) = detector.sizes
    assert tuple(rock_widths) == (512, 1024)
    assert len(rock_gates) == 1
    assert tuple(shadow_widths) == (512,)
    assert len(detector.calibration) == 2
    card = (tmp_path / "detector.md").read_text()
    assert "| all | rock | 0 | 6 | 0.410 | [0.300, 0.500] |" in card
    assert "terrain 03 (0.20)" in card
    assert "the 3 published cover photos with human boxes" in " ".join(card.split())
    only = {name: {"01": folds[name]["01"]} for name in ("found", "datasets")}
    with pytest.raises(DetectError):
        publish_detector(
            weights=weights, labels=folds["labels"], **only, scores=tmp_path / "scores.parquet",
            detector=tmp_path / "d.pt", card=tmp_path / "d.md", width=1936, options=OPTIONS,
        )  # fmt: skip
