"""`validate`, `score` and `masks` read label files as polarsim and other tools store them."""

import json

import cv2
import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png, yolo
from polarsim.formats.release import SNAKEMAKE_FILE
from polarsim.lint.folders import lint_folder
from polarsim.lint.rules import RULES
from polarsim.site import polar
from tests.lint.conftest import BOXES, CLASSES, KEY, LABELS, path
from tests.support.polar_photos import SIZE

BOX, DETECTION = "0 0.5 0.5 0.2 0.2\n", "0 0.5 0.5 0.2 0.2 0.73\n"
RING = "2 0.1 0.1 0.2 0.1 0.2 0.2 0.1 0.2\n"


def write(file, text):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def picture(file):
    file.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(file), np.zeros((240, 320), np.uint8))


def defects(root):
    return [(one.defect, one.file) for one in lint_folder(root, set(RULES)).findings if one.severity != "note"]


@pytest.mark.parametrize(
    ("images", "labels"),
    [
        ("images", "labels"),
        ("images/train", "labels/train"),
        ("train/images", "train/labels"),
        (".", "."),
        ("pictures", "labels"),  # of polarsim detect
    ],
)
@pytest.mark.parametrize("text", [BOX, DETECTION, RING.replace("2", "0", 1)])
def test_label_files_with_pictures_are_validated_in_every_usual_layout(tmp_path, images, labels, text):
    picture(tmp_path / images / "one.jpg")
    write(tmp_path / labels / "one.txt", text)
    write(tmp_path / labels / "classes.txt", "rock\nshadow\n")
    report = lint_folder(tmp_path, set(RULES))
    assert (report.findings, report.contents["folder"]["boxes"]) == ([], 1)
    broken = write(tmp_path / labels / "one.txt", text + "0 0.5 0.5 0.2 0.2 17\n")
    assert defects(tmp_path) == [("malformed", broken.relative_to(tmp_path).as_posix())]


@pytest.mark.parametrize("folder", ["{}", "labels/{}", "boxes", "labels/boxes"])
def test_label_files_of_a_run_are_validated_without_its_marker_files(tmp_path, folder):
    root = tmp_path / "run"
    place = root / folder.format("boxes") / "Terrain11"
    for exposure_ms in polar().exposures_of(11, "30"):
        yolo.write_boxes(place / f"{KEY.with_exposure(exposure_ms)}.txt", CLASSES, BOXES, size=SIZE)
    write(place / SNAKEMAKE_FILE, "")
    assert defects(root) == []
    yolo.write_boxes(place / f"{KEY.with_exposure(512)}.txt", CLASSES[1:], BOXES[1:], size=SIZE)
    assert [name for name, _ in defects(root)] == ["rock_missing"]
    assert lint_folder(place.parent, set(RULES)).count("warning") == 1


def test_flat_label_files_are_validated_by_the_names_of_their_class_list(tmp_path):
    for exposure_ms in polar().exposures_of(11, "30"):
        yolo.write_boxes(tmp_path / f"{KEY.with_exposure(exposure_ms)}.txt", 1 - CLASSES, BOXES, size=SIZE)
    write(tmp_path / "obj.names", "shadow\nrock\n")
    report = lint_folder(tmp_path, set(RULES))
    assert report.findings == []
    assert report.contents["Terrain11"]["rock_boxes"] == (CLASSES == 0).sum() * len(polar().exposures_of(11, "30"))
    write(tmp_path / "notes of mine.txt", "")
    assert defects(tmp_path) == [("stray_name", "notes of mine.txt")]


@pytest.mark.parametrize("files", [{}, {"holiday.txt": BOX}, {"a/b.json": "{}"}])
def test_a_folder_of_unknown_layout_is_refused_with_its_content(tmp_path, files):
    for name, text in files.items():
        write(tmp_path / "some" / name, text)
    (tmp_path / "some").mkdir(exist_ok=True)
    with pytest.raises(FormatError) as caught:
        lint_folder(tmp_path / "some", set(RULES))
    assert all(name in str(caught.value) for name in files)
    with pytest.raises(FormatError, match="no such folder"):
        lint_folder(tmp_path / "nowhere", set(RULES))


def test_a_repaired_copy_has_only_label_files_and_is_named_in_the_output(root, tmp_path, polarsim):
    for name in ("Terrain11/photo.png", "TerrainMeshes/Terrain11/terrain11_rock1 copy.obj", "truth/poses.json"):
        write(root / name, "large")
    write(path(root, 256).with_name(SNAKEMAKE_FILE), "")
    write(path(root, 256), path(root, 256).read_text() + "0 0.5\n")
    done = polarsim("validate", root, "--fix", tmp_path / "fixed")
    copied = {file.relative_to(tmp_path / "fixed").as_posix() for file in (tmp_path / "fixed").rglob("*.*")}
    assert copied == {"changes.csv", *(f"{LABELS}/{file.name}" for file in (root / LABELS).glob("*.txt"))}
    last = done.stdout.splitlines()[-1]
    assert last.startswith("1 repairs ")
    assert str(tmp_path / "fixed/changes.csv") in last
    assert any(line.split() == ["F110", "error", "malformed", "1"] for line in done.stdout.splitlines())
    as_json = polarsim("validate", root, "--fix", tmp_path / "again", "--format", "json")
    assert json.loads(as_json.stdout)["errors"] == 1
    assert "1 repairs" in as_json.stderr


