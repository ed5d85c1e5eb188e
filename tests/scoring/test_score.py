import itertools
import json
import logging
import shutil

import numpy as np
import pytest

from polarsim.errors import FormatError, LabelError
from polarsim.formats import release, yolo
from polarsim.photo import PhotoKey
from polarsim.scoring.score import PhotoLabels, count_boxes, score_boxes, score_folders
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEY = PhotoKey.parse("01_A_off_180_L_0256")
RIGHT = PhotoKey.parse("04_B_on_30_R_0512")


def square(x: float, y: float, side: float = 10) -> list[float]:
    return [x, y, x + side, y + side]


def labels(*boxes: list[float], kind: int = 0) -> PhotoLabels:
    return PhotoLabels(np.full(len(boxes), kind), np.array(boxes, float).reshape(-1, 4))


def write(folder, key, found: PhotoLabels):
    yolo.write_boxes(folder / f"{key}.txt", found.classes, found.boxes, size=SIZE)


def test_an_equal_box_is_a_hit_and_a_distant_box_a_miss_and_a_false_positive():
    counts = count_boxes(np.array([square(0, 0), square(100, 0)]), np.array([square(0, 0), square(300, 0)]))
    assert (counts.tp, counts.fp, counts.fn) == (1, 1, 1)
    assert counts.metrics() == {
        "files": 1, "truth_boxes": 2, "label_boxes": 2, "tp": 1, "fp": 1, "fn": 1,
        "precision": 0.5, "recall": 0.5, "f1": 0.5, "miou": 0.5,
    }  # fmt: skip


def test_more_pairs_are_preferred_to_a_larger_sum():
    # First truth box: IoU 1 with label 0 and 0.6 with label 1; second: 0.6 with label 0, none with label 1.
    truth = np.array([[0, 0, 10, 10], [0, 0, 6, 10]], float)
    found = np.array([[0, 0, 10, 10], [4, 0, 10, 10]], float)
    assert count_boxes(truth, found, threshold=0.5).tp == 2


def test_the_mean_iou_has_an_assignment_without_threshold():
    counts = count_boxes(np.array([square(0, 0)]), np.array([[0, 0, 10, 4]]))  # IoU 0.4
    assert counts.tp == 0
    assert counts.metrics()["miou"] == pytest.approx(0.4)


@pytest.mark.parametrize(("side", "hits"), [(5.0, 1), (4.9, 0)])
def test_an_iou_of_exactly_the_threshold_is_a_hit(side, hits):
    assert count_boxes(np.array([[0, 0, 10, 10]]), np.array([[0, 0, 10, side]]), 0.5).tp == hits


@pytest.mark.parametrize(
    ("truth", "found", "wanted"),
    [
        ({KEY: labels(square(0, 0))}, {KEY: labels(square(0, 0), kind=1)}, {"fn": 1, "fp": 0}),  # a rock is no shadow
        ({KEY: labels(square(0, 0), square(50, 0))}, {}, {"fn": 2}),  # a photo without labels
        (
            {KEY: PhotoLabels.none()},
            {KEY: labels(square(0, 0))},
            {"fp": 1, "precision": 0, "recall": None, "miou": None},
        ),
        (  # ratios of the summed counts
            {KEY: labels(square(0, 0)), RIGHT: labels(square(0, 0), square(50, 0), square(90, 0))},
            {KEY: labels(square(0, 0)), RIGHT: labels(square(200, 0))},
            {"recall": 1 / 4, "precision": 1 / 2, "f1": 2 / 6},
        ),
    ],
)
def test_counts_of_rocks_are_those_of_a_calculation_by_hand(truth, found, wanted):
    rock = score_boxes(truth, found)["classes"]["rock"]
    assert {name: rock[name] for name in wanted} == wanted


