import json
import logging
import shutil

import numpy as np
import pytest

from polarsim.acquire.index import index_terrain, merge_photos
from polarsim.acquire.inputs import raw_inputs
from polarsim.acquire.options import SeedOptions, SourceOptions
from polarsim.acquire.seeds import find_labels
from polarsim.errors import FormatError, PolarsimError
from polarsim.formats import nasa, png
from polarsim.formats.clouds import write_cloud
from polarsim.formats.tables import read_parquet
from polarsim.geometry.stereo import rectified_left
from polarsim.grid import GridOptions
from polarsim.photo import PhotoKey
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.rigs import read_rig
from polarsim.site import polar as polar_site
from tests.support.polar_files import photo_path
from tests.support.polar_photos import HEIGHT, WIDTH
from tests.support.polar_rig import default_rig

BOX = "0 0.500000 0.500000 0.100000 0.100000\n"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
REAL_CALIBRATION = """\
CAMERA_MATRIX_LEFT: 2068.44 0 964.405 0 2064.29 593.512 0 0 1
DISTORTION_COEFFICIENTS_LEFT: -0.108441 0.158389 0.000537106 -0.00127904
CAMERA_MATRIX_RIGHT: 2065.6 0 952.098 0 2061.9 606.559 0 0 1
DISTORTION_COEFFICIENTS_RIGHT: -0.114041 0.178219 -0.000146877 -0.00112736
ROTATION_MATRIX: 0.999997 0.00172602 0.0019164 -0.00172807 0.999998 0.00106908 -0.00191455 -0.00107239 0.999998
TRANSLATION_VECTOR: -0.301556 0.000599 0.001489
"""  # file of terrain 11


def index(tmp_path, source, *, terrain=11, positions="ABC", seeds=None, grid=None):
    out = tmp_path / "out" / f"Terrain{terrain:02d}"
    index_terrain(
        site=polar_site(),
        terrain=terrain,
        positions=list(positions),
        source=source,
        seed_options=seeds or (SeedOptions() if (source.root / "Labels").is_dir() else "none"),
        photos=out / "photos.parquet",
        calibration=out / "calibration.json",
        inventory=out / "inventory.json",
        seeds=out / "seeds",
        grid=grid,
    )
    return out


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    path = tmp_path_factory.mktemp("photos") / "photo.png"
    png.write_png(path, np.full((HEIGHT, WIDTH), 16, np.uint16))
    return path


@pytest.fixture
def release(tmp_path):
    """A release with a single seed and a single mesh."""
    root = tmp_path / "release"
    write(root / "Labels/Terrain11/11_A_off_30_L_0256.txt", BOX)
    write(root / "TerrainMeshes/Terrain11/terrain11_rock2.obj", TRIANGLE)
    return SourceOptions(kind="release", root=root)


@pytest.fixture
def polar(tmp_path):
    """NASA's layout with a scan and a calibration, without photos and labels."""
    root = tmp_path / "polar"
    write(root / "Terrain11_FreshCrater/stereo.calibration", REAL_CALIBRATION)
    points = np.full((4, 6, 3), 2.0)
    nasa.write_range_map(root / "GroundTruth_RectifiedRangeMaps/Terrain11/PosA_org-XYZ.tif", points)
    write_cloud(root / "Terrain11_FreshCrater/PosC.xyz", points[0], np.ones(6))
    return SourceOptions(kind="files", root=root)


def add_photo(photo, source, name):
    key = PhotoKey.parse(name)
    path = source.root / photo_path(key, "259659217")
    path.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(photo, path)
    return path


def test_a_release_with_a_single_seed_and_mesh_is_indexed(tmp_path, release):
    out = index(tmp_path, release)
    inventory = read_inventory(out / "inventory.json")
    assert list(inventory.meshes) == ["2"]
    assert (inventory.calibration, inventory.scanned, inventory.ground) == ("", [], "")
    assert [path.name for path in (out / "seeds").iterdir()] == ["11_A_off_30_L_0256.txt"]
    assert (out / "seeds/11_A_off_30_L_0256.txt").read_text() == BOX
    assert len(read_parquet(out / "photos.parquet")) == 0
    assert json.loads((out / "calibration.json").read_text())["source"] == "stated"
    np.testing.assert_allclose(read_rig(out / "calibration.json").left.fx, default_rig().left.fx)


def test_stray_files_of_a_release_are_logged_once_and_skipped(tmp_path, release, caplog):
    for name in ("11_A_off_30_L_0256 copy.txt", "11_A_off_30_L_0512good.txt", ".DS_Store", "11_A_on_180_R_1028.txt"):
        write(release.root / "Labels/Terrain11" / name, BOX * 3)
    with caplog.at_level(logging.WARNING):
        out = index(tmp_path, release)
    assert sum("4 stray files" in record.getMessage() for record in caplog.records) == 1
    assert len(read_inventory(out / "inventory.json").stray) == 4
    assert len(list((out / "seeds").iterdir())) == 1


