"""Publication of a run of a site with named terrains and lamps, with two cameras and with one."""

import json

import pandas as pd
import pytest

from polarsim.errors import ConfigError
from polarsim.publish.run import publish_forms
from tests.support.other_run import FOLDER, MODEL, TERRAIN, keys_of, make_run
from tests.support.other_site import SIZE, one_camera, other_site

FORMS = ("coco", "yolo", "hf", "parquet", "colmap", "nerfstudio", "mcap", "gltf", "pds4", "croissant")


@pytest.fixture(scope="module", params=[other_site, one_camera], ids=["stereo", "one camera"])
def site(request):
    return request.param()


@pytest.fixture(scope="module")
def run(site, tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("other"), site)


@pytest.fixture(scope="module")
def out(run, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    publish_forms(run, out, FORMS, photos=True)
    return out


def test_images_have_the_ids_and_names_of_the_site(site, out):
    content = json.loads((out / f"coco/annotations/{MODEL}_unassigned.json").read_text())
    assert {row["key"]: row["id"] for row in content["images"]} == {
        str(key): site.image_id(key) for key in keys_of(site)
    }
    assert {row["terrain"] for row in content["images"]} == {TERRAIN}
    assert {(row["width"], row["height"]) for row in content["images"]} == {SIZE}
    assert len({row["id"] for row in content["annotations"]}) == len(content["annotations"]) > 0


def test_tables_have_names_of_terrains(site, out):
    table = pd.read_parquet(next((out / "parquet" / MODEL).glob("*.parquet")))
    assert set(table["terrain"]) == {TERRAIN}
    poses, lamps = (pd.read_parquet(out / f"croissant/{name}.parquet") for name in ("poses", "lamps"))
    assert set(poses["camera"]) == set(site.cameras.sides)
    assert set(poses["position"]) == {"gate", "mast"}
    assert set(lamps["lamp"]) == {"45", "135", "rover_gate", "rover_mast"}


def test_a_model_has_the_cameras_of_the_site(site, out):
    folder = out / "colmap" / MODEL / FOLDER / "sparse/0"
    lines = [line for line in (folder / "cameras.txt").read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == len(site.cameras.sides)
    assert all(line.split()[2:4] == [str(length) for length in SIZE] for line in lines)
    assert (out / f"gltf/terrain{TERRAIN}.glb").is_file()
    assert list((out / "mcap").rglob(f"{FOLDER}_Posgate.mcap"))


def test_cards_state_the_data_set_and_its_terms(site, run, out, tmp_path):
    card = (out / "hf/README.md").read_text()
    assert f"photos of site {site.name}" in card
    assert "which the site file does not state" in card
    assert "NASA" not in card.partition("## Citation")[0]
    publish_forms(run, tmp_path, ["hf"], subset=f"terrain={TERRAIN},exposure=640")
    assert "The photos of site yard are not included." in (tmp_path / "hf/README.md").read_text()
    with pytest.raises(ConfigError, match=TERRAIN):
        publish_forms(run, tmp_path / "none", ["hf"], subset="terrain=yard-b")


def test_a_site_states_the_name_and_the_terms_of_its_photos(tmp_path):
    licence = {"terms": "CC BY 4.0, Institute of Sand", "url": "https://example.org/by"}
    run = make_run(tmp_path, other_site(title="the Sand Yard data set", licence=licence))
    publish_forms(run, tmp_path / "out", ["hf"], photos=True)
    line = "| Photos of the Sand Yard data set (domain real) | CC BY 4.0, Institute of Sand | https://example.org/by |"
    assert line in (tmp_path / "out/hf/README.md").read_text()


def test_stereo_formats_need_two_cameras(site, run, tmp_path):
    if site.cameras.stereo:
        publish_forms(run, tmp_path, ["kitti"])
        assert list((tmp_path / f"kitti/{MODEL}/training/image_3").glob("*.png"))
        return
    with pytest.raises(ConfigError, match="single camera"):
        publish_forms(run, tmp_path, ["kitti"])
