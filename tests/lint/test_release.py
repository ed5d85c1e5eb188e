import json

import pytest

from polarsim.errors import FormatError
from polarsim.lint.findings import MAX_LINES
from polarsim.lint.folders import lint_release
from polarsim.lint.rules import RULES

BOX = "0 0.500000 0.500000 0.100000 0.100000\n"
GROUND_AND_ROCK = "1 0 0 1 0 1 1 0 1\n2 0.45 0.45 0.55 0.45 0.55 0.55 0.45 0.55\n"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
LABELS, POLYGONS, MESHES = "Labels/Terrain11", "SegmentationLabels/terrain11/labels", "TerrainMeshes/Terrain11"


def make(root, files):
    for name, content in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return root


def sound(root):
    return make(
        root,
        {
            f"{LABELS}/11_A_off_30_L_0256.txt": BOX,
            f"{LABELS}/classes.txt": "rock\nshadow\n",
            f"{POLYGONS}/11_A_off_30_L_0256.txt": GROUND_AND_ROCK,
            f"{MESHES}/terrain11_rock1.obj": TRIANGLE,
        },
    )


def test_a_sound_folder_has_only_a_note_on_missing_shadow_polygons(tmp_path):
    report = lint_release(sound(tmp_path))
    assert [finding.defect for finding in report.findings] == ["no_shadow_polygon"]
    assert report.contents == {
        "Terrain11": {
            "label_files": 1, "rock_boxes": 1, "shadow_boxes": 0, "polygon_files": 1,
            "meshes": 1, "ground_meshes": 0, "cover_photos": 0,
        }
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "content", "defect"),
    [
        (f"{LABELS}/11_A_off_30_L_0512.txt", BOX + "0 0.5 0.5 0.1\n", "malformed"),
        (f"{LABELS}/11_A_off_30_L_0512.txt", BOX + "11_A_off_30_L_0512 0.5 0.5 0.1 0.1\n", "malformed"),
        (f"{LABELS}/11_A_off_30_L_0512.txt", "2 0.5 0.5 0.1 0.1\n", "malformed"),
        (f"{LABELS}/11_A_off_30_L_0512.txt", "", "empty_file"),
        (f"{LABELS}/11_A_off_30_L_0256 copy.txt", BOX, "stray_name"),
        (f"{LABELS}/11_A_off_30_L_0256good.txt", BOX, "stray_name"),
        (f"{LABELS}/.DS_Store", "", "system_file"),
        (f"{LABELS}/11_A_off_30_L_1028.txt", BOX, "impossible_exposure"),
        (f"{LABELS}/01_A_off_30_L_0256.txt", BOX, "wrong_folder"),
        (f"{POLYGONS}/01_A_off_30_L_0256.txt", GROUND_AND_ROCK, "wrong_folder"),
        (f"{POLYGONS}/11_A_off_30_L_0512.txt", "4 0.1 0.1 0.2 0.1 0.2 0.2\n", "malformed"),
        (
            f"{POLYGONS}/11_A_off_30_L_0512.txt",
            GROUND_AND_ROCK + "3 0.1 0.1 0.2 0.2 0.2 0.1 0.1 0.15\n",
            "invalid_ring",
        ),
        (f"{MESHES}/terrain11_rock2.obj", "v 0 0 0\nf 1 2 3\n", "unreadable_mesh"),
        (f"{MESHES}/terrain11_ground.obj", "", "unreadable_mesh"),
        (f"{MESHES}/terrain11_rock1 copy.obj", TRIANGLE, "stray_name"),
        ("CoverPhotoOfIndices/cover_photo_indexed_11_A.png", "no picture", "unreadable_picture"),
    ],
)
def test_defects_have_their_file_and_severity(tmp_path, name, content, defect):
    report = lint_release(make(sound(tmp_path), {name: content}))
    (finding,) = [finding for finding in report.findings if finding.severity != "note"]
    assert (finding.defect, finding.file) == (defect, name)
    assert finding.code == RULES[defect].code
    assert "\n" not in finding.detail
    assert report.count("error") == (RULES[defect].severity == "error")
    json.dumps(report.as_json(), allow_nan=False)


def test_defects_have_their_line(tmp_path):
    files = {
        f"{LABELS}/11_A_off_30_L_0512.txt": f"{BOX}\n{BOX}",  # the blank line counts as a line
        f"{LABELS}/11_A_off_30_L_1024.txt": BOX + "0 0.5 0.5 0.1\n",
    }
    report = lint_release(make(sound(tmp_path), files))
    lines = {finding.defect: finding.line for finding in report.findings}
    assert lines["duplicate"] == 3
    assert lines["malformed"] == 2


MALFORMED_BOXES = ("0 0.5 0.5 0.1", "a,b", "2 0.5 0.5 0.1 0.1", "0 0.5 0.5 0.1 0.1 0.9", "0 9 9 1 1", "0 x 0 0.1 1")
MALFORMED_POLYGONS = ("1 0.1 0.1", "9 0.1 0.1 0.2 0.1 0.2 0.2", "1 nan 0.1 0.2 0.1 0.2 0.2", "0 0.5 0.5 0.1 0.1")


