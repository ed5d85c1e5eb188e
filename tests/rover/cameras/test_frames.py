"""Image files of a drive, and resuming an interrupted run."""

import numpy as np
import pytest

from polarsim.errors import PolarsimError
from polarsim.formats import png, yolo
from polarsim.formats.tables import read_parquet
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.frames import read_frame_truth, render_frames
from polarsim.rover.cameras.layout import labels_folder, picture_folder
from polarsim.rover.drive.trace import write_trace
from polarsim.rover.vehicle.mounts import FRONT
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


def test_a_resumed_run_has_the_same_bytes(written, tmp_path, drive):
    folder, chosen, _ = written
    write_trace(tmp_path, drive)
    render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER)
    lost = picture_folder(tmp_path, FRONT, "2", "hapke", 1024) / "00010.png"
    lost.unlink()
    kept = picture_folder(tmp_path, FRONT, "2", "hapke", 1024) / "00005.png"
    before = kept.stat().st_mtime_ns
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, threads=2, render=driven.RENDER) == 4
    assert kept.stat().st_mtime_ns == before
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert (tmp_path / path.relative_to(folder)).read_bytes() == path.read_bytes(), path


def test_changed_options_render_all_pictures_again_and_more_exposures_only_the_missing_ones(written, tmp_path, drive):
    write_trace(tmp_path, drive)
    chosen = options(views=(FRONT,), every=15, exposures_ms=(256,), models=("hapke",))
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 2
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 0
    more, lower = (
        chosen.model_copy(update=some) for some in ({"exposures_ms": (256, 512)}, {"sun_elevation_deg": 5.0})
    )
    assert render_frames(tmp_path, driven.vehicle(), more, 0, render=driven.RENDER) == 4
    assert render_frames(tmp_path, driven.vehicle(), lower, 0, render=driven.RENDER) == 2
    noisy, twins_only = (RenderOptions(**some) for some in ({"noise": True}, {"bounce": 0.2, "rim": False}))
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=twins_only) == 2
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 0
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=noisy) == 2


def test_changed_code_renders_all_pictures_again(tmp_path, drive, monkeypatch):
    write_trace(tmp_path, drive)
    chosen = options(views=(FRONT,), every=15, exposures_ms=(256,), models=("hapke",))
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 2
    monkeypatch.setattr("polarsim.provenance.code_digest", lambda *modules: f"other {modules}")
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 2
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, render=driven.RENDER) == 0


def test_broken_labels_of_a_frame_are_detected(written):
    folder = written[0]
    path = labels_folder(folder, FRONT, "2")
    content = (path / "00000.json").read_text()
    try:
        (path / "00000.json").write_text(content[: len(content) // 2])
        assert read_frame_truth(path, 0) is None
    finally:
        (path / "00000.json").write_text(content)
    assert read_frame_truth(path, 0) is not None


def test_a_folder_without_a_drive_is_an_error(tmp_path):
    with pytest.raises(PolarsimError, match=r"ground\.npz"):
        render_frames(tmp_path, driven.vehicle(), options(), 0, render=driven.RENDER)
