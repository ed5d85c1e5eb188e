"""A draft of a site file from a folder of photos, scans and calibrations."""

import shlex
from zlib import crc32

import cv2
import numpy as np
import pytest
import yaml

from polarsim.acquire.path_fields import find_fields
from polarsim.formats import ply, png
from polarsim.formats.site_files import find_photos
from polarsim.formats.site_paths import format_path, photo_fields
from polarsim.site import polar, read_site
from tests.acquire.test_other_site import kalibr
from tests.support.other_site import SIZE, one_camera, other_rig, other_site
from tests.support.polar_files import photo_path


def paths_of(site, terrains=None):
    """Return the paths of all photos of a site."""
    keys, stops = photos(site, terrains), list(site.positions)
    if site == polar():  # a pair of photos shares a token
        return [photo_path(key, str(crc32(str((key.bracket[:4], key.exposure_ms)).encode()))) for key in keys]
    numbers = [str(2 * stops.index(key.position) + (key.camera == "R")) for key in keys]
    return [
        format_path(site, site.files.photos, key.terrain, photo_fields(key), [number])
        for key, number in zip(keys, numbers, strict=True)
    ]


def photos(site, terrains):
    return [key for terrain in terrains or site.terrains for key in site.photos_of(terrain)]


@pytest.mark.parametrize(
    ("site", "pattern", "azimuths"),
    [
        (polar(), "Terrain{terrain}_{any}/Pos{position}_1500_L{light}/{azimuth}/Cam{camera}_{any}_{exposure_ms:4}.png",
         {"no": "NoSun", "30": "Sun_30", "180": "Sun_180", "270": "Sun_270", "350": "Sun_350"}),
        (other_site(), "yard-{terrain}/{position}/{azimuth}-{light}/{camera}_{exposure_ms:4}.png",
         {"no": "dark", "45": "lamp45", "135": "lamp135"}),
        (read_site("polar-traverse"), "View{terrain}/Traverse{position}m/loc{any}_cam{camera}_{exposure_ms:3}ms.png",
         None),
        (read_site("yard"), "yard-{terrain}/{position}/sun-{azimuth}_lamp-{light}/{camera}_{exposure_ms}.png",
         {name: name for name in read_site("yard").azimuths}),
    ],
    ids=["polar", "other", "polar-traverse", "yard"],
)  # fmt: skip
def test_the_fields_of_names_are_recognised(site, pattern, azimuths):
    terrains = list(site.terrains)[:12]  # terrain 13 of NASA has other positions
    found = find_fields(paths_of(site, terrains))
    assert found.pattern == pattern
    assert found.names.get("azimuth") == azimuths
    assert found.notes == []
    assert len(found.names["position"]) == len(site.positions)
    times = sorted({time for of in found.exposures_ms.values() for time in of})
    assert times == sorted({key.exposure_ms for key in photos(site, terrains)})


@pytest.mark.parametrize(
    ("names", "fields"),
    [
        ([f"shots/{p}/img_{e}.jpg" for p in ("near", "far") for e in (10, 20, 40)], {"terrain", "exposure_ms"}),
        ([f"pos{p}/{c}/{e}ms.tif" for p in "12" for c in ("left", "right") for e in (5, 50)],
         {"position", "camera", "exposure_ms"}),
        ([f"a{t}_s{s}_cam{c}_{e}.pgm" for t in "12" for s in "345" for c in "01" for e in (5, 50)],
         {"terrain", "position", "camera", "exposure_ms"}),
        ([f"IMG_{1000 + n}.png" for n in range(30)], set()),
        ([f"IMG_{n:04d}.JPG" for n in range(2)], set()),
        ([f"DSC{n:05d}.JPG" for n in (7, 8, 9)], set()),
        ([f"scene{n}.jpg" for n in (1, 2)], {"exposure_ms"}),
    ],
)  # fmt: skip
def test_small_folders_are_recognised(names, fields):
    found = find_fields(names)
    stated = {
        name
        for name in ("terrain", "position", "camera", "light", "azimuth", "exposure_ms")
        if f"{{{name}" in found.pattern
    }
    assert stated == fields


