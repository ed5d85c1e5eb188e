"""Exports of other people's tools become label files: of each tool a file as it writes it, and boxes that come back."""

import numpy as np
import pytest

from polarsim.acquire.options import SeedOptions
from polarsim.acquire.seeds import choose_seed_files, find_labels
from polarsim.annotate.import_labels import import_labels
from polarsim.errors import ConfigError, FormatError
from polarsim.labels.seeds import read_corrections
from polarsim.photo import PhotoKey
from polarsim.site import polar

KEY = PhotoKey.parse("01_A_off_30_L_0256")
OTHER = PhotoKey.parse("01_A_off_180_L_0256")
ROCK, SHADOW = np.array([100.0, 200, 150, 230]), np.array([60.0, 210, 105, 230])
CVAT = f"""<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version>
  <image id="0" name="some/{KEY}.png" width="968" height="608">
    <box label="rock" source="manual" occluded="0" xtl="50" ytl="100" xbr="75" ybr="115" z_order="0">
      <attribute name="rock">4</attribute></box>
    <polygon label="shadow" points="30,105;52.5,110;40,115" z_order="0"></polygon>
    <points label="rock" points="1,1"></points>
  </image>
  <image id="1" name="{OTHER}.png" width="1936" height="1216"></image>
</annotations>"""


@pytest.fixture
def source(tmp_path):
    (tmp_path / "export").mkdir()
    (tmp_path / "export/annotations.xml").write_text(CVAT)
    return tmp_path / "export/annotations.xml"


def test_an_export_becomes_corrections_that_the_labels_stage_reads(tmp_path, source):
    done = import_labels(source, tmp_path / "corrections", site=polar())
    assert (done.photos, done.boxes) == (1, 2)
    found = read_corrections(tmp_path / "corrections", polar(), 1)
    assert list(found) == [KEY]
    np.testing.assert_allclose(found[KEY].rocks, [ROCK], atol=0.01)
    np.testing.assert_allclose(found[KEY].shadows, [SHADOW], atol=0.01)


def test_an_export_becomes_seeds_that_the_acquire_stage_chooses(tmp_path, source):
    import_labels(source, tmp_path / "seeds", site=polar())
    files, _ = find_labels(tmp_path / "seeds", 1)
    assert [key for key, _ in choose_seed_files(polar(), files, ["A"], SeedOptions())] == [KEY]


def test_a_photo_without_a_box_is_skipped_unless_empty_photos_are_kept(tmp_path, source):
    done = import_labels(source, tmp_path / "out", site=polar())
    assert (done.photos, done.boxes, done.empty) == (1, 2, [str(OTHER)])
    assert not (tmp_path / f"out/{OTHER}.txt").exists()
    done = import_labels(source, tmp_path / "all", keep_empty=True, site=polar())
    assert (done.photos, done.boxes, done.empty) == (2, 2, [])
    assert (tmp_path / f"all/{OTHER}.txt").read_text() == ""


def test_other_names_of_classes_are_mapped(tmp_path, source):
    source.write_text(CVAT.replace('label="rock"', 'label="boulder"').replace('label="shadow"', 'label="dog"'))
    with pytest.raises(FormatError):
        import_labels(source, tmp_path / "out", site=polar())
    done = import_labels(source, tmp_path / "out", names={"boulder": "rock", "dog": ""}, site=polar())
    assert (done.photos, done.boxes, done.named_out) == (1, 1, {"dog": 1})
    assert not [line for line in done.report() if "no shape" in line]
    done = import_labels(source, tmp_path / "more", names={"boulder": "rock", "dog": "", "cat": ""}, site=polar())
    assert [line for line in done.report() if "cat" in line] == [
        "--name: no shape has the class cat; classes of the shapes: boulder, dog"
    ]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xml", "<annotations>"),
        ("a.xml", '<annotations><image name="x.png" width="1936" height="1216"/></annotations>'),
        ("a.xml", f'<annotations><image name="{KEY}.png" width="100" height="100"/></annotations>'),
        ("a.xml", f'<annotations><image name="{KEY}.png" width="1936"/></annotations>'),
        ("a.xml", CVAT.replace('xbr="75"', 'xbr="50"')),
        ("a.xml", CVAT.replace(f"{OTHER}.png", f"{KEY}.jpg")),
        ("a.json", "[1, 2]"),
        ("a.json", '{"images": 3}'),
        ("a.json", '{"labels": {}}'),
        ("a.json", "{"),
        ("a.csv", ""),
    ],
)
def test_a_file_that_is_no_export_is_a_one_line_error(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(FormatError):
        import_labels(tmp_path / name, tmp_path / "out", site=polar())
    assert not (tmp_path / "out").exists()


def test_a_folder_with_files_is_an_error(tmp_path, source):
    with pytest.raises(ConfigError):
        import_labels(source, tmp_path / "export", site=polar())


def test_the_command_prints_the_configuration_of_the_seeds(tmp_path, polarsim, source):
    done = polarsim("import", source, tmp_path / "mine", "--as", "seeds")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        f"2 boxes in 1 photos in {tmp_path}/mine",
        f"1 photos without a box were skipped (--keep-empty imports empty photos): {OTHER}",
        f"configuration of the run:  labels: {{seeds: {{root: {tmp_path}/mine}}}}",
        "read: box (1), polygon (1); skipped: points (1)",
    ]
    wrong = polarsim("import", source, tmp_path / "again", "--name", "boulder")
    assert wrong.returncode == 2
