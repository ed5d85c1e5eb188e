"""Photos, calibrations and scans of another site than NASA's are indexed and converted."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from polarsim.acquire.converted import convert_photo
from polarsim.acquire.index import index_terrain
from polarsim.acquire.options import SourceOptions
from polarsim.errors import FormatError
from polarsim.formats import ply, png
from polarsim.formats.site_paths import format_path, photo_fields
from polarsim.formats.tables import read_parquet
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.pictures import pictures_at
from polarsim.run_files.rigs import read_rig
from polarsim.site_parts import Images
from tests.support.other_site import CONTENT, SIZE, one_camera, other_rig, other_site


def kalibr(rig, *, cameras=2):
    def lens(lens):
        return {
            "camera_model": "pinhole",
            "distortion_model": "radtan",
            "intrinsics": [lens.fx, lens.fy, lens.cx - 0.5, lens.cy - 0.5],
            "distortion_coeffs": list(lens.distortion[:4]),
            "resolution": [lens.width, lens.height],
        }

    motion = {"T_cn_cnm1": rig.left_from_right.inverse().matrix.tolist()}
    return yaml.safe_dump(
        {"cam0": lens(rig.left), "cam1": lens(rig.right) | motion} if cameras == 2 else {"cam0": lens(rig.left)}
    )


def make(root: Path, site, *, skipped=0, suffix=None):
    """Write the photos, a cloud and the calibration of yard-a."""
    keys = list(site.photos_of("yard-a"))[skipped:]
    pattern = site.files.photos if suffix is None else site.files.photos.replace("png", suffix)
    for number, key in enumerate(keys):
        path = root / format_path(site, pattern, "yard-a", photo_fields(key))
        path.parent.mkdir(parents=True, exist_ok=True)
        png.write_png(path, np.full(SIZE[::-1], 10 + number, np.uint8))
    points = np.array([[0.1, 0.2, 3.0], [0.3, 0.1, 2.0]])
    ply.write_ply(root / "yard-a/gate.ply", ply.Cloud(points, points))
    (root / "yard-a/camchain.yaml").write_text(kalibr(other_rig(), cameras=len(site.cameras.sides)))
    return keys


def index(tmp_path, site, root, out="out"):
    folder = tmp_path / out
    index_terrain(
        site=site, terrain="yard-a", positions=site.positions, source=SourceOptions(kind="files", root=root),
        seed_options="none", photos=folder / "photos.parquet", calibration=folder / "calibration.json",
        inventory=folder / "inventory.json", seeds=folder / "seeds", converted=folder / "photos",
    )  # fmt: skip
    return folder


@pytest.mark.parametrize("site", [other_site(), one_camera()], ids=["stereo", "one camera"])
def test_a_terrain_of_another_site_is_indexed_with_converted_photos(tmp_path, site, caplog):
    keys = make(tmp_path / "raw", site)
    out = index(tmp_path, site, tmp_path / "raw")
    table = read_parquet(out / "photos.parquet")
    assert table["key"].tolist() == sorted(map(str, keys))
    assert set(table["path"]) == {(out / "photos" / f"{key}.png").as_posix() for key in keys}
    assert table[["width", "height", "bits"]].drop_duplicates().to_numpy().tolist() == [[640, 480, 16]]
    first = png.read_photo(pictures_at(out / "photos.parquet")[keys[0]], SIZE)
    assert np.unique(first).tolist() == [round(16 + (10 - 4) * 4079 / 251)]
    rig = read_rig(out / "calibration.json")
    assert rig.is_stereo == site.cameras.stereo
    np.testing.assert_allclose(rig.left.cx, other_rig().left.cx)
    inventory = read_inventory(out / "inventory.json")
    assert (inventory.terrain, inventory.scanned, inventory.stray) == ("yard-a", ["gate"], ())
    assert not [record for record in caplog.records if "missing" in record.getMessage()]


def test_the_same_photos_are_converted_to_the_same_bytes(tmp_path):
    make(tmp_path / "raw", other_site())
    first, second = (index(tmp_path, other_site(), tmp_path / "raw", name) for name in "ab")
    names = sorted(path.name for path in (first / "photos").iterdir())
    assert all((first / "photos" / name).read_bytes() == (second / "photos" / name).read_bytes() for name in names)


def test_a_missing_photo_of_a_single_camera_is_a_gap_without_second_camera(tmp_path, caplog):
    make(tmp_path / "raw", one_camera(), skipped=1)
    index(tmp_path, one_camera(), tmp_path / "raw")
    (gap,) = [record.getMessage() for record in caplog.records if "of the grid missing" in record.getMessage()]
    assert "27 photos found, 1 of the grid missing, such as yard-a_gate_off_no_L_0640" in gap


def test_a_terrain_without_scans_among_others_is_an_error_that_names_the_remedy(tmp_path):
    make(tmp_path / "raw", other_site())
    (tmp_path / "raw/yard-a/gate.ply").unlink()
    with pytest.raises(FormatError, match=r"yard-a.*source\.scans: false") as caught:
        index(tmp_path, other_site(), tmp_path / "raw")
    assert caught.value.path == tmp_path / "raw"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("unknown", ["lamp", "position", "exposure"])
def test_photos_of_a_lamp_position_or_exposure_that_the_site_lacks_are_counted_and_named(tmp_path, caplog, unknown):
    path = {
        "lamp": "yard-a/gate/lamp200-off/left_0010.png",
        "position": "yard-a/south/lamp45-off/left_0010.png",
        "exposure": "yard-a/gate/lamp45-off/left_0020.png",
    }[unknown]
    make(tmp_path / "raw", other_site())
    (tmp_path / "raw" / path).parent.mkdir(parents=True, exist_ok=True)
    png.write_png(tmp_path / "raw" / path, np.full(SIZE[::-1], 10, np.uint8))
    out = index(tmp_path, other_site(), tmp_path / "raw")
    (message,) = [record.getMessage() for record in caplog.records if "skipped" in record.getMessage()]
    assert f"1 file skipped, such as {path}" in message
    assert read_inventory(out / "inventory.json").stray == (path,)


@pytest.mark.parametrize("wrong", ["size", "value", "damaged"])
def test_an_invalid_photo_is_a_one_line_error_without_output(tmp_path, wrong):
    site = other_site(images=CONTENT["images"] | {"white": 240})
    key = make(tmp_path / "raw", site)[3]
    path = tmp_path / "raw" / format_path(site, site.files.photos, "yard-a", photo_fields(key))
    if wrong == "damaged":
        path.write_bytes(path.read_bytes()[:100])
    else:
        png.write_png(path, np.full((480, 600) if wrong == "size" else (480, 640), 250, np.uint8))
    with pytest.raises(FormatError) as caught:
        index(tmp_path, site, tmp_path / "raw")
    assert caught.value.path == path
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []


FORMS = {
    "8 bits": ("a.png", np.uint8, 8, 255),
    "14 bits in a TIFF": ("a.tif", np.uint16, 14, 16383),
    "10 bits in a PGM": ("a.pgm", np.uint16, 10, 1023),
    "8 bits in 16": ("a.png", np.uint16, 8, 255),
    "16 bits": ("a.png", np.uint16, 16, 65535),
}


@pytest.mark.parametrize(("name", "kind", "bits", "white"), FORMS.values(), ids=FORMS)
def test_photos_of_other_formats_have_the_black_and_white_of_the_photo_format(tmp_path, name, kind, bits, white):
    form = Images(width=32, height=4, bits=bits, black=white // 50)
    values = np.tile(np.array([white // 50, white], kind), (4, 16))
    cv2.imwrite(str(tmp_path / name), values)
    assert np.unique(convert_photo(tmp_path / name, form)).tolist() == [16, 4095]


def test_a_jpeg_in_colour_is_converted(tmp_path):
    cv2.imwrite(str(tmp_path / "a.jpg"), np.full((40, 64, 3), 200, np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 95])
    grey = convert_photo(tmp_path / "a.jpg", Images(width=64, height=40, bits=8, black=0))
    np.testing.assert_allclose(grey, 16 + 200 / 255 * 4079, atol=17)


@pytest.mark.parametrize(
    ("values", "named"),
    [
        (np.full((4, 32), 300, np.uint16), "value 300"),
        (np.full((4, 32), 1, np.float32), "float32"),
        (np.full((32, 4), 1, np.uint8), "4 x 32"),
    ],
)
def test_values_and_sizes_that_the_site_does_not_have_are_errors(tmp_path, values, named):
    cv2.imwrite(str(tmp_path / "a.tif"), values)
    with pytest.raises(FormatError, match=named):
        convert_photo(tmp_path / "a.tif", Images(width=32, height=4, bits=8, black=0))


def test_eight_bits_are_too_few_for_a_site_with_twelve(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), np.zeros((4, 32), np.uint8))
    with pytest.raises(FormatError, match="8 bits, expected 12"):
        convert_photo(tmp_path / "a.png", Images(width=32, height=4, bits=12, black=0))


def test_the_calibration_in_a_run_states_its_file(tmp_path):
    make(tmp_path / "raw", other_site())
    out = index(tmp_path, other_site(), tmp_path / "raw")
    assert json.loads((out / "calibration.json").read_text())["source"] == "camchain.yaml"
