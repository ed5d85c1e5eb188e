"""Files are found by the patterns of a site: NASA's layout, and layouts of other sites."""

import json
import logging
import unicodedata

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.errors import ConfigError, FormatError
from polarsim.formats import site_files, site_paths
from polarsim.photo import PhotoKey
from polarsim.site import Site, polar
from tests.support.other_site import CONTENT, other_site
from tests.support.polar_files import photo_path

POLAR, TERRAIN = polar(), "Terrain11_FreshCrater"


def touch(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()


def photos(root, terrain=11, site=POLAR):
    return site_files.find_photos(site, root, terrain)


def test_the_middle_token_of_photo_names_is_ignored(tmp_path):
    touch(tmp_path / TERRAIN / "PosA_1500_Loff/Sun_30/CamL_259659217_0256.png")
    touch(tmp_path / TERRAIN / "Terrain11_FreshCrater/PosA_1500_Lon/NoSun/CamR_a_b-c_8192.PNG")  # with a subfolder
    found, strays = photos(tmp_path)
    assert [key for key, _ in found] == [
        PhotoKey(11, "A", "off", "30", "L", 256),
        PhotoKey(11, "A", "on", "no", "R", 8192),
    ]
    assert found[0][1].name == "CamL_259659217_0256.png"
    assert strays == []


@pytest.mark.parametrize("of_pattern", ["NFC", "NFD"])
@pytest.mark.parametrize("of_files", ["NFC", "NFD"])
def test_accents_and_spaces_in_paths_match_in_composed_and_decomposed_form(tmp_path, of_pattern, of_files):
    files = CONTENT["files"] | {
        "photos": "Höfe {terrain}/{position}/{azimuth}-{light}/{camera}_{exposure_ms:4}.png",
        "clouds": "Höfe {terrain}/{position}.ply",
        "calibration": "Höfe {terrain}/Maße.yaml",
        "spelling": {"terrain": {"yard-a": "Süd"}, "position": {"gate": "Tür 1"}, "azimuth": {"45": "früh"}},
    }
    site = other_site(files=json.loads(unicodedata.normalize(of_pattern, json.dumps(files, ensure_ascii=False))))
    names = ("Höfe Süd/Tür 1/früh-off/L_0010.png", "Höfe Süd/Tür 1.ply", "Höfe Süd/Maße.yaml")
    written = [tmp_path / unicodedata.normalize(of_files, name) for name in names]
    for path in written:
        touch(path)
    assert photos(tmp_path, "yard-a", site) == ([(PhotoKey("yard-a", "gate", "off", "45", "L", 10), written[0])], [])
    assert site_files.find_clouds(site, tmp_path, "yard-a") == {"gate": written[1]}
    assert site_files.find_calibration(site, tmp_path, "yard-a") == written[2]


@pytest.mark.parametrize(
    "name",
    ["PosA_1500_Loff/Sun_30/CamL_1_0256 copy.png", "PosA_1500_Loff/Sun_45/CamL_1_0256.png", "CamL_1_0256.png",
     "PosA_1500_Loff/Sun_30/CamL_1_0300.png", "PosH_1500_Loff/Sun_30/CamL_1_0256.png",
     "PosA_1500_Loff/Sun_30/CamL_0256.png", "PosA_1500_Loff/Sun_30/CamL_1_256.png",
     "PosD_1500_Loff/Sun_30/CamL_1_0256.png", "a/b/PosA_1500_Loff/Sun_30/CamL_1_0256.png"],
)  # fmt: skip
def test_other_images_are_stray(tmp_path, name):
    touch(tmp_path / TERRAIN / name)
    found, strays = photos(tmp_path)
    assert found == []
    assert [path.name for path in strays] == [name.split("/")[-1]]


def test_two_files_of_a_photo_are_an_error(tmp_path):
    for token in "12":
        touch(tmp_path / TERRAIN / f"PosA_1500_Loff/Sun_30/CamL_{token}_0256.png")
    with pytest.raises(FormatError, match="11_A_off_30_L_0256"):
        photos(tmp_path)


@settings(max_examples=20)
@given(wanted=st.sets(st.sampled_from(list(POLAR.photos_of(3))), min_size=1, max_size=12))
def test_photos_are_found_at_their_written_paths(tmp_path_factory, wanted):
    root = tmp_path_factory.mktemp("root")
    for key in wanted:
        touch(root / photo_path(key, "123"))
    assert photos(root, 3) == ([(key, root / photo_path(key, "123")) for key in sorted(wanted)], [])


def test_folders_of_terrains_are_found_in_the_root_or_below_up_to_two_folders(tmp_path):
    (tmp_path / "download/NASA/Terrain03_MeanDistr").mkdir(parents=True)
    (tmp_path / TERRAIN).mkdir()
    (tmp_path / "GroundTruth_RectifiedRangeMaps/Terrain06").mkdir(parents=True)  # no name: not the folder of a terrain

    def folder(terrain):
        return site_files.find_terrain_folder(POLAR, tmp_path, POLAR.files.photos, terrain)

    assert folder(11) == tmp_path / TERRAIN
    assert folder(3) == tmp_path / "download/NASA/Terrain03_MeanDistr"
    assert folder(6) is None


def test_two_folders_of_a_terrain_are_an_error(tmp_path):
    for name in (TERRAIN, "Terrain11_Other"):
        (tmp_path / name).mkdir()
    with pytest.raises(FormatError, match="Terrain11_Other"):
        photos(tmp_path)


def test_scans_and_calibration_are_found(tmp_path, caplog):
    touch(tmp_path / "GroundTruth_RectifiedRangeMaps/Terrain11/PosB_org-XYZ.TIF")
    touch(tmp_path / "GroundTruth_RectifiedRangeMaps/Terrain12/PosA_org-XYZ.tif")
    for name in ("PosA.xyz", "scans/PosC.ply", "PosC.notes", "stereo.calibration"):
        touch(tmp_path / TERRAIN / name)
    with caplog.at_level(logging.WARNING, logger="polarsim"):
        clouds = site_files.find_clouds(POLAR, tmp_path, 11)
    assert {position: path.name for position, path in clouds.items()} == {"A": "PosA.xyz", "C": "PosC.ply"}
    assert [line for line in caplog.messages if "PosC.notes" in line]
    maps = site_files.find_range_maps(POLAR, tmp_path, 11)
    assert {position: path.name for position, path in maps.items()} == {"B": "PosB_org-XYZ.TIF"}
    assert site_files.find_calibration(POLAR, tmp_path, 11) == tmp_path / TERRAIN / "stereo.calibration"


def test_two_clouds_of_a_position_are_an_error(tmp_path):
    for name in ("PosA.xyz", "PosA.ply"):
        touch(tmp_path / TERRAIN / name)
    with pytest.raises(FormatError, match=r"PosA\.ply"):
        site_files.find_clouds(POLAR, tmp_path, 11)


LAYOUTS = {
    "folders": "{terrain}/{position}/{azimuth}-{light}/{camera}_{exposure_ms}.png",
    "flat": "{terrain}_{position}_{azimuth}_{light}_{camera}_{exposure_ms:5}.{tif|tiff}",
    "camera first": "{camera}/{terrain}/{position}/{azimuth}/{light}/IMG-{any}-{exposure_ms}us.jpg",
    "terrain twice": "site/{terrain}/{position}/{terrain}_{azimuth}_{light}_{camera}_{exposure_ms}.pgm",
}


@pytest.mark.parametrize("pattern", LAYOUTS.values(), ids=LAYOUTS)
@pytest.mark.parametrize("above", ["", "a/", "a/b/"])
def test_every_photo_of_another_site_is_found_at_its_path(tmp_path, pattern, above):
    site = other_site(files=CONTENT["files"] | {"photos": pattern})
    for terrain in site.terrains:
        for number, key in enumerate(site.photos_of(terrain)):
            fields = site_paths.photo_fields(key)
            touch(tmp_path / above / site_paths.format_path(site, pattern, terrain, fields, [str(number)]))
    for terrain in site.terrains:
        found, strays = photos(tmp_path, terrain, site)
        assert [key for key, _ in found] == sorted(site.photos_of(terrain))
        assert strays == []


def test_a_stray_file_among_photos_of_several_terrains_is_reported(tmp_path):
    site = other_site(files=CONTENT["files"] | {"photos": LAYOUTS["flat"]})
    for name in ("yard-a_gate_dark_off_left_00640.tif", "yard-b_gate_dark_off_left_00640.tif", "notes.tif"):
        touch(tmp_path / name)
    found, strays = photos(tmp_path, "yard-a", site)
    assert ([str(key) for key, _ in found], [path.name for path in strays]) == (
        ["yard-a_gate_off_no_L_0640"],
        ["notes.tif"],
    )


@pytest.mark.parametrize(
    ("files", "named"),
    [
        ({"photos": "{terrain}/{azimuth}-{light}/{camera}_{exposure_ms}.png"}, "{position}"),
        ({"photos": "{terrain}/{position}/{azimuth}/{camera}_{exposure_ms}.png"}, "{light}"),
        ({"photos": "{terrain}/{place}.png"}, "{place}"),
        ({"photos": "{terrain/{position}.png"}, "brace"),
        ({"photos": "/data/{terrain}/{position}.png"}, "source.root"),
        ({"clouds": "{terrain}/cloud.ply"}, "{position}"),
        ({"spelling": {"lamp": {"45": "x"}}}, "'lamp'"),
        ({"spelling": {"azimuth": {"45": "x", "135": "x"}}}, "azimuth"),
    ],
)
def test_a_pattern_that_does_not_distinguish_photos_is_an_error(files, named):
    with pytest.raises((ConfigError, ValueError)) as caught:
        Site.model_validate(CONTENT | {"files": CONTENT["files"] | files})
    assert named in str(caught.value)


def test_names_of_terrains_may_be_spelled_with_folders(tmp_path):
    spelling = {"terrain": {"yard-a": "day1/a", "yard-b": "day2/b"}}
    site = other_site(files={"photos": LAYOUTS["folders"], "spelling": spelling})
    touch(tmp_path / "day2/b/gate/45-on/L_40.png")
    assert [str(key) for key, _ in photos(tmp_path, "yard-b", site)[0]] == ["yard-b_gate_on_45_L_0040"]
    assert photos(tmp_path, "yard-a", site) == ([], [])
