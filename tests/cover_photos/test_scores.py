"""Metrics of detectors on cover photos agree with hand calculations."""

import numpy as np
import pandas as pd
import pytest

from polarsim.cover_photos.scores import cover_metrics, cross_calibrated, score_covers
from polarsim.cover_photos.widths import merge_seeds
from polarsim.detect.options import ComparisonOptions, PredictionOptions, TrainingOptions
from polarsim.formats import png, tables, yolo
from polarsim.photo import PhotoKey
from polarsim.report.covers_table import tabulate_covers
from polarsim.report.figures.covers import best_confidence, draw_covers
from polarsim.report.figures.scenes import draw_scenes
from polarsim.schemas.covers import COVER_SCORES
from polarsim.schemas.detect import PREDICTIONS

ORIGIN = {"run": "covers", "source": "release", "config": "1a2b"}


def labelled(key, boxes, **more):
    return pd.DataFrame(boxes, columns=["x0", "y0", "x1", "y1"]).assign(key=key, kind="rock", **more)


def test_metrics_are_pooled_over_photos():
    """True, false, true positive for 4 labels: precision 1 to recall 1/4, 2/3 to 1/2: (26 + 25 * 2/3) / 101."""
    labels = pd.concat([labelled("a", BOXES), labelled("b", BOXES)])
    found = (("a", BOXES[:1], 0.9), ("b", [[300.0, 300, 340, 340]], 0.8), ("b", BOXES[1:], 0.3))
    predictions = pd.concat([labelled(key, boxes, confidence=sure) for key, boxes, sure in found])
    row = cover_metrics(labels, [predictions], ["a", "b"], resamples=200).set_index("kind").loc["rock"]
    assert row["map50"] == pytest.approx((26 + 25 * 2 / 3) / 101)
    assert row["map50_low"] <= row["map50"] <= row["map50_high"]
    assert row["iou_mean"] == pytest.approx(0.5)
    assert row["labels"] == 4


def test_one_photo_has_no_interval():
    boxes = np.array([[10.0, 10, 50, 50]])
    found = labelled("a", boxes, confidence=0.9)
    row = cover_metrics(labelled("a", boxes), [found], ["a"], resamples=100).iloc[0]
    assert row["map50"] == 1
    assert np.isnan(row["map50_low"])


BOXES = np.array([[10.0, 10, 50, 50], [100, 100, 150, 150]])
KEYS = ["01_A_off_30_L_0256", "03_A_off_30_R_0256"]  # a fold each


def score(folder, labels, predictions, merged=None):
    """Score the predictions by seed of two folds of one photo each; return the table of scores."""
    tables.write_parquet(folder / "labels.parquet", tables.label_table(labels))
    paths, datasets = {}, {}
    for seed, parts in enumerate(predictions):
        paths[seed] = folder / f"predictions{seed}.parquet"
        table = pd.concat(parts, ignore_index=True)[list(PREDICTIONS.columns)]
        tables.write_parquet(paths[seed], table.astype(PREDICTIONS.dtypes))
    for key in KEYS:
        datasets[key[:2]] = folder / key[:2]
        pictures = pd.DataFrame([(key, "test"), ("t04_s000_l0", "train"), ("t04_s001_l0", "train")])
        tables.write_csv(datasets[key[:2]] / "pictures.csv", pictures.set_axis(["key", "part"], axis=1))
    if merged:
        merge_seeds(predictions=list(paths.values()), merged=merged, options=PredictionOptions(nms_iou=0.5))
    score_covers(
        labels=folder / "labels.parquet", predictions=paths, merged=merged, datasets=datasets,
        trained_on=list(datasets.values()), scores=folder / "scores.parquet", trained="rendered",
        training=TrainingOptions(model="compact", epochs=7), start="scratch", options=ComparisonOptions(resamples=100),
    )  # fmt: skip
    return folder / "scores.parquet"


@pytest.fixture
def scored(tmp_path):
    """Both boxes of terrain 1 are detected, none of terrain 3. The second box is a shadow."""
    labels = [row | {"kind": "shadow"} if n else row for key in KEYS for n, row in enumerate(label_rows_of(key, BOXES))]
    parts = [labelled(key, BOXES + move, confidence=0.9) for key, move in zip(KEYS, (0, 300), strict=True)]
    return score(tmp_path, labels, [[part.assign(kind=["rock", "shadow"]) for part in parts]])


@pytest.fixture
def two_seeds(tmp_path):
    """Two rocks a photo, two seeds: each detects a different rock of terrain 1 and a phantom."""
    labels = [row for key in KEYS for row in label_rows_of(key, BOXES)]
    predictions = [
        [
            labelled(KEYS[0], BOXES[seed : seed + 1], confidence=0.8),
            labelled(KEYS[1], BOXES, confidence=0.6),
            labelled(KEYS[0], phantom[None], confidence=0.7),
        ]
        for seed, phantom in enumerate(BOXES + 400)
    ]
    score(tmp_path, labels, predictions, tmp_path / "merged.parquet")
    return tmp_path


