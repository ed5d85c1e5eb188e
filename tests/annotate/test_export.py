import json
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.annotate.export import TOOLS, export_photos, opening
from polarsim.errors import ConfigError, LabelError
from polarsim.formats import png, yolo
from polarsim.formats.release import read_annotated_boxes
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, label_table, write_parquet
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEYS = [PhotoKey.parse(f"{terrain}_A_off_30_{camera}_0256") for terrain in ("01", "03") for camera in "LR"]
PIXELS = np.full((38, 60), 500, np.uint16)  # a small image, because only the path is tested
BOXES = st.lists(
    st.tuples(
        st.sampled_from(BOX_CLASSES), st.floats(-1, 1800), st.floats(-1, 1100), st.floats(2, 130), st.floats(2, 110)
    ),
    max_size=8,
)


def make_run(run: Path, drawn: dict[PhotoKey, list[tuple]]) -> Path:
    """A run with labels of some photos: class, x, y, width, height."""
    for terrain in sorted({key.terrain for key in drawn}):
        folder, photos, rows = f"Terrain{terrain:02d}", [], []
        for key in (key for key in drawn if key.terrain == terrain):
            png.write_png(run / f"photos/{key}.png", PIXELS)
            photos.append(key_columns(key) | {"path": str(run / f"photos/{key}.png")})
            yolo.write_boxes(run / f"labels/boxes/{folder}/{key}.txt", np.zeros(0, int), np.zeros((0, 4)), size=SIZE)
            for number, (kind, x, y, width, height) in enumerate(drawn[key], 1):
                row = {"kind": kind, "rock": number, "source": "fused", "confidence": 0.8}
                rows.append(key_columns(key) | row | {"x0": x, "y0": y, "x1": x + width, "y1": y + height})
        write_parquet(run / f"acquire/{folder}/photos.parquet", pd.DataFrame(photos, columns=list(PHOTO_COLUMNS)))
        write_parquet(run / f"labels/tables/{folder}.parquet", label_table(rows))
    return run


@pytest.fixture
def run(tmp_path):
    return make_run(tmp_path / "demo", {key: [("rock", 100, 200, 50, 30), ("shadow", 60, 210, 45, 20)] for key in KEYS})


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_the_export_for_labelimg_has_images_boxes_and_classes(tmp_path, run):
    assert export_photos(folder=tmp_path / "out", run=run, tool="labelimg") == len(KEYS)
    assert names(tmp_path / "out") == {f"{key}.{end}" for key in KEYS for end in ("png", "txt")} | {"classes.txt"}
    assert (tmp_path / "out/classes.txt").read_text() == "rock\nshadow\n"
    lines = (tmp_path / f"out/{KEYS[0]}.txt").read_text().splitlines()
    assert lines[0] == "0 0.064566 0.176809 0.025826 0.024671"  # 125/1936 215/1216 50/1936 30/1216
    shown = png.read_png(tmp_path / f"out/{KEYS[0]}.png")
    assert shown.dtype == np.uint8
    assert shown.shape == PIXELS.shape


@settings(max_examples=6, deadline=None)
@given(drawn=BOXES)
def test_exported_boxes_read_back_with_an_error_below_a_hundredth_of_a_pixel(tmp_path_factory, drawn):
    folder = tmp_path_factory.mktemp("export")
    export_photos(folder=folder / "out", run=make_run(folder / "demo", {KEYS[0]: drawn, KEYS[1]: []}), tool="labelimg")
    found = read_annotated_boxes(folder / "out", polar().images.size, PhotoKey.parse)
    assert list(found) == KEYS[:2]
    assert len(found[KEYS[1]][0]) == 0
    classes, boxes = found[KEYS[0]]
    wanted = np.array([[BOX_CLASSES.index(kind), x, y, x + w, y + h] for kind, x, y, w, h in drawn]).reshape(-1, 5)
    read = np.column_stack([classes, boxes])
    assert len(read) == len(wanted)
    apart = np.abs(read[:, None] - wanted[None]).max(axis=-1)  # in the order of rocks, not of drawing
    assert (apart.min(axis=0, initial=1) < 0.01).all()
    assert (apart.min(axis=1, initial=1) < 0.01).all()