@pytest.mark.parametrize("times", [(10, 40, 160), (10, 20), (5, 15)])
def test_units_are_no_part_of_exposures_and_numbers_after_a_lamp_of_the_rig_are_lights(times):
    found = find_fields(
        [f"{t}/{a}/P{p}_cam{c}_head{lit}_{e}ms.png" for t in ("dunes", "crater") for a in ("lampE", "lampN", "dark")
         for p in "123" for c in "01" for lit in "01" for e in times]
    )  # fmt: skip
    assert found.pattern == "{terrain}/{azimuth}/P{position}_cam{camera}_head{light}_{exposure_ms}ms.png"
    assert found.names["light"] == {"off": "0", "on": "1"}
    assert found.names["camera"] == {"L": "0", "R": "1"}
    assert found.names["position"] == {number: number for number in "123"}
    assert set(map(tuple, found.exposures_ms.values())) == {times}
    assert found.notes == []


@pytest.mark.parametrize(
    ("names", "keys", "missing"),
    [
        ([f"IMG_{n:04d}.JPG" for n in range(2)], "1 different key:", ["terrain", "camera", "exposure_ms"]),
        ([f"IMG_{n:04d}.JPG" for n in range(12)], "1 different key:", ["terrain", "camera", "exposure_ms"]),
        ([f"pos{p}/{p}{n:03d}.png" for p in "12" for n in range(10)], "2 different keys:", ["azimuth", "camera"]),
        ([f"a/{e}.png" for e in (10, 20, 40)], None, []),
        (["one.png"], None, []),
    ],
)
def test_photos_that_names_do_not_distinguish_are_reported(names, keys, missing):
    notes = find_fields(names).notes
    if keys is None:
        assert notes == []
        return
    (note,) = notes
    assert f"{len(names)} photos have {keys} {names[0]} and {names[1]}" in note
    assert all(field in note.partition("missing")[2] for field in missing)


def test_a_folder_of_numbered_photos_lacks_a_pattern(polarsim, tmp_path):
    (tmp_path / "raw").mkdir()
    for number in range(3):
        png.write_png(tmp_path / f"raw/IMG_{number:04d}.png", np.zeros((30, 40), np.uint8))
    result = polarsim("new-site", tmp_path / "raw", "--out", tmp_path / "site.yaml")
    assert result.returncode == 0
    assert "IMG_0000.png and IMG_0001.png" in result.stdout
    checked = polarsim("check-site", tmp_path / "site.yaml")
    assert checked.returncode == 1
    assert "files.photos" in checked.stdout


def test_names_with_blanks_and_letters_of_other_scripts_are_written_as_they_are(polarsim, tmp_path):
    folder, out = tmp_path / "my photos", tmp_path / "my $site's.yaml"
    for name in ("Süd", "Sud", "西", "北"):
        for exposure in (10, 20):
            path = folder / f"Bühne {name}/{exposure}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            png.write_png(path, np.zeros((30, 40), np.uint8))
    result = polarsim("new-site", folder, "--out", out)
    assert result.returncode == 0, result.stderr
    command = shlex.split(result.stdout.splitlines()[-1].partition("then: ")[2])
    assert command == ["polarsim", "check-site", str(out), "--root", str(folder)]
    text = out.read_text(encoding="utf-8")
    assert "\\u" not in text
    draft = yaml.safe_load(text)
    assert draft["files"]["photos"] == "Bühne {terrain}/{exposure_ms}.png"
    spelling = draft["files"]["spelling"]["terrain"]
    assert sorted(spelling) == ["Sud-2", "x", "x-2"]
    assert sorted(spelling.values()) == sorted(["Süd", "西", "北"])
    assert sorted(draft["terrains"]) == ["Sud", *sorted(spelling)]


def make(root, site):
    for number, key in enumerate(photos(site, None)):
        path = root / format_path(site, site.files.photos, key.terrain, photo_fields(key))
        path.parent.mkdir(parents=True, exist_ok=True)
        level = 4 if key.azimuth == "no" and key.light == "off" else 40 + number
        png.write_png(path, np.full(SIZE[::-1], level, np.uint8))
    points = 3 * other_rig().left.directions(np.array([[100.0, 100], [400, 300], [300, 200]]))
    for terrain in site.terrains:
        (root / str(terrain) / "camchain.yaml").write_text(kalibr(other_rig(), cameras=len(site.cameras.sides)))
        for position in site.positions:
            ply.write_ply(root / f"{terrain}/{position}.ply", ply.Cloud(points, points))


