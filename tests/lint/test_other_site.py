"""Labels of a site with named terrains and other exposures, with two cameras and with one."""

import json

import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import release, yolo
from polarsim.lint.folders import lint_folder
from polarsim.lint.rules import RULES
from tests.support.other_site import SIZE, one_camera, other_site

ROCKS = np.array([[100.0, 100, 140, 130], [300, 220, 360, 260], [480, 300, 520, 340]])
SHIFT = {"45": [-45, 5], "135": [45, 5]}  # of shadows from rocks


@pytest.fixture(params=[other_site, one_camera], ids=["stereo", "one camera"])
def site(request):
    return request.param()


@pytest.fixture
def root(site, tmp_path):
    """Published labels of all photos of a terrain: rocks, under lamps with shadows, left and right with disparity."""
    for key in site.photos_of("yard-a"):
        rocks = ROCKS - [20 * (key.camera == "R"), 0] * 2 + [7 * (key.position == "mast"), 60] * 2
        shadows = rocks + SHIFT[key.azimuth] * 2 if key.has_sun else rocks[:0]
        path = release.label_folder(tmp_path / "set", "yard-a") / f"{key}.txt"
        classes = np.repeat([0, 1], [len(rocks), len(shadows)])
        yolo.write_boxes(path, classes, np.concatenate([rocks, shadows]), SIZE)
    return tmp_path / "set"


def defects(root, site, **options):
    report = lint_folder(root, set(RULES), site=site, **options)
    return report, sorted((one.defect, one.file.rpartition("/")[2]) for one in report.findings)


def test_sound_labels_have_no_defect(site, root, caplog):
    report, found = defects(root, site)
    assert found == []
    assert report.contents["Terrainyard-a"]["label_files"] == len(list(site.photos_of("yard-a")))
    assert caplog.records == []


def test_files_of_photos_that_the_site_does_not_have_are_found_and_repaired(site, root, tmp_path):
    folder = release.label_folder(root, "yard-a")
    missing, copied = folder / "yard-a_gate_off_45_L_0040.txt", folder / "yard-a_gate_off_45_L_0010.txt"
    missing.rename(folder / "yard-a_gate_off_45_L_0042.txt")  # nearest exposure: 40 ms
    (folder / "yard-a_gate_off_30_L_0040.txt").write_bytes(copied.read_bytes())  # another lamp
    (folder / "yard-a_gate_off_45_L_0010 copy.txt").write_bytes(copied.read_bytes())
    report, found = defects(root, site, fix=tmp_path / "fixed")
    assert [name for name, file in found if file.endswith("_0042.txt")] == ["impossible_exposure"]
    assert ("stray_name", "yard-a_gate_off_30_L_0040.txt") in found
    assert ("stray_name", "yard-a_gate_off_45_L_0010 copy.txt") in found
    assert report.repairs
    assert defects(tmp_path / "fixed", site)[1] == []


def test_boxes_outside_the_smaller_photo_are_found(site, root):
    path = release.label_folder(root, "yard-a") / "yard-a_mast_on_135_L_0160.txt"
    path.write_text(path.read_text() + "0 0.99 0.5 0.1 0.1\n")
    names = [name for name, _ in defects(root, site)[1]]
    assert "out_of_photo" in names


def test_labels_of_another_site_are_refused(root):
    with pytest.raises(FormatError, match="no terrain"):
        lint_folder(root, set(RULES))


def test_the_folder_of_a_run_states_its_site(site, root, tmp_path):
    run = tmp_path / "results" / "mine"
    (run / "labels/boxes").mkdir(parents=True)
    release.label_folder(root, "yard-a").rename(run / "labels/boxes/Terrainyard-a")
    (run / "config.yaml").write_text(json.dumps({"site": site.model_dump(mode="json", exclude_unset=True)}))
    assert lint_folder(run, set(RULES)).findings == []