def test_terrains_are_selected_by_number_and_photos_by_pattern(tmp_path, run):
    export_photos(folder=tmp_path / "one", run=run, terrains=[3], tool="labelimg")
    assert {key.terrain for key in read_annotated_boxes(tmp_path / "one", polar().images.size, PhotoKey.parse)} == {3}
    export_photos(folder=tmp_path / "two", run=run, pattern="*_L_*", tool="labelimg")
    assert {key.camera for key in read_annotated_boxes(tmp_path / "two", polar().images.size, PhotoKey.parse)} == {"L"}
    with pytest.raises(LabelError, match="13_"):
        export_photos(folder=tmp_path / "three", run=run, pattern="13_*", tool="labelimg")
    assert not (tmp_path / "three").exists()


def test_twins_can_be_exported_instead_of_photos(tmp_path, run):
    with pytest.raises(LabelError):
        export_photos(folder=tmp_path / "out", run=run, domain="hapke", tool="labelimg")
    png.write_png(run / f"renders/hapke/Terrain03/{KEYS[2]}.png", np.full((38, 60), 4095, np.uint16))
    assert export_photos(folder=tmp_path / "out", run=run, domain="hapke", tool="labelimg") == 1
    assert (png.read_png(tmp_path / f"out/{KEYS[2]}.png") == 255).all()


@pytest.mark.parametrize("tool", TOOLS)
def test_a_folder_with_labels_is_not_overwritten(tmp_path, run, tool):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/01_A_off_30_L_0256.txt").write_text("edited")
    with pytest.raises(ConfigError):
        export_photos(folder=tmp_path / "out", run=run, tool=tool)
    assert (tmp_path / "out/01_A_off_30_L_0256.txt").read_text() == "edited"


def test_an_empty_folder_is_used_and_an_unknown_tool_is_an_error(tmp_path, run):
    (tmp_path / "out").mkdir()
    export_photos(folder=tmp_path / "out", run=run, tool="cvat")
    assert names(tmp_path / "out")
    with pytest.raises(ConfigError):
        export_photos(folder=tmp_path / "other", run=run, tool="paint")


def test_the_export_for_cvat_has_coco_and_labels_of_the_task(tmp_path, run):
    export_photos(folder=tmp_path / "out", run=run, tool="cvat")
    pictures = {f"images/{key}.png" for key in KEYS}
    assert names(tmp_path / "out") == pictures | {"annotations/instances_default.json", "labels.json"}
    document = json.loads((tmp_path / "out/annotations/instances_default.json").read_text())
    assert {f"images/{image['file_name']}" for image in document["images"]} == pictures
    assert len(document["annotations"]) == 2 * len(KEYS)
    labels = json.loads((tmp_path / "out/labels.json").read_text())
    assert [entry["name"] for entry in labels] == [category["name"] for category in document["categories"]]


def test_paths_for_label_studio_are_below_the_served_folder(tmp_path, run):
    folder = tmp_path / "to check"
    export_photos(folder=folder, run=run, tool="label-studio")
    assert names(folder) == {f"images/{key}.png" for key in KEYS} | {"tasks.json", "interface.xml"}
    for task in json.loads((folder / "tasks.json").read_text()):
        address, _, position = task["data"]["image"].partition("?d=")
        assert address == "/data/local-files/"
        assert (tmp_path / unquote(position)).is_file()
    assert f"serve local files from {tmp_path}," in opening(folder, "label-studio")


@pytest.mark.parametrize("tool", TOOLS)
def test_same_run_same_bytes(tmp_path, run, tool):
    for position in ("a", "b"):
        export_photos(folder=tmp_path / position / "out", run=run, tool=tool)
    for name in names(tmp_path / "a/out"):
        assert (tmp_path / "a/out" / name).read_bytes() == (tmp_path / "b/out" / name).read_bytes()
