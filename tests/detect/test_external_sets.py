import pandas as pd
import pytest

from polarsim.detect.external_sets import compare_sets, identify
from polarsim.errors import DetectError, FormatError
from polarsim.formats.tables import write_parquet

# Two rocks of 0.2 x 0.2 in an image; the labels of the second domain are slightly shifted.
LABELS_A = "0 0.3 0.3 0.2 0.2\n0 0.7 0.7 0.2 0.2\n"
LABELS_B = "0 0.71 0.7 0.2 0.2\n0 0.31 0.3 0.2 0.2\n1 0.5 0.5 0.1 0.1\n"
FOUND_A = "0 0.3 0.3 0.2 0.2 0.9\n0 0.7 0.7 0.2 0.1 0.8\n"  # IoU 1 and 0.5
FOUND_B = "0 0.31 0.3 0.2 0.1 0.9\n0 0.71 0.7 0.2 0.2 0.1\n"  # IoU 0.5, and a box below the confidence threshold


@pytest.fixture
def folders(tmp_path):
    texts = {"la": LABELS_A, "pa": FOUND_A, "lb": LABELS_B, "pb": FOUND_B}
    for name, text in texts.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "one.txt").write_text(text)
    return tmp_path


def compare(root, **options):
    return compare_sets((root / "la", root / "lb"), (root / "pa", root / "pb"), resamples=100, **options)


def test_yolo_folders_are_paired_by_overlap_in_any_line_order(folders):
    report = compare(folders)
    rock = report["classes"]["rock"]
    assert rock["pairs"] == 2
    assert (rock["iou_mean_a"], rock["iou_mean_b"]) == (pytest.approx(0.75), pytest.approx(0.25))
    assert (rock["ipd"], rock["ipd_abs"]) == (pytest.approx(0.5), pytest.approx(0.5))  # 1 - 0.5 and 0.5 - 0
    assert (report["unit"], rock["ipd_low"]) == ("photo", None)  # a single image has no interval
    assert report["classes"]["shadow"] == {
        "pairs": 0, "units": 0, "ipd": None, "ipd_abs": None, "ipd_low": None, "ipd_high": None, "ipd_abs_low": None,
        "ipd_abs_high": None, "labels_a": 0, "iou_mean_a": None, "labels_b": 1, "iou_mean_b": 0.0,
    }  # fmt: skip


def test_images_without_predictions_are_reported_and_excluded(folders):
    whole = compare(folders)["classes"]["rock"]
    for side, text in (("la", LABELS_A), ("lb", LABELS_B)):
        for picture in ("two", "three"):
            (folders / side / f"{picture}.txt").write_text(text)
    report = compare(folders)
    assert (report["pictures"], report["without_predictions_a"]) == (1, ["three", "two"])
    assert report["classes"]["rock"] == whole  # a third of this, if two images counted with IoU 0
    assert compare(folders, missing="zero")["classes"]["rock"]["ipd"] == pytest.approx(whole["ipd"] / 3)
    for side in ("pa", "pb"):
        (folders / side / "two.txt").write_text("")  # an image without detections
    assert compare(folders)["classes"]["rock"]["ipd"] == pytest.approx(whole["ipd"] / 2)


def test_predictions_of_other_pictures_are_refused(folders):
    for side in ("pa", "pb"):
        (folders / side / "one.txt").rename(folders / side / "other.txt")
    with pytest.raises(DetectError):
        compare(folders)


def test_confidence_and_rules_are_applied(folders):
    assert compare(folders, confidence=0.05)["classes"]["rock"]["ipd"] == pytest.approx(0)  # 0.5 and -0.5 cancel
    assert compare(folders, undetected="left_out")["classes"]["rock"]["pairs"] == 1
    assert compare(folders, pair_iou=0.95)["classes"]["rock"]["pairs"] == 0  # labels are shifted by 0.05 of a box
    alone = compare(folders, pair_iou=0.95, unpaired="zero")["classes"]["rock"]
    assert (alone["pairs"], alone["ipd"]) == (4, pytest.approx((1 + 0.5 - 0.5 - 0) / 4))


def test_class_names_come_from_the_class_file(folders):
    for name in ("la", "pa", "lb", "pb"):
        (folders / name / "classes.txt").write_text("boulder\n")
    assert set(compare(folders)["classes"]) == {"boulder", "class 1"}


def test_tables_are_paired_by_rock_id_and_photo_keys_give_views(tmp_path):
    keys = ["01_A_off_180_L_0256", "01_A_off_180_R_0256"]
    corners = {"x0": 0.0, "y0": 0.0, "x1": 10.0, "y1": 10.0}
    labels = pd.DataFrame([{"key": key, "kind": "rock", "rock": 7} | corners for key in keys])
    write_parquet(tmp_path / "la", labels)
    write_parquet(tmp_path / "lb", labels.assign(x0=500.0, x1=510.0))  # the same rock without overlap
    found = labels.drop(columns="rock").assign(confidence=0.9)
    write_parquet(tmp_path / "pa", found)
    write_parquet(tmp_path / "pb", found)
    report = compare(tmp_path)
    assert (report["paired_by"], report["unit"], report["classes"]["rock"]["units"]) == ("rock id", "view", 2)
    assert report["classes"]["rock"]["ipd"] == 1


def test_labels_are_matched_one_to_one():
    columns = ["key", "kind", "x0", "y0", "x1", "y1"]
    first = pd.DataFrame([("a", "rock", 0, 0, 10, 10)], columns=columns)
    second = pd.DataFrame([("a", "rock", 0, 0, 10, 9), ("a", "rock", 0, 0, 10, 10)], columns=columns)
    one, other = identify(first, second, 0.5)
    assert one["rock"].tolist() == [1]
    assert (other["rock"] == 1).tolist() == [False, True]
    assert other["rock"].is_unique


def test_bad_sets_are_named(folders):
    (folders / "pb" / "one.txt").write_text("0 0.3 0.3 0.2 0.2\n")
    with pytest.raises(DetectError, match=r"one\.txt"):
        compare(folders)
    (folders / "pb" / "one.txt").write_text("0 0.3 0.3 0.2\n")
    with pytest.raises(FormatError, match=r"one\.txt:1"):
        compare(folders)
    (folders / "lb" / "one.txt").rename(folders / "lb" / "other.txt")
    (folders / "pb" / "one.txt").write_text(FOUND_B)
    with pytest.raises(DetectError):
        compare(folders)


def test_the_output_folder_of_detect_is_accepted(folders):
    whole = compare(folders)
    for side in ("pa", "pb"):
        (folders / side / "labels").mkdir()
        (folders / side / "one.txt").rename(folders / side / "labels/one.txt")
        (folders / side / "coco.json").write_text("{}")
    assert compare(folders) == whole


@pytest.mark.parametrize("ending", ["17", "1.5", "-0.1", "0.9 3", "0.9 1"])
def test_a_track_id_is_no_confidence(folders, ending):
    (folders / "pa/one.txt").write_text(f"0 0.3 0.3 0.2 0.2 0.9\n0 0.7 0.7 0.2 0.1 {ending}\n")
    with pytest.raises(FormatError, match=r"one\.txt:2"):
        compare(folders)