def test_a_run_of_several_seeds_has_their_mean_and_the_merged_detectors(two_seeds):
    """Terrain 1, by hand: each seed finds one of two rocks, surest (51 of 101 recalls at precision 1); merged, both
    come first with 0.4, the phantoms after them with 0.35."""
    table = tables.read_parquet(two_seeds / "scores.parquet", COVER_SCORES.columns)
    rows = table[table["kind"] == "rock"].set_index(["terrain", "detectors", "seed"])
    assert [rows.loc[("01", *of), "map50"] for of in (("one", 0), ("one", 1), ("mean", -1), ("merged", -1))] == (
        pytest.approx([51 / 101, 51 / 101, 51 / 101, 1])
    )
    assert rows.loc[("03", "merged", -1), "map50"] == 1
    low, high = rows.loc[("all", "mean", -1), ["map50_low", "map50_high"]]
    assert low < rows.loc[("all", "mean", -1), "map50"] < high
    shared = set(rows.loc["all"].index)
    assert shared == {("one", 0), ("one", 1), ("mean", -1), ("merged", -1)}


def test_merged_predictions_are_a_table_as_those_of_a_seed(two_seeds):
    merged = tables.read_parquet(two_seeds / "merged.parquet", PREDICTIONS.columns)
    assert merged["confidence"].tolist() == [0.4, 0.4, 0.35, 0.35, 0.6, 0.6]
    assert merged["key"].str[:2].tolist() == ["01"] * 4 + ["03"] * 2


def test_the_table_of_several_seeds_names_the_detectors(two_seeds, tmp_path):
    tabulate_covers(scores=[two_seeds / "scores.parquet"], stem=tmp_path / "covers", origin=ORIGIN)
    rows = [line for line in (tmp_path / "covers.md").read_text().splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[:2] for row in rows[2:6]] == [
        ["| all", name] for name in ("seed 0", "seed 1", "mean", "merged")
    ]
    assert "weighted boxes fusion" in (tmp_path / "covers.md").read_text()


def label_rows_of(key, boxes):
    more = tables.key_columns(PhotoKey.parse(key)) | {
        "kind": "rock",
        "rock": -1,
        "source": "annotated",
        "confidence": 1.0,
    }
    return [more | dict(zip(("x0", "y0", "x1", "y1"), box, strict=True)) for box in boxes.tolist()]


def test_every_terrain_is_evaluated_by_its_fold(scored):
    table = tables.read_parquet(scored, COVER_SCORES.columns).set_index(["terrain", "kind"])
    assert table["map50"].to_dict() == pytest.approx(
        {("all", "rock"): 0.5 + 0.5 / 101, ("all", "shadow"): 0.5 + 0.5 / 101,
         ("01", "rock"): 1, ("01", "shadow"): 1, ("03", "rock"): 0, ("03", "shadow"): 0}, abs=0.01
    )  # fmt: skip
    assert (table["folds"] == 2).all()
    assert (table["pictures"] == 2).all()
    assert (table["epochs"] == 7).all()


def test_a_fold_is_calibrated_on_the_remaining_folds(scored):
    """Boxes are correct for terrain 1 and false for terrain 3, so cross-calibration increases both errors."""
    error = tables.read_parquet(scored, COVER_SCORES.columns).set_index(["terrain", "kind"])["calibration_error"]
    assert error["03", "rock"] > 0.9  # 0.9 without calibration; increased by the true positives of terrain 1
    assert error["01", "rock"] > 0.1 + 0.05  # 0.1 uncalibrated


def test_folds_with_equal_errors_calibrate_each_other():
    """Half of the boxes with confidence 0.9 are correct: the error without calibration is 0.4."""
    sides = np.arange(100.0)[:, None] * 30 + [0, 0, 20, 20]
    half = np.vstack([sides[:50], sides[50:] + np.array([0, 5000, 0, 5000])])
    labels = pd.concat([labelled(key, sides) for key in "ab"])
    found = pd.concat([labelled(key, half, confidence=0.9) for key in "ab"])
    boxes = cross_calibrated(labels, found, {"1": ["a"], "2": ["b"]})
    assert [len(boxes[key]) for key in "ab"] == [100, 100]
    np.testing.assert_allclose(np.concatenate([boxes[key][:, 4] for key in "ab"]), 0.5, atol=0.05)
    assert cross_calibrated(labels, found, {"1": ["a", "b"]}) == {}


