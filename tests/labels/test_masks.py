import numpy as np
import pytest
from shapely import Polygon

from polarsim.formats import png, yolo
from polarsim.geometry.polygons import paint, signed_area
from polarsim.labels.masks import Shape, draw_masks, rounded, stretched
from polarsim.labels.options import LabelsOptions
from polarsim.photo import GREY_VALUES, photo_grid

from .conftest import BLOCKS, TERRAIN
from .test_propagate import propagate

KEYS = [
    key
    for key in photo_grid(TERRAIN)
    if key.position == "A" and key.camera == "L" and key.exposure_ms in (64, 128, 2048) and key.azimuth in ("no", "30")
]


def draw(scene, out, keys=KEYS):
    propagate(scene, out, keys)
    draw_masks(
        terrain=TERRAIN,
        keys=keys,
        table=out / "labels.parquet",
        cameras=scene.cameras,
        meshes=scene.meshes,
        polygons=out / "polygons",
        masks=out / "masks",
        options=LabelsOptions(),
    )
    return out


@pytest.fixture(scope="module")
def drawn(untouched_scene, tmp_path_factory):
    return draw(untouched_scene, tmp_path_factory.mktemp("drawn"))


def grey(drawn, name):
    return png.read(drawn / "masks" / f"{name}.png")


def test_every_photo_gets_polygons_and_a_grey_map(drawn):
    for folder in ("polygons", "masks"):
        assert {path.stem for path in (drawn / folder).iterdir()} == {str(key) for key in KEYS}


def test_grey_maps_are_the_painted_polygons_with_the_four_values(drawn):
    polygons = yolo.read_polygons(drawn / "polygons" / "03_A_off_30_L_0128.txt")
    picture = grey(drawn, "03_A_off_30_L_0128")
    assert (picture != paint(polygons)).mean() < 1e-5  # the file's six decimals may move a pixel
    assert set(np.unique(picture)) == set(GREY_VALUES.values())


def test_polygons_are_valid_and_inside_the_photo(drawn):
    for number, ring in yolo.read_polygons(drawn / "polygons" / "03_A_off_30_L_0128.txt"):
        assert number in range(4)
        assert Polygon(ring).is_valid
        assert signed_area(ring) > 0
        assert ring.min() >= 0
        assert (ring <= [1936, 1216]).all()


def test_rock_masks_fill_the_blocks_as_the_photo_shows_them(untouched_scene, drawn):
    picture = grey(drawn, "03_A_off_30_L_0128")
    for rock in BLOCKS:
        x0, y0, x1, y1 = untouched_scene.expected_box("A", "L", rock).round().astype(int)
        share = (picture[y0:y1, x0:x1] == GREY_VALUES["rock"]).mean()
        assert 0.6 < share < 0.98  # a block seen from above one of its corners fills most of its box
        assert (picture[y0 - 20 : y0 - 3, x0:x1] != GREY_VALUES["rock"]).all()


def test_sand_is_ground_and_what_lies_behind_the_wall_is_background(drawn):
    picture = grey(drawn, "03_A_off_30_L_0128")
    assert picture[600, 900] == GREY_VALUES["ground"]
    assert picture[5, 900] == GREY_VALUES["background"]


def test_all_exposures_and_lights_share_one_drawing(drawn):
    whole = grey(drawn, "03_A_off_30_L_0128")
    for name in ("03_A_off_30_L_0064", "03_A_on_30_L_2048"):
        np.testing.assert_array_equal(grey(drawn, name), whole)


def test_a_photo_in_the_dark_is_all_background(drawn):
    assert not grey(drawn, "03_A_off_no_L_2048").any()
    ((number, ring),) = yolo.read_polygons(drawn / "polygons" / "03_A_off_no_L_2048.txt")
    assert number == 0
    assert signed_area(ring) == pytest.approx(1936 * 1216)


def test_labels_of_a_rock_without_mesh_still_get_outlines(scene, tmp_path):
    (scene.meshes / "terrain03_rock7.obj").unlink()
    keys = [key for key in KEYS if key.azimuth == "30"][:2]
    draw(scene, tmp_path, keys)
    x0, y0, x1, y1 = scene.expected_box("A", "L", 7).round().astype(int)
    for key in keys:
        assert (grey(tmp_path, key)[y0:y1, x0:x1] == GREY_VALUES["rock"]).mean() > 0.5


def test_a_stretched_shape_fills_its_new_box():
    y, x = np.mgrid[:40, :60] + 0.5
    ellipse = Shape(((x - 30) / 30) ** 2 + ((y - 20) / 20) ** 2 < 1, 100, 200)
    box = np.array([310.4, 120.0, 400.4, 180.0])
    found = stretched(ellipse, box)
    np.testing.assert_allclose(found.box, box, atol=1)
    assert found.mask.sum() == pytest.approx(np.pi * 45 * 30, rel=0.02)


def test_a_rounded_shape_fills_its_box():
    box = np.array([10.0, 20, 40, 36])
    np.testing.assert_allclose(rounded(box).box, box)
    assert np.pi / 4 < rounded(box).mask.mean() < 1
