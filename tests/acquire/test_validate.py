import json

import pytest

from polarsim.acquire.defects import SEVERITY
from polarsim.acquire.validate import validate_release
from polarsim.errors import FormatError

BOX = "0 0.500000 0.500000 0.100000 0.100000\n"
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
            f"{POLYGONS}/11_A_off_30_L_0256.txt": "2 0.1 0.1 0.2 0.1 0.2 0.2\n",
            f"{MESHES}/terrain11_rock1.obj": TRIANGLE,
        },
    )


def test_a_sound_folder_has_no_finding(tmp_path):
    report = validate_release(sound(tmp_path))
    assert (report["findings"], report["errors"], report["warnings"]) == ([], 0, 0)
    assert report["terrains"] == {
        "11": {
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
        (f"{POLYGONS}/01_A_off_30_L_0256.txt", "2 0.1 0.1 0.2 0.1 0.2 0.2\n", "wrong_folder"),
        (f"{POLYGONS}/11_A_off_30_L_0512.txt", "4 0.1 0.1 0.2 0.1 0.2 0.2\n", "malformed"),
        (f"{POLYGONS}/11_A_off_30_L_0512.txt", "2 0.1 0.1 0.2 0.2 0.2 0.1 0.1 0.15\n", "invalid_ring"),
        (f"{MESHES}/terrain11_rock2.obj", "v 0 0 0\nf 1 2 3\n", "unreadable_mesh"),
        (f"{MESHES}/terrain11_ground.obj", "", "unreadable_mesh"),
        (f"{MESHES}/terrain11_rock1 copy.obj", TRIANGLE, "stray_name"),
        ("CoverPhotoOfIndices/cover_photo_indexed_11_A.png", "no picture", "unreadable_picture"),
    ],
)
def test_a_defect_is_found_with_its_file_and_severity(tmp_path, name, content, defect):
    report = validate_release(make(sound(tmp_path), {name: content}))
    (finding,) = report["findings"]
    assert (finding["defect"], finding["file"], finding["severity"]) == (defect, name, SEVERITY[defect])
    assert report["counts"] == {defect: {"11": 1}}
    assert report["errors"] == (SEVERITY[defect] == "error")
    assert "\n" not in finding["detail"]
    json.dumps(report, allow_nan=False)


def test_what_cannot_be_read_is_an_error_and_what_can_be_left_out_a_warning():
    errors = {defect for defect, severity in SEVERITY.items() if severity == "error"}
    assert errors == {"malformed", "unreadable_mesh", "unreadable_picture", "out_of_photo"}


def test_a_copy_is_compared_with_its_regular_file(tmp_path):
    root = make(
        sound(tmp_path),
        {f"{LABELS}/11_A_off_30_L_0256 copy.txt": BOX, f"{LABELS}/11_A_off_30_L_0256good.txt": BOX * 2},
    )
    details = {finding["file"].split("/")[-1]: finding["detail"] for finding in validate_release(root)["findings"]}
    assert details == {
        "11_A_off_30_L_0256 copy.txt": "the same bytes as 11_A_off_30_L_0256.txt",
        "11_A_off_30_L_0256good.txt": "other content than 11_A_off_30_L_0256.txt",
    }


def test_a_folder_without_terrains_is_one_line_with_what_was_looked_for(tmp_path):
    for root in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(FormatError, match="no terrain, looked for Labels/TerrainNN"):
            validate_release(root)


@pytest.mark.release
@pytest.mark.slow
def test_the_published_folders_have_the_defects_that_were_counted_before(release_root):
    report = validate_release(release_root)
    terrains = ("01", "03", "04", "08", "11")
    counted = {
        defect: [report["counts"].get(defect, {}).get(terrain, 0) for terrain in terrains] for defect in SEVERITY
    }
    # Shared facts on the labels, 4.1, files of terrains 01, 03, 04, 08, 11.
    assert {name: counts for name, counts in counted.items() if name in EXPECTED} == EXPECTED
    assert report["errors"] == 0


EXPECTED = {
    "stray_name": [0, 3, 58, 0, 2],
    "impossible_exposure": [0, 0, 1, 0, 0],
    "missing_file": [0, 1, 1, 1, 1],
    "empty_file": [0, 0, 0, 0, 1],
    "malformed": [0, 0, 0, 0, 0],
    "duplicate": [0, 0, 0, 0, 0],
    "near_duplicate": [0, 20, 1, 0, 0],
    "rock_on_shadow": [0, 0, 0, 0, 0],
    "out_of_photo": [0, 0, 0, 0, 0],
    "sliver": [0, 20, 10, 10, 0],
    "giant": [0, 0, 0, 0, 0],
    "rock_missing": [0, 0, 1, 4, 0],
    "rock_extra": [0, 0, 1, 0, 5],
    "rock_moved": [1, 2, 3, 12, 0],
    "shadow_missing": [8, 0, 0, 3, 8],
    "shadow_extra": [0, 0, 0, 0, 1],
    "shadow_moved": [1, 0, 3, 0, 0],
    "shadows_off_late": [0, 0, 7, 1, 3],
}
