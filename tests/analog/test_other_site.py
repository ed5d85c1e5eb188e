"""The simulated sandbox of a site that shares nothing with NASA's."""

import cv2
import numpy as np
import pytest

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.analog.presets import PRESETS, preset_of
from polarsim.analog.raw_files import RawFiles
from polarsim.analog.sandbox import HALL_FLOOR
from polarsim.analog.stations import make_stations
from polarsim.analog.terrain import build_terrain
from polarsim.errors import ConfigError
from polarsim.formats import obj, yolo
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.clouds import read_cloud
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.run_files.rigs import read_localised
from polarsim.site import polar
from tests.support.other_site import CONTENT, one_camera, other_site

FILES = {
    **CONTENT["files"],
    "photos": "{terrain}/{position}/{azimuth}-{light}/{camera}_{exposure_ms}.png",
    "clouds": "{terrain}/{position}.xyz",
    "calibration": "{terrain}/stereo.calibration",
}
OPTIONS = AnalogOptions(ground_step_mm=20, rock_detail=3, scan_step_deg=0.5)
KEYS = ["yard-a_gate_off_45_L_0040", "yard-a_gate_off_45_L_0160", "yard-a_gate_on_135_L_0040"]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    root, site = tmp_path_factory.mktemp("other"), other_site(files=FILES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("polarsim.analog.bounce._BOUNCE_RAYS", 8)
        generate_terrain(
            site=site, root=root, receipt=root / "receipt.json", terrain="yard-a", threads=1,
            keys=[site.key(text) for text in KEYS], options=OPTIONS,
        )  # fmt: skip
    return root


def photo(root, light, azimuth, exposure):
    return cv2.imread(
        str(root / f"yard-a/gate/lamp{azimuth}-{light}/left_{exposure}.png"), cv2.IMREAD_UNCHANGED
    ).astype(float)


def test_photos_have_the_names_the_size_and_the_bits_of_the_site(made):
    assert {path.relative_to(made).as_posix() for path in made.rglob("*.png")} == {
        "yard-a/gate/lamp45-off/left_40.png",
        "yard-a/gate/lamp45-off/left_160.png",
        "yard-a/gate/lamp135-on/left_40.png",
    }
    for light, azimuth, exposure in (("off", 45, 40), ("on", 135, 40)):
        values = photo(made, light, azimuth, exposure)
        assert values.shape == (480, 640)
        assert values.min() == pytest.approx(4, abs=1)  # black level of the site
        assert 15 < np.median(values[240:]) < 150  # sand, at the usual exposure
    short, long = (photo(made, "off", 45, exposure) - 4 for exposure in (40, 160))
    linear = (long < 240) & (short > 10)
    assert linear.mean() > 0.1
    assert long[linear].mean() == pytest.approx(4 * short[linear].mean(), rel=0.02)


def test_clouds_are_in_the_frame_and_unit_of_the_site(made):
    truth = made / "truth" / "Terrainyard-a"
    localised = read_localised(truth / "cameras" / "Posgate.json")
    points = np.loadtxt(made / "yard-a/gate.xyz")[:, :3]  # left camera, metres
    sandbox = localised.sandbox_from_left.apply(points)
    inside = sandbox[(np.abs(sandbox[:, :2]) < [1.4, 2.8]).all(axis=1)]
    assert len(inside) > 1000
    assert np.median(inside[:, 2]) == pytest.approx(0, abs=0.03)
    walls = sandbox[(np.abs(sandbox[:, 0] + 1.5) < 0.1) & (np.abs(sandbox[:, 1]) < 2.5)]
    assert np.percentile(walls[:, 2], 99) == pytest.approx(0.21, abs=0.03)
    assert read_cloud(made / "yard-a/gate.xyz").shape[1] == 3


def test_the_calibration_fits_the_site_and_seeds_are_in_its_photos(made):
    site = other_site(files=FILES)
    rig = read_calibration(made / "yard-a/stereo.calibration", site)
    assert (rig.left.width, rig.left.height) == (640, 480)
    (seeds,) = (made / "Labels" / "Terrainyard-a").iterdir()
    assert seeds.name in {f"{key}.txt" for key in KEYS[:2]}
    classes, boxes = yolo.read_boxes(seeds, size=(640, 480))
    assert (classes == 0).any()
    assert boxes.max() > 300
    assert (boxes <= [640, 480, 640, 480]).all()


def test_rocks_are_in_the_whole_rectangle(made):
    meshes = obj.rock_files(made / "truth" / "Terrainyard-a" / "meshes")
    centres = np.array([obj.read_obj(path).vertices.mean(axis=0) for path in meshes.values()])
    assert (np.abs(centres[:, :2]) < [1.45, 2.9]).all()
    assert np.ptp(centres[:, 1]) > 3


def test_a_side_without_wall_is_open_and_walls_have_the_heights_of_the_site():
    site = other_site()
    scene = build_terrain(site, "yard-a", OPTIONS).scene
    above = np.array([[x, y, 1.0] for x, y in ((1.55, 0), (-1.55, 0), (0, 3.05), (0, -3.05))])
    tops = 1.0 - scene.caster().first_hits(above, np.broadcast_to([0, 0, -1.0], above.shape)).distance
    stated = site.sandbox.walls_m
    expected = [(stated.get(side) or 0.0) for side in ("+x", "-x", "+y", "-y")]
    np.testing.assert_allclose(tops, [height + 0.01 if height else 0.0 for height in expected], atol=0.04)
    outdoors = scene.caster().first_hits(np.array([0, 0, 1.0]), np.array([[0, 0, 1.0]]))
    assert not outdoors.is_hit.any()  # lamp 135 is directional: no ceiling
    assert scene.vertices[:, 2].min() == pytest.approx(HALL_FLOOR)


def test_tripods_and_lamps_are_near_those_of_the_site():
    site = other_site()
    stations = make_stations(site, "yard-b", OPTIONS)
    for position, tripod in site.tripods.items():
        pose = stations.sandbox_from_left[position]
        np.testing.assert_allclose(pose.translation, tripod.camera_m, atol=0.1)
        yaw, pitch, _ = np.degrees(yaw_pitch_roll(pose))
        assert abs((yaw - tripod.yaw_deg + 180) % 360 - 180) <= 2
        assert abs(pitch - tripod.pitch_deg) <= 3
    assert 0.1 <= np.linalg.norm(stations.lamps["45"] - site.lamps["45"].point) <= 0.2
    far, stated = (vector / np.linalg.norm(vector) for vector in (stations.lamps["135"], site.lamps["135"].point))
    assert 0.3 < np.degrees(np.arccos(far @ stated)) < 3  # the same angular error as of lamps in the hall
    baseline = np.linalg.norm(stations.rig.left_from_right.translation)
    assert site.cameras.baseline_m[0] < baseline < site.cameras.baseline_m[1]


def test_a_site_with_one_camera_has_one():
    site = one_camera()
    stations = make_stations(site, "yard-a", OPTIONS)
    assert not stations.rig.is_stereo
    assert not stations.calibration.is_stereo
    assert {key.camera for key in site.photos_of("yard-a")} == {"L"}


def test_presets_are_chosen_by_number_by_the_site_or_in_order():
    assert preset_of(polar(), 11) == (PRESETS[11], 11)
    assert preset_of(polar(), 2) == (PRESETS[2], 1)  # the ground of terrain 1
    assert preset_of(other_site(), "yard-b") == (PRESETS[3], "yard-b")
    assert preset_of(other_site(analog={"scenes": {"yard-b": 11}}), "yard-b") == (PRESETS[11], "yard-b")


def test_nasas_files_have_nasas_names(tmp_path):
    files = RawFiles(polar(), 1, tmp_path, {})
    key = polar().key("01_B_on_30_L_0256")
    assert files.photo(key, "123").relative_to(tmp_path).as_posix() == (
        "Terrain01_LargeOnly/PosB_4000_Lon/Sun_30/CamL_123_0256.png"
    )
    assert files.range_map("C") == tmp_path / "GroundTruth_RectifiedRangeMaps/Terrain01/PosC_org-XYZ.tif"
    assert files.cloud("A") == tmp_path / "Terrain01_LargeOnly/PosA.xyz"
    assert files.folder == "Terrain01_LargeOnly"


def test_a_site_without_a_folder_of_the_terrain_is_rejected(tmp_path):
    site = other_site(files={"photos": "{terrain}_{position}_{camera}_{azimuth}_{light}_{exposure_ms}.png"})
    with pytest.raises(ConfigError, match="files"):
        generate_terrain(
            site=site, root=tmp_path, receipt=tmp_path / "receipt.json", terrain="yard-a", threads=1, keys=[],
            options=OPTIONS,
        )  # fmt: skip