@pytest.mark.parametrize(
    ("kind", "changes", "named"),
    [
        ("release", {"terrain": 5}, "Labels/Terrain05"),
        ("polar", {"terrain": 5}, r"Terrain05_\*"),
        ("missing root", {}, "nowhere"),
        ("release", {"seeds": SeedOptions(azimuths=["180"])}, r"Labels/Terrain11: .*180"),
    ],
)
def test_missing_data_are_a_one_line_error_without_output(tmp_path, release, polar, kind, changes, named):
    missing = SourceOptions(kind="release", root=tmp_path / "nowhere")
    source = {"release": release, "polar": polar, "missing root": missing}[kind]
    with pytest.raises(PolarsimError, match=named) as caught:
        index(tmp_path, source, **changes)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_scans_and_calibration_suffice_without_seeds(tmp_path, polar):
    out = index(tmp_path, polar, seeds="none")
    inventory = read_inventory(out / "inventory.json")
    assert inventory.scanned == ["A", "C"]
    assert inventory.calibration.endswith("Terrain11_FreshCrater/stereo.calibration")
    assert list((out / "seeds").iterdir()) == []
    assert len(read_parquet(out / "photos.parquet")) == 0
    grid = rectified_left(read_rig(out / "calibration.json"))
    # Issue text: the real calibration gives fx 1990.6, cx 966.2, cy 600.1 (in OpenCV's pixels).
    assert grid.lens.opencv_matrix()[[0, 0, 1], [0, 2, 2]] == pytest.approx([1990.6, 966.2, 600.1], abs=0.1)


def test_seeds_may_come_from_another_folder_than_the_scans(tmp_path, polar, release):
    out = index(tmp_path, polar, seeds=SeedOptions(root=release.root))
    assert [path.name for path in (out / "seeds").iterdir()] == ["11_A_off_30_L_0256.txt"]


@pytest.mark.parametrize(
    "content", ["missing", "a file", "empty", "names of other photos", "another terrain", "lower case"]
)
def test_a_root_of_seeds_without_a_usable_label_is_an_error(tmp_path, polar, content):
    root = tmp_path / "seeds"
    if content == "a file":
        write(root, BOX)
    elif content != "missing":
        root.mkdir()
    names = {
        "names of other photos": "IMG_0001.txt",
        "another terrain": "03_A_off_30_L_0256.txt",
        "lower case": "11_a_off_30_l_0256.txt",
    }
    if content in names:
        write(root / names[content], BOX)
    with pytest.raises(PolarsimError) as caught:
        index(tmp_path, polar, seeds=SeedOptions(root=root))
    assert caught.value.path == root
    assert "labels.seeds: none" in caught.value.reason
    assert content not in names or content == "another terrain" or names[content] in caught.value.reason
    assert not (tmp_path / "out").exists()


def test_polygons_are_the_seeds_of_a_terrain_without_boxes(tmp_path):
    root = tmp_path / "release"
    write(root / "Labels/Terrain03/03_A_off_30_L_0256.txt", BOX)
    polygon = root / "SegmentationLabels/terrain11/labels/11_A_off_30_L_0256.txt"
    write(polygon, "2 0.1 0.1 0.2 0.1 0.2 0.2\n")
    assert find_labels(root, 11)[0] == {PhotoKey.parse("11_A_off_30_L_0256"): polygon}


def test_without_seeds_no_label_file_is_opened_and_a_position_without_a_scan_is_a_warning(tmp_path, polar, caplog):
    write(polar.root / "Labels/Terrain11/11_A_off_30_L_0256.txt", "no label at all\n")
    with pytest.raises(FormatError):
        index(tmp_path, polar)
    with caplog.at_level(logging.WARNING):
        out = index(tmp_path, polar, seeds="none")
    assert read_inventory(out / "inventory.json").scanned == ["A", "C"]
    assert list((out / "seeds").iterdir()) == []
    assert "no scan of position B, and no seeds are read" in caplog.text


def test_only_possible_seeds_are_inputs(polar):
    seed, other = (polar.root / f"Labels/Terrain11/11_A_off_30_{camera}_0256.txt" for camera in "LR")
    for path in (seed, other):
        write(path, BOX)
    without = set(raw_inputs(polar_site(), 11, polar, "none"))
    assert set(raw_inputs(polar_site(), 11, polar, SeedOptions())) - without == {seed}
    assert len(without) == 3  # calibration and two scans


def test_only_positions_of_the_run_are_indexed(tmp_path, polar, release, photo):
    add_photo(photo, polar, "11_A_off_30_L_0256")
    out = index(tmp_path, polar, positions="C", seeds="none")
    assert read_inventory(out / "inventory.json").scanned == ["C"]
    assert list((out / "seeds").iterdir()) == []
    assert len(read_parquet(out / "photos.parquet")) == 0


@pytest.fixture
def checked(monkeypatch):
    """Photos of the calibration checks, which are replaced because SIFT takes a second per photo."""
    calls = []
    monkeypatch.setattr("polarsim.acquire.index.check_calibration", lambda photos, *_: calls.append(list(photos)))
    return calls