@pytest.mark.parametrize("site", [other_site(), one_camera()], ids=["stereo", "one camera"])
def test_a_draft_is_accepted_when_a_person_has_filled_in_the_marked_values(polarsim, tmp_path, site):
    make(tmp_path / "raw", site)
    png.write_png(tmp_path / "raw/overview.png", np.zeros((30, 40), np.uint8))
    damaged = min((tmp_path / "raw").rglob("*.ply"))
    damaged.write_text("damaged")
    (tmp_path / "raw/all.ply").write_text("")
    other = tmp_path / "raw/calibration.yaml"
    other.write_text("date: 2024-05-01\n")
    draft = tmp_path / "site.yaml"
    result = polarsim("new-site", tmp_path / "raw", "--out", draft)
    assert result.returncode == 0
    skipped = [line for line in result.stdout.splitlines() if line.startswith("skipped: ")]
    assert [path in line for line, path in zip(skipped, (str(damaged), str(other)), strict=True)] == [True, True]
    assert "images without this pattern: 1, such as overview.png" in result.stdout
    assert "clouds without terrain and position in their names: 1, such as all.ply" in result.stdout
    first = polarsim("check-site", draft)
    assert first.returncode == 1
    assert all(key in first.stdout for key in ("lamps.45", "lamps.135", "sandbox.half_width_m", "rig_lamp.share"))
    content = yaml.safe_load(draft.read_text())
    content |= {"sandbox": {"half_width_m": [1.5, 3]}, "rig_lamp": {"from_camera_m": [0, 0, 0], "share": 0.1}}
    content["lamps"] = {name: {"position_m": [3, 3, 1]} for name in ("45", "135")}
    draft.write_text(yaml.safe_dump(content))
    assert polarsim("check-site", draft, "--root", tmp_path / "raw").returncode == 0
    found = read_site(draft)
    assert (found.images.size, found.images.bits, found.images.black) == (SIZE, 8, 4)
    assert (found.files.clouds, found.files.calibration, found.files.cloud_unit) == (
        "yard-{terrain}/{position}.ply", "yard-{terrain}/camchain.yaml", "m",
    )  # fmt: skip
    assert found.cameras.stereo == site.cameras.stereo
    assert found.cameras.baseline_m is None or found.cameras.baseline_m[0] < 0.12 < found.cameras.baseline_m[1]
    for terrain in found.terrains:
        keys, strays = find_photos(found, tmp_path / "raw", terrain)
        assert len(keys) == len(list(found.photos_of(terrain)))
        assert strays == []


def test_bits_white_level_and_curve_are_measured(polarsim, tmp_path):
    ramp = np.tile(np.arange(64, 900, dtype=np.uint16), (40, 1))
    ramp = np.minimum(ramp, 760)  # saturated
    for exposure in (10, 20, 40):
        cv2.imwrite(str(tmp_path / f"shot_{exposure}.tif"), ramp)
    assert polarsim("new-site", tmp_path, "--out", tmp_path / "a.yaml").returncode == 0
    images = yaml.safe_load((tmp_path / "a.yaml").read_text())["images"]
    assert (images["bits"], images["white"], images["width"]) == (10, 760, 836)
    for exposure in (10, 20, 40):
        (tmp_path / f"shot_{exposure}.tif").unlink()
        cv2.imwrite(str(tmp_path / f"shot_{exposure}.jpg"), (ramp >> 2).astype(np.uint8))
    assert polarsim("new-site", tmp_path, "--out", tmp_path / "b.yaml").returncode == 0
    assert yaml.safe_load((tmp_path / "b.yaml").read_text())["images"]["curve"] == "srgb"


@pytest.mark.parametrize("content", ["nothing", "no images", "two sizes", "damaged", "existing draft"])
def test_a_folder_without_usable_images_is_a_one_line_error(polarsim, tmp_path, content):
    folder, out = tmp_path / "raw", tmp_path / "site.yaml"
    if content != "nothing":
        folder.mkdir()
        (folder / "notes.txt").write_text("1 2\n")
    if content in ("two sizes", "damaged", "existing draft"):
        for number, width in enumerate((40, 60 if content == "two sizes" else 40)):
            png.write_png(folder / f"{number + 1}.png", np.zeros((30, width), np.uint8))
    if content == "damaged":
        (folder / "1.png").write_bytes(b"x")
    if content == "existing draft":
        out.write_text("name: mine\n")
    result = polarsim("new-site", folder, "--out", out)
    assert result.returncode == 1
    assert len(result.stderr.strip().splitlines()) == 1
    if content == "two sizes":
        assert "40 x 30 pixels (1 image, such as 1.png), 60 x 30 pixels (1 image, such as 2.png)" in result.stderr
    assert out.read_text() == "name: mine\n" if content == "existing draft" else not out.exists()