def test_the_table_marks_fine_tuned_detectors(scored, tmp_path):
    table = tables.read_parquet(scored, COVER_SCORES.columns)
    better = table.assign(trained="fine_tuned", map50=table["map50"] / 2, epochs=3, pictures=11)
    tables.write_parquet(tmp_path / "better.parquet", better)
    tabulate_covers(scores=[scored, tmp_path / "better.parquet"], stem=tmp_path / "covers", origin=ORIGIN)
    rows = [line.split(" | ") for line in (tmp_path / "covers.md").read_text().splitlines() if line.startswith("| ")]
    assert [tuple(row[:2]) for row in rows] == [
        ("| terrain", "trained on"), ("| ---", "---"), ("| all", "scenes"), ("| all", "scenes, photos"),
        ("| 01", "scenes"), ("| 01", "scenes, photos"), ("| 03", "scenes"), ("| 03", "scenes, photos"),
    ]  # fmt: skip
    assert "[0.000, 1.000]" in " | ".join(rows[2])  # a replicate can contain a single terrain
    assert tables.read_csv(tmp_path / "covers.csv")["config"].unique().tolist() == ["1a2b"]
    notes = (tmp_path / "covers.md").read_text()
    assert "from scratch, 7 epochs of 2 images of scenes, 2 folds" in notes
    assert "fine-tuned for 3 epochs of 11 images" in notes


def test_every_photo_has_a_panel_with_labels_and_confident_boxes(tmp_path):
    boxes = np.array([[100.0, 100, 900, 700]])
    keys = ["01_A_off_30_L_0256", "03_A_off_30_R_0256"]
    for key in keys:
        png.write_png(tmp_path / "photos" / f"{key}.png", np.full((1216, 1936), 60, np.uint8))
    tables.write_parquet(
        tmp_path / "labels.parquet", tables.label_table([row for key in keys for row in label_rows_of(key, boxes)])
    )
    found = pd.concat(
        [
            labelled(keys[0], boxes + 5, confidence=0.8),
            labelled(keys[1], boxes + np.tile([900, 400], 2), confidence=0.3),
        ]
    )
    tables.write_parquet(tmp_path / "found.parquet", found[list(PREDICTIONS.columns)].astype(PREDICTIONS.dtypes))
    draw_covers(
        photos=tmp_path / "photos", labels=tmp_path / "labels.parquet", predictions=tmp_path / "found.parquet",
        figure=tmp_path / "covers.png", width=800,
    )  # fmt: skip
    picture = png.read_png(tmp_path / "covers.png").astype(int)
    picture = picture[:-50]  # without the legend
    pink = (picture[..., 2] > 130) & (picture[..., 1] < 110)
    orange = (picture[..., 0] > 200) & (picture[..., 2] < 60)
    assert pink[:, :400].sum() > 100
    assert pink[:, 400:].sum() == 0  # below the confidence with maximum F1
    assert orange[:, :400].sum() > 20
    assert orange[:, 400:].sum() > 100


def test_the_confidence_threshold_of_panels_maximises_f1():
    labels = labelled("a", [(0, 0, 10, 10), (20, 0, 30, 10)])
    found = labelled("a", [(0, 0, 10, 10), (20, 0, 30, 10), (50, 50, 60, 60)], confidence=[0.9, 0.6, 0.5])
    assert best_confidence(labels, found) == 0.6
    assert best_confidence(labels, found.iloc[2:]) == 1


def test_scenes_are_drawn_with_labels_in_their_positions(tmp_path):
    """Each image has a rock in the upper left quarter and a shadow in the lower right quarter."""
    for terrain in (1, 3):
        for scene in range(9):
            name = f"t{terrain:02d}_s{scene:03d}_l0"
            png.write_png(tmp_path / str(terrain) / "images" / f"{name}.png", np.full((160, 256), 90, np.uint8))
            corners = np.array([[20.0, 20, 100, 70], [140, 90, 240, 150]])
            yolo.write_boxes(tmp_path / str(terrain) / "labels" / f"{name}.txt", np.array([0, 1]), corners, (256, 160))
    draw_scenes(scenes={t: tmp_path / str(t) for t in (1, 3)}, figure=tmp_path / "scenes.png", width=1024)
    picture = png.read_png(tmp_path / "scenes.png").astype(int)
    orange = (picture[..., 0] > 200) & (picture[..., 2] < 60)
    blue = (picture[..., 2] > 180) & (picture[..., 0] < 110)  # lines between pixels are darker
    for number in range(4):
        column = slice(256 * number, 256 * (number + 1))
        for half in (slice(0, 200), slice(200, None)):
            assert orange[half, column].sum() > 100
            assert blue[half, column].sum() > 100
    assert np.flatnonzero(orange[:200].any(axis=1)).max() < np.flatnonzero(blue[:200].any(axis=1)).max()
