"""NASA's POLAR Traverse is a site that polarsim ships: files of its form are found and indexed."""

import cv2
import numpy as np
import pytest

from polarsim.acquire.index import index_terrain
from polarsim.acquire.options import SeedOptions, SourceOptions
from polarsim.formats import png, site_files
from polarsim.formats.tables import read_parquet
from polarsim.grid import GridOptions
from polarsim.run_files.rigs import read_rig
from polarsim.site import read_site

SITE = read_site("polar-traverse")


def test_names_of_the_data_set_are_keys_of_photos(tmp_path):
    names = {
        "View1/Traverse1/00m/loc0_camL_001ms.png": "view1_t1-00_off_sun_L_0001",
        "View1/Traverse1/00m/loc1_camR_005ms.png": "view1_t1-00_off_sun_R_0005",
        "View1/Traverse2/00m/loc22_camL_300ms.png": "view1_t2-00_off_sun_L_0300",
        "View1/Traverse6/10m/loc131_camR_075ms.png": "view1_t6-10_off_sun_R_0075",
        "View4/Traverse3/05m/loc54_camL_050ms.png": "view4_t3-05_off_sun_L_0050",
    }  # names of published code that reads the data set
    for name in (*names, "View1/Traverse1/00m/loc0_camL_002ms.png", "View1/Traverse1/poses/approx_pose.txt"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = {}
    for terrain in SITE.terrains:
        photos, strays = site_files.find_photos(SITE, tmp_path, terrain)
        found |= {path.relative_to(tmp_path).as_posix(): str(key) for key, path in photos}
        assert [path.name for path in strays] == (["loc0_camL_002ms.png"] if terrain == "view1" else [])
    assert found == names


def test_a_view_has_eleven_stops_of_six_traverses():
    assert len(SITE.positions) == 66
    assert len(list(SITE.photos_of("view2"))) == 66 * 2 * 6
    assert set(SITE.tripods_of("view1")) == {f"t3-{stop:02d}" for stop in range(11)}
    assert SITE.tripods_of("view2") == {}


@pytest.fixture
def root(tmp_path):
    """Two photos of a stop, a calibration as of the authors' code, and a label file."""
    for number, camera in enumerate("LR"):
        path = tmp_path / f"data/View1/Traverse3/05m/loc{number}_cam{camera}_050ms.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        png.write_png(path, np.full((2048, 2048), 60 + number, np.uint8))
    file = cv2.FileStorage(str(tmp_path / "data/calibration.yaml"), cv2.FILE_STORAGE_WRITE)
    for side, focal in (("left", 1452.7), ("right", 1455.7)):
        file.write(f"camera_matrix_{side}", np.array([[focal, 0, 1020], [0, focal, 1030], [0, 0, 1]]))
        file.write(f"distortion_coefficients_{side}", np.array([[-0.02, 0.01, 1e-4, 1e-4, 0.003]]))
    file.write("rotation_matrix", np.eye(3))
    file.write("translation_vector", np.array([[-0.3996], [0.0], [0.0]]))
    file.release()
    label = tmp_path / "labels/view1_t3-05_off_sun_L_0050.txt"
    label.parent.mkdir()
    label.write_text("0 0.5 0.5 0.1 0.1\n")
    return tmp_path


def test_a_stop_is_indexed_with_its_calibration(root, caplog):
    out = root / "out"
    index_terrain(
        site=SITE, terrain="view1", positions=["t3-05"], source=SourceOptions(kind="files", root=root / "data"),
        seed_options=SeedOptions(root=root / "labels"), photos=out / "photos.parquet",
        calibration=out / "calibration.json", inventory=out / "inventory.json", seeds=out / "seeds",
        converted=out / "photos", grid=GridOptions(exposures_ms=[50]),
    )  # fmt: skip
    table = read_parquet(out / "photos.parquet")
    assert table["key"].tolist() == ["view1_t3-05_off_sun_L_0050", "view1_t3-05_off_sun_R_0050"]
    rig = read_rig(out / "calibration.json")
    assert (rig.left.fx, rig.right.fx, rig.left.distortion[4]) == (1452.7, 1455.7, 0.003)
    assert rig.left_from_right.translation[0] == pytest.approx(0.3996)
    assert not [record for record in caplog.records if "missing" in record.getMessage()]
