import logging

import pytest

from polarsim.errors import LabelError
from polarsim.formats import mesh_names, release
from polarsim.photo import PhotoKey
from polarsim.site import polar

KEY = PhotoKey.parse("01_A_off_180_L_0256")
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def make(root, *names, content=""):
    for name in names:
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)


def test_only_exact_names_are_label_files(tmp_path):
    folder = "Labels/Terrain01"
    strays = [
        ".DS_Store",
        "01_A_off_180_L_0256 copy.txt",
        "01_A_off_180_L_0256good.txt",
        "01_A_off_180_L_0256txt.txt",
        "01_A_off_180_L_1028.txt",
        "01_A_off_180_L_0256.TXT",
        "02_A_off_180_L_0256.txt",
        "notes.md",
    ]
    make(tmp_path, f"{folder}/{KEY}.txt", f"{folder}/classes.txt", *(f"{folder}/{name}" for name in strays))
    assert list(release.label_files(tmp_path, 1, polar().key)) == [KEY]
    assert {path.name for path in release.stray_files(tmp_path, 1, polar().key)} == set(strays)


def test_a_missing_folder_has_no_files(tmp_path):
    assert release.label_files(tmp_path, 1, polar().key) == {}
    assert release.polygon_files(tmp_path, 1, polar().key) == {}
    assert release.released_meshes(tmp_path, 1) == {}
    assert release.cover_photos(tmp_path, 1) == {}
    assert release.ground_file(tmp_path, 1) is None
    assert release.stray_files(tmp_path, 1, polar().key) == []
    assert release.terrains(tmp_path) == []


def test_polygons_of_another_terrain_are_strays(tmp_path):
    folder = "SegmentationLabels/terrain11/labels"
    make(tmp_path, f"{folder}/09_A_off_no_R_0032.txt", f"{folder}/11_A_off_no_R_0032.txt")
    assert [str(key) for key in release.polygon_files(tmp_path, 11, polar().key)] == ["11_A_off_no_R_0032"]
    assert [path.name for path in release.stray_files(tmp_path, 11, polar().key)] == ["09_A_off_no_R_0032.txt"]


def test_full_meshes_are_preferred_and_other_names_are_strays(tmp_path):
    folder = "TerrainMeshes/Terrain01"
    names = ["rock2.obj", "rock2_decimate-005.obj", "rock10_decimate-005.obj", "ground.obj"]
    make(tmp_path, *(f"{folder}/terrain01_{name}" for name in names), content=TRIANGLE)
    make(tmp_path, f"{folder}/terrain02_rock3.obj", f"{folder}/terrain01_rock2 copy.obj", content=TRIANGLE)
    found = release.released_meshes(tmp_path, 1)
    assert {rock: path.name for rock, path in found.items()} == {
        2: "terrain01_rock2.obj",
        10: "terrain01_rock10_decimate-005.obj",
    }
    assert list(found) == [2, 10]
    assert release.ground_file(tmp_path, 1).name == "terrain01_ground.obj"
    assert {path.name for path in release.stray_files(tmp_path, 1, polar().key)} == {
        "terrain02_rock3.obj",
        "terrain01_rock2 copy.obj",
    }


def test_cover_photos_are_found_by_position(tmp_path):
    covers = "CoverPhotoOfIndices/cover_photo_indexed"
    make(tmp_path, f"{covers}_01_C.png", f"{covers}_01_A.png", f"{covers}_02_A.png", f"{covers}_01_A copy.png")
    found = release.cover_photos(tmp_path, 1)
    assert {position: path.name for position, path in found.items()} == {
        "A": "cover_photo_indexed_01_A.png",
        "C": "cover_photo_indexed_01_C.png",
    }


def test_a_photo_with_two_label_files_is_an_error(tmp_path):
    make(tmp_path, f"{KEY}.txt", f"Terrain01/{KEY}.txt")
    with pytest.raises(LabelError):
        release.key_files(tmp_path)


def test_strays_are_logged_in_a_single_line_with_number_and_examples(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        release.log_strays([tmp_path / f"{letter} copy.txt" for letter in "abcdef"], "here")
        release.log_strays([], "there")
    assert [record.getMessage() for record in caplog.records] == [
        "here: 6 stray files skipped: 'a copy.txt', 'b copy.txt', 'c copy.txt', ..."
    ]


@pytest.mark.release
def test_the_published_folders_have_the_known_numbers_of_files(release_root):
    # shared facts on the labels, 1.1 and 1.4; terrain 04 without the impossible exposure
    assert {t: len(release.label_files(release_root, t, polar().key)) for t in (1, 3, 4, 8, 11)} == {
        1: 280, 3: 347, 4: 359, 8: 353, 11: 347,
    }  # fmt: skip
    strays = [path.name for path in release.stray_files(release_root, 4, polar().key)]
    assert len(strays) == 58 + 2  # .DS_Store and 04_A_on_180_R_1028.txt
    assert len(release.released_meshes(release_root, 1)) == 15


def test_terrains_have_numbers_or_names_in_folders_and_files(tmp_path):
    root = tmp_path / "release"
    for terrain in (1, "yard-a"):
        for folder in (
            release.label_folder(root, terrain),
            release.polygon_folder(root, terrain),
            release.mesh_folder(root, terrain),
        ):
            folder.mkdir(parents=True)
        for name in (mesh_names.rock_name(terrain, 3), mesh_names.ground_name(terrain), "terrain1_rock3.obj"):
            (release.mesh_folder(root, terrain) / name).write_text("")
        assert list(release.released_meshes(root, terrain)) == [3]
        assert [path.name for path in release.stray_files(root, terrain, PhotoKey.parse)] == ["terrain1_rock3.obj"]
    (root / "Labels" / "Terrain1").mkdir()
    (root / "TerrainMeshes" / "Terrain01 copy").mkdir()
    assert release.terrains(root) == [1, "yard-a"]
    (release.label_folder(root, "yard-a") / "yard-a_gate_off_45_L_0040.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    assert [str(key) for key in release.label_files(root, "yard-a")] == ["yard-a_gate_off_45_L_0040"]
    assert release.label_files(root, 1) == {}
    assert release.TERRAIN_LAYOUT.terrains(root, PhotoKey.parse) == []  # TerrainMeshes is no terrain
