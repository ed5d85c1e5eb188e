"""Image and label files of a drive."""

import numpy as np
import pytest

from polarsim.errors import PolarsimError
from polarsim.formats import png, yolo
from polarsim.formats.tables import read_parquet
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.frames import render_frames
from polarsim.rover.cameras.layout import labels_folder, picture_folder
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.vehicle.camera_names import FRONT
from tests.rover import driven
from tests.rover.driven import options


@pytest.fixture(scope="module")
def written(tmp_path_factory, drive):
    folder = tmp_path_factory.mktemp("seed0")
    write_trace(folder, drive)
    chosen = options(views=(FRONT,), every=5, exposures_ms=(256, 1024))
    return folder, chosen, render_frames(folder, driven.vehicle(), chosen, 0, render=driven.RENDER)


def test_each_frame_has_pictures_and_labels(written):
    folder, chosen, made = written
    assert made == 4 * 2 * 2
    for model in chosen.models:
        for exposure in chosen.exposures_ms:
            names = sorted(path.name for path in picture_folder(folder, FRONT, "2", model, exposure).iterdir())
            assert names == ["00000.png", "00005.png", "00010.png", "00015.png"]
    assert (folder / FRONT / "2_hapke_0256").is_dir()
    poses = read_parquet(folder / FRONT / "poses.parquet", ("frame", "qw"))
    assert list(poses["frame"]) == [0, 5, 10, 15]


def test_truth_is_equal_in_all_formats(written):
    import json

    folder = written[0]
    table = read_parquet(folder / FRONT / "2_truth.parquet", ("frame", "kind"))
    assert set(table["kind"]) == {"rock", "shadow"}
    picture = png.read_png(picture_folder(folder, FRONT, "2", "hapke", 256) / "00005.png")
    size = picture.shape[::-1]
    own = table[table["frame"] == 5]
    classes, boxes = yolo.read_boxes(labels_folder(folder, FRONT, "2") / "00005.txt", size)
    np.testing.assert_allclose(boxes, own[["x0", "y0", "x1", "y1"]], atol=1e-3)
    assert len(classes) == len(own)
    coco = json.loads((folder / FRONT / "2_coco.json").read_text())
    assert len(coco["images"]) == 4
    assert all((folder / FRONT / image["file_name"]).is_file() for image in coco["images"])
    assert len(coco["annotations"]) == len(table)
    nearest = own[own["kind"] == "rock"].sort_values("distance_m").iloc[0]
    assert nearest["height_m"] in [rock[2] for rock in driven.ROCKS]


def test_a_complete_view_is_kept_and_another_is_rendered_to_the_same_bytes_with_any_number_of_threads(written, drive):
    folder, chosen, made = written
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert render_frames(folder, driven.vehicle(), chosen, 0, render=driven.RENDER) == 0
    for path in (folder / FRONT).rglob("*.*"):
        path.unlink()
    assert render_frames(folder, driven.vehicle(), chosen, 0, threads=2, render=driven.RENDER) == made
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


def test_changed_options_and_code_render_all_pictures_again(tmp_path, drive, monkeypatch):
    write_trace(tmp_path, drive)
    chosen = options(views=(FRONT,), every=15, exposures_ms=(256,), models=("hapke",), finer=1, scale=0.04)
    more, lower = (
        chosen.model_copy(update=some) for some in ({"exposures_ms": (256, 512)}, {"sun_elevation_deg": 5.0})
    )
    noisy, twins_only = (RenderOptions(**some) for some in ({"noise": True}, {"bounce": 0.2, "walls": False}))
    for given, render, made in (
        (chosen, driven.RENDER, 2), (chosen, twins_only, 0), (chosen, noisy, 2),
        (more, driven.RENDER, 4), (lower, driven.RENDER, 2), (lower, driven.RENDER, 0),
    ):  # fmt: skip
        assert render_frames(tmp_path, driven.vehicle(), given, 0, render=render) == made
    monkeypatch.setattr("polarsim.provenance.code_digest", lambda *modules: f"other {modules}")
    assert render_frames(tmp_path, driven.vehicle(), lower, 0, render=driven.RENDER) == 2


def test_a_folder_without_a_drive_is_an_error(tmp_path):
    with pytest.raises(PolarsimError, match=r"ground\.npz"):
        render_frames(tmp_path, driven.vehicle(), options(), 0, render=driven.RENDER)