def test_photos_are_indexed_and_gaps_are_a_single_warning(tmp_path, polar, photo, caplog, checked):
    left = add_photo(photo, polar, "11_A_off_30_L_0256")
    add_photo(photo, polar, "11_A_off_30_R_0256")
    add_photo(photo, polar, "11_C_on_no_L_8192")
    with caplog.at_level(logging.WARNING):
        table = read_parquet(index(tmp_path, polar, positions="AC") / "photos.parquet")
    assert table["key"].tolist() == ["11_A_off_30_L_0256", "11_A_off_30_R_0256", "11_C_on_no_L_8192"]
    assert table["path"][0] == left.as_posix()
    assert [[str(key) for key in photos] for photos in checked] == [table["key"].tolist()]
    (warning,) = [record.getMessage() for record in caplog.records]
    assert "3 photos found, 293 of the grid missing, 1 without the photo of the second camera" in warning  # of 2 x 148


def test_only_photos_of_the_grid_of_the_run_are_reported_as_missing(tmp_path, polar, photo, caplog, checked):
    add_photo(photo, polar, "11_A_off_30_L_0256")
    add_photo(photo, polar, "11_A_off_30_R_0256")
    grid = GridOptions(lights=["off"], azimuths=["30"], exposures_ms=[256])
    with caplog.at_level(logging.WARNING):
        index(tmp_path, polar, positions="A", grid=grid)
    assert checked
    assert not caplog.records


def test_an_invalid_photo_is_a_one_line_error_without_output(tmp_path, polar, photo):
    path = add_photo(photo, polar, "11_A_off_30_L_0256")
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(FormatError, match=r"CamL_259659217_0256\.png") as caught:
        index(tmp_path, polar)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("ROTATION_MATRIX:", "ROTATION:", "ROTATION_MATRIX is missing"),
        ("0.999997 0.0017", "0.9 0.0017", "not orthogonal"),
    ],
)
def test_an_invalid_calibration_is_a_one_line_error_with_the_file(tmp_path, polar, old, new, reason):
    path = polar.root / "Terrain11_FreshCrater/stereo.calibration"
    path.write_text(REAL_CALIBRATION.replace(old, new))
    with pytest.raises(PolarsimError, match=rf"stereo\.calibration: .*{reason}"):
        index(tmp_path, polar)
    assert not (tmp_path / "out").exists()


def test_stray_label_files_next_to_scans_are_logged_once(tmp_path, polar, caplog):
    for name in ("11_A_off_30_L_0256.txt", "11_A_off_30_L_0256 copy.txt"):
        write(polar.root / "Labels/Terrain11" / name, BOX)
    with caplog.at_level(logging.WARNING):
        out = index(tmp_path, polar, positions="AC")
    assert sum("1 stray files" in record.getMessage() for record in caplog.records) == 1
    assert [path.name for path in (out / "seeds").iterdir()] == ["11_A_off_30_L_0256.txt"]


def test_a_source_without_calibration_gets_the_stated_rig_and_a_warning(tmp_path, polar, caplog):
    (polar.root / "Terrain11_FreshCrater/stereo.calibration").unlink()
    with caplog.at_level(logging.WARNING):
        out = index(tmp_path, polar)
    assert json.loads((out / "calibration.json").read_text())["source"] == "stated"
    assert any("no stereo.calibration" in record.getMessage() for record in caplog.records)


def test_the_same_source_gives_the_same_bytes(tmp_path, polar, photo):
    add_photo(photo, polar, "11_A_off_30_L_0256")
    first = {path.name: path.read_bytes() for path in index(tmp_path, polar).glob("*.*")}
    shutil.rmtree(tmp_path / "out")
    assert {path.name: path.read_bytes() for path in index(tmp_path, polar).glob("*.*")} == first


def test_tables_of_terrains_are_merged_even_if_some_are_empty(tmp_path, polar, release, photo):
    add_photo(photo, polar, "11_A_off_30_L_0256")
    full = index(tmp_path / "a", polar) / "photos.parquet"
    empty = index(tmp_path / "b", release) / "photos.parquet"
    merge_photos(tables=[empty, full], merged=tmp_path / "merged.parquet")
    merge_photos(tables=[empty, empty], merged=tmp_path / "none.parquet")
    assert read_parquet(tmp_path / "merged.parquet").equals(read_parquet(full))
    assert read_parquet(tmp_path / "none.parquet").dtypes.equals(read_parquet(full).dtypes)


@pytest.mark.release
def test_every_station_of_the_release_has_a_seed_under_every_sun(release_root, tmp_path):
    source = SourceOptions(kind="release", root=release_root)
    for terrain in (1, 3, 4, 8, 11):
        out = index(tmp_path, source, terrain=terrain)
        names = [path.stem for path in (out / "seeds").iterdir()]
        assert len(names) == 12  # 3 positions, 4 Suns: shared facts on the labels, definitions
        assert all("_off_" in name and "_L_" in name for name in names)