@pytest.mark.parametrize(
    ("folder", "valid", "malformed"), [(LABELS, BOX, MALFORMED_BOXES), (POLYGONS, GROUND_AND_ROCK, MALFORMED_POLYGONS)]
)
@pytest.mark.parametrize("number", [1, 2, MAX_LINES, MAX_LINES + 1, MAX_LINES + 2, 1000])
def test_every_malformed_line_is_reported_up_to_a_maximum(tmp_path, folder, valid, malformed, number):
    name = f"{folder}/11_A_off_30_L_0512.txt"
    lines = [malformed[index % len(malformed)] + "\n" for index in range(number)]
    first = len(valid.splitlines()) + 2  # after a blank line
    report = lint_release(make(sound(tmp_path), {name: valid + "\n" + "".join(lines) + valid}))
    found = [finding for finding in report.findings if finding.defect == "malformed"]
    assert [(finding.file, finding.line) for finding in found] == [
        (name, first + index) for index in range(min(number, MAX_LINES + 1))
    ]
    if number > MAX_LINES:
        assert f"{number - MAX_LINES} " in found[-1].detail
        assert f"line {first + number - 1}" in found[-1].detail


def test_a_copy_is_compared_with_its_regular_file(tmp_path):
    root = make(
        sound(tmp_path),
        {f"{LABELS}/11_A_off_30_L_0256 copy.txt": BOX, f"{LABELS}/11_A_off_30_L_0256good.txt": BOX * 2},
    )
    found = [finding for finding in lint_release(root).findings if finding.defect == "stray_name"]
    details = {finding.file.split("/")[-1]: finding.detail for finding in found}
    assert sorted(details) == ["11_A_off_30_L_0256 copy.txt", "11_A_off_30_L_0256good.txt"]
    same, different = (details[name] for name in sorted(details))
    assert same.endswith("11_A_off_30_L_0256.txt")
    assert different.endswith("11_A_off_30_L_0256.txt")
    assert same != different


def test_a_folder_without_terrains_is_refused_with_the_expected_layout(tmp_path):
    for root in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(FormatError, match="Labels/TerrainNN"):
            lint_release(root)


@pytest.mark.release
@pytest.mark.slow
def test_the_published_folders_have_known_defects(release_root):
    report = lint_release(release_root, workers=2)
    terrains = ("01", "03", "04", "08", "11", "12")
    counted = {
        name: [
            sum(one.defect == name and f"errain{terrain}/" in one.file for one in report.findings)
            for terrain in terrains
        ]
        for name in RULES
    }
    # Counts of terrains 01, 03, 04, 08, 11 are known. Terrain 12 was counted by the linter and checked by eye: the left
    # files of position C under azimuth 270 have one rock and 21 shadows, the right files 11 and 11.
    assert {name: counts for name, counts in counted.items() if name in EXPECTED} == EXPECTED
    errors = [one for one in report.findings if one.severity == "error" and one.file.split("errain")[1][:2] in terrains]
    assert len(errors) == 3 + 12  # polygons of the other camera, and files with swapped classes


EXPECTED = {
    "stray_name": [0, 3, 58, 0, 2, 2],
    "impossible_exposure": [0, 0, 1, 0, 0, 0],
    "missing_file": [0, 1, 1, 1, 1, 0],
    "empty_file": [0, 0, 0, 0, 1, 0],
    "malformed": [0, 0, 0, 0, 0, 0],
    "duplicate": [0, 0, 0, 0, 0, 0],
    "near_duplicate": [0, 20, 1, 0, 0, 24],
    "rock_on_shadow": [0, 0, 0, 0, 0, 0],
    "out_of_photo": [0, 0, 0, 0, 0, 0],
    "sliver": [0, 20, 10, 10, 0, 10],
    "giant": [0, 0, 0, 0, 0, 0],
    "rock_missing": [0, 0, 1, 4, 0, 10],
    "rock_extra": [0, 0, 1, 0, 5, 2],
    "rock_moved": [1, 2, 3, 12, 0, 3],
    "shadow_missing": [8, 0, 0, 3, 8, 5],
    "shadow_extra": [0, 0, 0, 0, 1, 1],
    "shadow_moved": [1, 0, 3, 0, 0, 0],
    "shadows_off_late": [0, 0, 7, 1, 3, 0],
    "few_shadows": [5, 0, 10, 3, 2, 20],
    "many_shadows": [0, 0, 0, 0, 0, 12],
    "missing_right": [0, 0, 6, 0, 0, 0],
    "copied_azimuth": [2, 0, 5, 0, 0, 0],
    "swapped_class": [0, 0, 0, 0, 0, 12],
    "light_rocks_differ": [1, 2, 0, 2, 0, 0],
    "light_rock_moved": [12, 2, 10, 0, 0, 0],
    "light_shadows_differ": [1, 3, 1, 1, 3, 1],
    "light_shadow_moved": [10, 1, 8, 0, 1, 1],
    "other_azimuth": [0, 0, 0, 0, 0, 0],
    "other_view": [0, 0, 0, 0, 0, 0],
    "off_epipolar": [0, 0, 0, 0, 0, 0],
    "other_camera_polygons": [0, 0, 0, 0, 3, 0],
}