def test_photos_are_grouped_by_each_part_of_the_key():
    by = score_boxes({KEY: labels(square(0, 0)), RIGHT: labels(square(0, 0))}, {RIGHT: labels(square(0, 0))})["by"]
    assert {group: sorted(values) for group, values in by.items()} == {
        "terrain": ["01", "04"], "position": ["A", "B"], "light": ["off", "on"],
        "azimuth": ["180", "30"], "camera": ["L", "R"],
    }  # fmt: skip
    assert (by["camera"]["L"]["rock"]["f1"], by["camera"]["R"]["rock"]["f1"]) == (0.0, 1.0)


def test_flat_folders_terrain_folders_and_a_release_give_equal_scores(tmp_path):
    for folder in ("flat", "nested/Terrain01", "release/Labels/Terrain01"):
        write(tmp_path / folder, KEY, labels(square(7, 9)))
    write(tmp_path / "nested", RIGHT, labels(square(1, 1)))  # both forms in the same folder
    for truth, found in itertools.permutations(("flat", "nested", "release"), 2):
        report = score_folders(tmp_path / truth, tmp_path / found)
        assert report["by"]["terrain"]["01"]["rock"]["f1"] == 1
    assert report["files"]["labels_without_truth"] == 1


def test_compared_and_excluded_files_are_reported(tmp_path, caplog):
    truth, found = tmp_path / "truth", tmp_path / "found"
    write(truth, KEY, labels(square(0, 0)))
    write(truth, RIGHT, labels(square(0, 0)))
    write(truth, KEY.with_exposure(64), labels(square(0, 0)))
    write(found, RIGHT, labels(square(0, 0)))
    for name in (f"{KEY} copy.txt", "01_A_off_180_L_1028.txt", ".DS_Store"):
        shutil.copy(truth / f"{KEY}.txt", truth / name)
    (truth / "classes.txt").write_text("rock\nshadow\n")
    (truth / f"{KEY.with_exposure(64)}.txt").write_text("0 0.5 0.5 0.1\n")
    with caplog.at_level(logging.WARNING):
        report = score_folders(truth, found)
    files = report["files"]
    assert (files["compared"], files["missing_labels"]) == (2, 1)
    assert files["stray_truth"] == [".DS_Store", "01_A_off_180_L_0256 copy.txt", "01_A_off_180_L_1028.txt"]
    assert files["unreadable_truth"][0].startswith("01_A_off_180_L_0064.txt: 1: 4 fields")
    assert sum("stray" in record.getMessage() for record in caplog.records) == 1
    json.dumps(report, allow_nan=False)


def test_a_selection_compares_only_its_photos(tmp_path):
    write(tmp_path / "truth", KEY, labels(square(0, 0)))
    write(tmp_path / "truth", RIGHT, labels(square(0, 0), square(40, 0)))
    report = score_folders(tmp_path / "truth", tmp_path / "truth", keys=lambda key: key.camera == "R")
    assert (report["classes"]["rock"]["tp"], report["files"]["not_selected"]) == (2, 1)


