"""Export, import and pictures of a site with named terrains and smaller photos, with two cameras and with one."""

import json

import numpy as np
import pytest

from polarsim.annotate.export import export_photos
from polarsim.annotate.import_labels import import_labels
from polarsim.annotate.show import show_of_run
from polarsim.errors import FormatError, LabelError
from polarsim.formats import png, release
from polarsim.run_files.run import Run
from tests.support.other_run import MODEL, TERRAIN, boxes_of, keys_of, make_run
from tests.support.other_site import SIZE, one_camera, other_site


@pytest.fixture(scope="module", params=[other_site, one_camera], ids=["stereo", "one camera"])
def site(request):
    return request.param()


@pytest.fixture(scope="module")
def run(site, tmp_path_factory):
    return make_run(tmp_path_factory.mktemp("other"), site)


@pytest.mark.parametrize("tool", ["labelimg", "cvat", "label-studio"])
def test_exported_labels_can_be_imported(site, run, tmp_path, tool):
    assert export_photos(folder=tmp_path / "out", run=run, terrains=[TERRAIN], tool=tool) == len(keys_of(site))
    done = import_labels(tmp_path / "out", tmp_path / "labels", site=site)
    assert done.photos == len(keys_of(site))
    found = release.read_annotated_boxes(tmp_path / "labels", SIZE, site.key)
    for key in keys_of(site):
        wanted = np.array(sorted(box.tolist() for box in boxes_of(site, key).values()))
        np.testing.assert_allclose(sorted(found[key][1].tolist()), wanted, atol=0.01)


def test_an_export_of_another_site_is_refused(run, tmp_path, site):
    export_photos(folder=tmp_path / "out", run=run, tool="cvat")
    with pytest.raises(FormatError, match="640 x 480"):
        import_labels(tmp_path / "out", tmp_path / "polar", site=other_site(images={"width": 800, "height": 500}))
    content = json.loads((tmp_path / "out/annotations/instances_default.json").read_text())
    for image in content["images"]:
        image["key"] = image["key"].replace("_45_", "_30_")
    (tmp_path / "other.json").write_text(json.dumps(content))
    with pytest.raises(FormatError, match="azimuth '30', expected no, 45 or 135"):
        import_labels(tmp_path / "other.json", tmp_path / "labels", site=site)


@pytest.mark.parametrize("size", [(1936, 1216), (2448, 2048)])
@pytest.mark.parametrize("form", ["yolo", "coco", "cvat", "label-studio"])
def test_an_import_of_another_site_suggests_the_option(polarsim, tmp_path, form, size):
    """Labels of the shipped site `yard`, of photos in its size and in that of the default site."""
    source, (width, height) = tmp_path / "export", size
    source.mkdir()
    name = "yard-a_gate_off_45_L_0040"
    if form == "yolo":
        (source / f"{name}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
        (source / "classes.txt").write_text("rock\nshadow\n")
    if form == "coco":
        images = [{"id": 1, "file_name": f"{name}.png", "width": width, "height": height}]
        rows = [{"id": 1, "image_id": 1, "category_id": 1, "bbox": [10, 10, 30, 30]}]
        content = {"images": images, "categories": [{"id": 1, "name": "rock"}], "annotations": rows}
        (source / "labels.json").write_text(json.dumps(content))
    if form == "cvat":
        box = '<box label="rock" xtl="10" ytl="10" xbr="40" ybr="40"/>'
        image = f'<image id="0" name="{name}.png" width="{width}" height="{height}">{box}</image>'
        (source / "annotations.xml").write_text(f"<annotations>{image}</annotations>")
    if form == "label-studio":
        value = {"x": 10, "y": 10, "width": 5, "height": 5, "rectanglelabels": ["rock"]}
        region = {"id": "x", "type": "rectanglelabels", "original_width": width, "original_height": height}
        task = {
            "id": 1,
            "data": {"image": f"{name}.png"},
            "annotations": [{"id": 1, "result": [{**region, "value": value}]}],
        }
        (source / "tasks.json").write_text(json.dumps([task]))
    done = polarsim("import", source, tmp_path / "out")
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert "--site" in line
    if size == (2448, 2048):
        done = polarsim("import", source, tmp_path / "out", "--site", "yard")
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("domain", ["photo", MODEL])
def test_a_picture_with_labels_has_the_size_of_the_photo(site, run, tmp_path, domain):
    key = keys_of(site)[0]
    for name, masks in (("plain", False), ("filled", True)):
        show_of_run(key=key, run=Run(run), domain=domain, out=tmp_path / f"{name}.png", masks=masks)
    plain, filled = (png.read_png(tmp_path / f"{name}.png").astype(int) for name in ("plain", "filled"))
    assert plain.shape[1] == SIZE[0]
    filled_pixels = np.abs(plain - filled).max(axis=-1) > 0
    outside = filled_pixels.copy()
    for x0, y0, x1, y1 in np.round(list(boxes_of(site, key).values())).astype(int):
        assert filled_pixels[y0 + 2 : y1 - 2, x0 + 2 : x1 - 2].mean() > 0.5  # without ids and lines
        outside[y0 - 2 : y1 + 2, x0 - 2 : x1 + 2] = False
    assert not outside.any()


def test_an_unknown_terrain_is_an_error_that_names_the_known_ones(run, tmp_path):
    with pytest.raises(LabelError, match="terrains with labels: yard-a"):
        export_photos(folder=tmp_path / "out", run=run, terrains=["yard-b"], tool="labelimg")
