"""The page of a run of a site with named terrains and lamps, with two cameras and with one."""

import io
import json

import pyarrow as pa
import pytest
from PIL import Image

from polarsim.errors import LabelError
from polarsim.explore.corrections import Corrections
from polarsim.explore.site import default_width, page_of_run
from polarsim.run_files.run import Run
from tests.support.other_run import MODEL, TERRAIN, boxes_of, keys_of, make_run
from tests.support.other_site import SIZE, one_camera, other_site


@pytest.fixture(scope="module", params=[other_site, one_camera], ids=["stereo", "one camera"])
def site(request):
    return request.param()


@pytest.fixture(scope="module")
def run(site, tmp_path_factory):
    return Run.at(make_run(tmp_path_factory.mktemp("other"), site))


@pytest.fixture(scope="module")
def page(run):
    return page_of_run(run)


def test_lists_of_the_page_come_from_the_run(page):
    about = json.loads(page["data/run.json"]())
    assert about["terrains"] == about["meshes"] == [TERRAIN]
    assert (about["suns"], about["rig_lamp"]) == (["45", "135"], True)
    assert (about["width"], about["height"]) == SIZE
    assert about["domains"] == ["photo", MODEL]
    for name, script in page.items():
        if name.endswith(".js") and not name.startswith("vendor"):
            assert b"'350'" not in script()
            assert b"8192" not in script()


def test_every_file_of_the_page_can_be_made(page):
    for content in page.values():
        content()


def test_images_of_small_photos_have_their_size(site, page):
    picture = Image.open(io.BytesIO(page[f"data/pictures/photo/{keys_of(site)[0]}.jpg"]()))
    assert picture.size == SIZE


def test_cameras_lamps_and_labels_of_a_named_terrain(site, page):
    setup = json.loads(page[f"data/terrain/{TERRAIN}.json"]())
    assert {one["camera"] for one in setup["cameras"]} == set(site.cameras.sides)
    assert set(setup["lamps"]) == {"45", "135"}
    assert set(setup["rover_lights"]) == {"gate", "mast"}
    table = pa.ipc.open_file(pa.BufferReader(page["data/pictures.arrow"]())).read_all().to_pandas()
    assert set(table["terrain"].astype(str)) == {TERRAIN}
    assert len(table) == 2 * len(keys_of(site))


def test_corrections_fit_into_the_photo(site, run):
    corrections, key = Corrections(run), str(keys_of(site)[0])
    boxes = [
        {"kind": kind, "rock": rock, **dict(zip(("x0", "y0", "x1", "y1"), map(float, box), strict=True))}
        for (kind, rock), box in boxes_of(site, keys_of(site)[0]).items()
    ]
    corrections.save(key, boxes)
    (saved,) = corrections.read().values()
    for one, other in zip(saved, sorted(boxes, key=lambda box: box["kind"]), strict=True):
        assert (one["kind"], one["rock"]) == (other["kind"], other["rock"])
        for edge in ("x0", "y0", "x1", "y1"):
            assert one[edge] == pytest.approx(other[edge], abs=0.01)
    with pytest.raises(LabelError, match="from 0 to 640"):
        corrections.save(key, [{**boxes[0], "x1": 641.0}])
    assert corrections.prepare_run()["overlay"].endswith("corrections.yaml")


@pytest.mark.parametrize(("photo", "shown"), [(1936, 968), (2448, 1224), (1200, 968), (612, 612)])
def test_large_photos_are_halved_and_small_ones_keep_their_pixels(photo, shown):
    assert default_width(photo) == shown