def test_an_invalid_file_a_missing_folder_and_a_folder_without_truth_are_errors(tmp_path):
    for folder in ("truth", "found"):
        write(tmp_path / folder, KEY, labels(square(0, 0)))
    (tmp_path / "found" / f"{KEY}.txt").write_text("0 0.5 0.5 0.1 0.1\n2 0.5 0.5 0.1 0.1\n")
    with pytest.raises(FormatError, match=rf"found/{KEY}.txt:2: class 2"):
        score_folders(tmp_path / "truth", tmp_path / "found")
    with pytest.raises(FormatError, match="nowhere: no such folder"):
        score_folders(tmp_path / "nowhere", tmp_path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(LabelError, match="no label file, such as"):
        score_folders(tmp_path / "empty", tmp_path / "truth")


@pytest.mark.release
def test_rocks_copied_to_another_azimuth_score_as_measured_before(release_root):
    # shared facts on the labels, 5d: all ordered pairs of seeds of terrains 01, 03, 04, 08, 11: n 3,216, F1 0.833,
    # mean IoU 0.675; seeds are the best exposures.
    seeds = {}
    for terrain in (1, 3, 4, 8, 11):
        sets = {}
        for key, path in release.label_files(release_root, terrain).items():
            if key.camera == "L" and key.light == "off" and key.azimuth != "no":
                sets.setdefault(key.bracket, {})[key] = PhotoLabels(*yolo.read_boxes(path, size=SIZE))
        for files in sets.values():
            best = max(files, key=lambda k: (len(files[k].classes), -abs(np.log2(k.exposure_ms / 256)), k.exposure_ms))
            seeds[best.station, best.azimuth] = files[best]
    stations = sorted({station for station, _ in seeds})
    truth_boxes, hits, iou_sum = 0, 0, 0.0
    for station in stations:
        for source, target in itertools.permutations(polar().suns, 2):
            truth, found = seeds[station, target], seeds[station, source]
            counts = count_boxes(truth.boxes[truth.classes == 0], found.boxes[found.classes == 0])
            truth_boxes, hits, iou_sum = truth_boxes + counts.tp + counts.fn, hits + counts.tp, iou_sum + counts.iou_sum
    assert truth_boxes == 3216
    assert hits / truth_boxes == pytest.approx(0.833, abs=5e-4)
    assert iou_sum / truth_boxes == pytest.approx(0.675, abs=5e-4)


@pytest.mark.release
def test_the_release_compared_with_itself_is_perfect(release_root):
    report = score_folders(release_root / "Labels", release_root / "Labels", keys=lambda key: key.terrain == 11)
    assert report["classes"]["rock"]["tp"] == 2230  # shared facts on the labels, 1.1
    assert report["classes"]["shadow"]["f1"] == 1


def test_any_two_folders_are_paired_by_name(tmp_path):
    for folder in ("truth", "found"):
        (tmp_path / folder).mkdir()
        for name in ("frame_1", "frame_2"):
            (tmp_path / folder / f"{name}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    (tmp_path / "found/frame_2.txt").write_text("")
    report = score_folders(tmp_path / "truth", tmp_path / "found")
    assert (report["classes"]["rock"]["recall"], report["files"]["compared"]) == (0.5, 2)
    assert report["by"]["camera"] == {}


@pytest.mark.parametrize(
    ("name", "text", "error", "folder_of_error"),
    [
        ("01_A_off_180_L_0256", "0 0.5 0.5 0.1\n", FormatError, "truth"),
        ("frame_1", "rubbish\n", FormatError, "truth"),
        ("01_A_off_180_R_0256", "0 0.5 0.5 0.1 0.1\n", LabelError, "found"),
        ("frame_2", "0 0.5 0.5 0.1 0.1\n", LabelError, "found"),
    ],
)
def test_folders_without_a_common_valid_file_are_an_error(tmp_path, name, text, error, folder_of_error):
    other = "01_A_off_180_L_0256" if name[0] == "0" else "frame_1"
    for folder, stem, content in (("truth", name, text), ("found", other, "0 0.5 0.5 0.1 0.1\n")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / f"{stem}.txt").write_text(content)
    with pytest.raises(error) as caught:
        score_folders(tmp_path / "truth", tmp_path / "found")
    assert caught.value.path == tmp_path / folder_of_error


def test_polygons_of_a_run_are_scored_by_the_boxes_around_them(tmp_path):
    boxes = np.array([[100.0, 100, 200, 220], [400, 400, 500, 520]])
    corners = [np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) for x0, y0, x1, y1 in boxes]
    yolo.write_boxes(tmp_path / "truth/03_A_off_30_L_0256.txt", np.array([0, 1]), boxes, size=SIZE)
    yolo.write_polygons(tmp_path / "labels/03_A_off_30_L_0256.txt", list(zip((2, 3), corners, strict=True)), size=SIZE)
    report = score_folders(tmp_path / "truth", tmp_path / "labels")
    assert [row["miou"] for row in report["classes"].values()] == pytest.approx([1, 1], abs=1e-4)