def test_labels_of_other_class_numbers_are_not_repaired(root, tmp_path):
    write(root / LABELS / "classes.txt", "shadow\nrock\n")
    with pytest.raises(FormatError, match=r"classes\.txt"):
        lint_folder(root, set(RULES), fix=tmp_path / "fixed")
    assert not (tmp_path / "fixed").exists()


@pytest.mark.parametrize("place", ["", "labels", "boxes/Terrain11", "Labels/Terrain11"])
def test_detections_are_scored_and_truth_with_a_confidence_is_refused(tmp_path, polarsim, place):
    write(tmp_path / f"truth/{KEY}.txt", BOX)
    write(tmp_path / "found" / place / f"{KEY}.txt", DETECTION)
    done = polarsim("score", tmp_path / "truth", tmp_path / "found", "--json", tmp_path / "score.json")
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "score.json").read_text())["classes"]["rock"]["f1"] == 1
    swapped = polarsim("score", tmp_path / "found", tmp_path / "truth")
    assert swapped.returncode == 1
    assert "confidence" in swapped.stderr


def test_scored_labels_use_their_class_list(tmp_path, polarsim):
    write(tmp_path / f"truth/{KEY}.txt", BOX + "1 0.3 0.3 0.1 0.1\n")
    write(tmp_path / f"found/{KEY}.txt", "1 0.5 0.5 0.2 0.2 0.9\n0 0.3 0.3 0.1 0.1 0.8\n")
    write(tmp_path / "found/data.yaml", "names: [shadow, rock]")
    polarsim("score", tmp_path / "truth", tmp_path / "found", "--json", tmp_path / "score.json")
    assert [row["f1"] for row in json.loads((tmp_path / "score.json").read_text())["classes"].values()] == [1, 1]


def test_labels_scored_against_themselves_are_reported(tmp_path, polarsim):
    write(tmp_path / f"truth/{KEY}.txt", BOX)
    write(tmp_path / f"same/{KEY}.txt", BOX + "0 0.1 0.1 0.1 0.1\n")
    write(tmp_path / f"other/{KEY}.txt", BOX.replace("0.2 0.2", "0.21 0.2"))
    assert "themselves" in polarsim("score", tmp_path / "truth", tmp_path / "same").stderr
    assert "themselves" not in polarsim("score", tmp_path / "truth", tmp_path / "other").stderr


@pytest.mark.parametrize(
    ("place", "given"),
    [
        ("", ""),
        ("Terrain11", ""),
        ("polygons/Terrain11", ""),
        ("polygons/Terrain11", "polygons"),
        ("SegmentationLabels/terrain11/labels", ""),
    ],
)
def test_masks_are_painted_from_every_layout_of_polygons(tmp_path, polarsim, place, given):
    write(tmp_path / "in" / place / f"{KEY}.txt", RING)
    write(tmp_path / "in" / place / SNAKEMAKE_FILE, "")
    done = polarsim("masks", tmp_path / "in" / given, tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert png.read_png(tmp_path / f"out/{KEY}.png")[150, 300] == 128
    assert polarsim("masks", tmp_path / "nowhere", tmp_path / "more").returncode == 1


def test_a_triangle_is_a_polygon_but_a_box_with_a_track_id_is_not(tmp_path):
    triangle = write(tmp_path / f"{KEY}.txt", "2 0.4 0.5 0.45 0.5 0.45 0.55\n")
    assert len(yolo.read_polygons(triangle, size=SIZE)[0][1]) == 3
    with pytest.raises(FormatError, match="track id"):
        yolo.read_polygons(write(triangle, "2 0.5 0.5 0.05 0.05 0.9 1\n"), size=SIZE)
    both = write(triangle, RING + "2 0.4 0.5 0.45 0.5 1 0.55\n")  # at the image border, next to a larger polygon
    assert len(yolo.read_polygons(both, size=SIZE)) == 2


@pytest.mark.parametrize("below", ["", "Terrain03"])
def test_polygons_without_boxes_are_read_as_polygons(tmp_path, below):
    ring = np.array([[100.0, 100], [200, 100], [200, 220], [100, 220]])
    yolo.write_polygons(tmp_path / below / "03_A_off_30_L_0256.txt", [(2, ring), (3, ring + 300)], size=SIZE)
    report = lint_folder(tmp_path, set(RULES))
    (content,) = report.contents.values()
    assert content["polygon_files"] == 1
    assert content["label_files"] == 0
    assert "malformed" not in report.counts
