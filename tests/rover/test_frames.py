"""Pictures of a drive: what they show, under which light, in which files, and that a stopped run goes on."""

from datetime import UTC, datetime

import numpy as np
import pytest

from polarsim.errors import ConfigError, PolarsimError, RoverError
from polarsim.formats import png, yolo
from polarsim.formats.instances import BODY, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.formats.tables import read_parquet
from polarsim.render.layers import NO_LAMP
from polarsim.render.views.moon import sun_over
from polarsim.rover import frames
from polarsim.rover.frames import labels_folder, picture_folder, render_frames
from polarsim.rover.sight import Sight, mount_of
from polarsim.rover.sight_options import FRONT, PAPER_VIEWS, RealSun, SightOptions
from polarsim.rover.suns import suns_of
from polarsim.rover.trace import write_trace
from polarsim.rover.truth import read_truth
from tests.rover import driven

SMALL = {"scale": 0.08, "finer": 2, "far_m": 10.0, "suns": ("2",)}


def options(**changes):
    return SightOptions(**{**SMALL, **changes})


@pytest.fixture(scope="module")
def drive():
    return driven.trace(seconds=3.0)


@pytest.fixture(scope="module")
def sight(drive):
    own = Sight(drive, driven.vehicle(), options(views=(FRONT, "CamBirdViewLeft", "WheelCam_LeftBack"), scale=0.12))
    own.show(10)
    return own


def test_the_paper_has_seven_views_and_the_table_knows_them_all():
    assert len(PAPER_VIEWS) == 7
    for name in PAPER_VIEWS:
        assert driven.vehicle().camera(name).name == name


def test_the_paper_names_four_suns_from_east_over_south_to_west():
    found = suns_of(SightOptions())
    assert [round(sun.azimuth_deg) for sun in found.values()] == [0, 315, 225, 180]
    east, southeast = (found[name].lamp.position for name in "12")
    assert east[0] > 0
    assert abs(east[1]) < 1e-9 * east[0]
    assert southeast[0] > 0 > southeast[1]
    np.testing.assert_allclose(np.degrees(np.arcsin(east[2] / np.linalg.norm(east))), 8)


def real_sun(day):
    return RealSun(latitude_deg=-85.4, longitude_deg=31, moment_utc=datetime(2026, 12, day, tzinfo=UTC))


def test_the_real_sun_near_the_pole_is_low_and_stands_where_it_does_that_day():
    sun = suns_of(SightOptions(suns=(), real_sun=real_sun(21)))["real"]
    assert 5 < sun.elevation_deg < 6.3  # never above 6.2 at that latitude
    compass, elevation = sun_over(-85.4, 31, datetime(2026, 12, 21, tzinfo=UTC))
    towards = sun.lamp.position / np.linalg.norm(sun.lamp.position)
    np.testing.assert_allclose(np.degrees(np.arctan2(towards[0], towards[1])) % 360, compass, atol=1e-6)  # from north
    np.testing.assert_allclose(np.degrees(np.arcsin(towards[2])), elevation, atol=1e-6)


def test_the_real_sun_by_night_is_refused():
    with pytest.raises(RoverError, match=r"3\.1 degrees below the horizon at 2026-12-06"):
        suns_of(SightOptions(suns=(), real_sun=real_sun(6)))


def test_no_sun_is_refused():
    with pytest.raises(RoverError, match="no Sun"):
        suns_of(SightOptions(suns=()))


def test_an_unknown_camera_is_refused(drive):
    with pytest.raises(ConfigError, match="no camera 'eye'"):
        Sight(drive, driven.vehicle(), options(views=("eye",)))


def test_the_front_camera_sees_the_rock_ahead_where_it_stands(sight):
    ids = sight.render(FRONT, ["2"]).ids[NO_LAMP]
    pose, lens = sight.camera(FRONT, 10)
    x, y, height, _ = driven.ROCKS[0]
    middle = np.array([x, y, driven.level(x, y) + height / 2])
    column, row = lens.project(pose.inverse().apply(middle)).astype(int)
    assert ids[row, column] == ROCK_IDS + 1


def test_the_third_person_sees_the_rover_in_the_middle(sight):
    ids = sight.render("CamBirdViewLeft", ["2"]).ids[NO_LAMP]
    height, width = ids.shape
    assert BODY <= ids[height // 2, width // 2] < ROCK_IDS
    assert (ids == GROUND).mean() > 0.4


def test_the_rover_throws_its_shadow_on_the_ground(sight):
    ids = sight.render("CamBirdViewLeft", ["2"]).ids
    layer = sight.render("CamBirdViewLeft", ["2"]).layers["hapke", "2"]
    dark = (ids[NO_LAMP] == GROUND) & (layer == 0)
    assert dark.mean() > 0.01
    assert ((ids["2"] >= SHADOW_IDS) <= (ids[NO_LAMP] == GROUND)).all()


def test_an_exposure_twice_as_long_is_twice_as_bright_where_it_does_not_clip(sight):
    rendering = sight.render(FRONT, ["2"])
    short, long = (sight.exposed(rendering, FRONT, "2", "hapke", ms).astype(float) - 16 for ms in (256, 512))
    open_pixels = (long < 4000) & (short > 50)
    np.testing.assert_allclose(long[open_pixels], 2 * short[open_pixels], atol=1.5)


def test_the_wheel_lies_before_its_camera(sight):
    pose, lens = sight.camera("WheelCam_LeftBack", 10)
    wheel = sight.trace.pose_at(2.0, "lr").translation
    pixel = lens.project(pose.inverse().apply(wheel))
    assert 0 < pixel[0] < lens.width
    assert 0 < pixel[1] < lens.height


def test_ruts_show_behind_the_wheels_and_nowhere_else(sight):
    vertices = sight.stage.surfaces.vertices
    x, y, z = vertices.T
    ground = np.zeros(len(vertices), bool)
    ground[np.unique(sight.stage.surfaces.faces[sight.stage.surfaces.id_of_face == GROUND])] = True
    behind = ground & (abs(x - 5.4) < 0.3) & (abs(y - 0.61) < 0.02)
    ahead = ground & (x > 2.5) & (x < 4.0) & (abs(y - 0.61) < 0.02)
    np.testing.assert_allclose((z - driven.level(x, y))[behind], -driven.SINKAGE - 0.003, atol=0.0045)  # with prints
    np.testing.assert_allclose((z - driven.level(x, y))[ahead], 0, atol=1e-4)


def test_a_frame_is_the_same_whether_frames_before_it_were_shown_or_not(drive):
    one, other = (Sight(drive, driven.vehicle(), options(views=(FRONT,))) for _ in range(2))
    for frame in (2, 5, 9):
        one.show(frame)
    other.show(9)
    layers = [own.render(FRONT, ["2"]).layers["hapke", "2"] for own in (one, other)]
    np.testing.assert_array_equal(*layers)
    one.show(4)
    other.show(4)
    layers = [own.render(FRONT, ["2"], threads).layers["hapke", "2"] for own, threads in ((one, 1), (other, 3))]
    np.testing.assert_array_equal(*layers)


def test_stars_shine_in_the_sky_alone_and_physical_ones_hardly(drive):
    dark, plain, bright = (
        Sight(drive, driven.vehicle(), options(views=("ncl",), stars=stars, scale=0.06))
        for stars in ("none", "physical", "bright")
    )
    layers, ids = [], None
    for own in (dark, plain, bright):
        own.show(0)
        found = own.render("ncl", ["2"])
        layers.append(found.layers["hapke", "2"])
        ids = found.ids[NO_LAMP]
    none, physical, many = layers
    np.testing.assert_array_equal(none[ids > 0], many[ids > 0])
    assert physical[ids == 0].sum() >= 0
    np.testing.assert_allclose(many[ids == 0], 300 * physical[ids == 0], rtol=1e-4)


@pytest.fixture(scope="module")
def written(tmp_path_factory, drive):
    folder = tmp_path_factory.mktemp("seed0")
    write_trace(folder, drive)
    chosen = options(views=(FRONT,), every=5, exposures_ms=(256, 1024))
    return folder, chosen, render_frames(folder, driven.vehicle(), chosen, 0)


def test_every_frame_has_its_pictures_and_labels(written):
    folder, chosen, made = written
    assert made == 4 * 2 * 2
    for model in chosen.models:
        for exposure in chosen.exposures_ms:
            names = sorted(path.name for path in picture_folder(folder, FRONT, "2", model, exposure).iterdir())
            assert names == ["00000.png", "00005.png", "00010.png", "00015.png"]
    assert (folder / FRONT / "2_hapke_0256").is_dir()
    poses = read_parquet(folder / FRONT / "poses.parquet", ("frame", "qw"))
    assert list(poses["frame"]) == [0, 5, 10, 15]


def test_truth_says_the_same_in_all_its_formats(written):
    import json

    folder = written[0]
    table = read_parquet(folder / FRONT / "2_truth.parquet", ("frame", "kind"))
    assert set(table["kind"]) == {"rock", "shadow"}
    picture = png.read(picture_folder(folder, FRONT, "2", "hapke", 256) / "00005.png")
    size = picture.shape[::-1]
    own = table[table["frame"] == 5]
    classes, boxes = yolo.read_boxes(labels_folder(folder, FRONT, "2") / "00005.txt", size)
    np.testing.assert_allclose(boxes, own[["x0", "y0", "x1", "y1"]], atol=1e-3)
    assert len(classes) == len(own)
    coco = json.loads((folder / FRONT / "2_coco.json").read_text())
    assert len(coco["images"]) == 4
    assert len(coco["annotations"]) == len(table)
    nearest = own[own["kind"] == "rock"].sort_values("distance_m").iloc[0]
    assert nearest["height_m"] in [rock[2] for rock in driven.ROCKS]


def test_a_stopped_run_goes_on_and_ends_with_the_same_bytes(written, tmp_path, drive):
    folder, chosen, _ = written
    write_trace(tmp_path, drive)
    render_frames(tmp_path, driven.vehicle(), chosen, 0)
    lost = picture_folder(tmp_path, FRONT, "2", "hapke", 1024) / "00010.png"
    lost.unlink()
    kept = picture_folder(tmp_path, FRONT, "2", "hapke", 1024) / "00005.png"
    before = kept.stat().st_mtime_ns
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0, threads=2) == 4
    assert kept.stat().st_mtime_ns == before
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            assert (tmp_path / path.relative_to(folder)).read_bytes() == path.read_bytes(), path


def test_other_options_make_all_pictures_anew_and_more_exposures_only_what_is_missing(written, tmp_path, drive):
    write_trace(tmp_path, drive)
    chosen = options(views=(FRONT,), every=15, exposures_ms=(256,), models=("hapke",))
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0) == 2
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0) == 0
    assert render_frames(tmp_path, driven.vehicle(), chosen.model_copy(update={"exposures_ms": (256, 512)}), 0) == 4
    assert render_frames(tmp_path, driven.vehicle(), chosen.model_copy(update={"sun_elevation_deg": 5.0}), 0) == 2


def test_other_code_makes_all_pictures_anew(tmp_path, drive, monkeypatch):
    write_trace(tmp_path, drive)
    chosen = options(views=(FRONT,), every=15, exposures_ms=(256,), models=("hapke",))
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0) == 2
    monkeypatch.setattr(frames, "code_digest", lambda *modules: f"other {modules}")
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0) == 2
    assert render_frames(tmp_path, driven.vehicle(), chosen, 0) == 0


def test_broken_labels_of_a_frame_are_made_anew(written):
    folder = written[0]
    path = labels_folder(folder, FRONT, "2")
    content = (path / "00000.json").read_text()
    try:
        (path / "00000.json").write_text(content[: len(content) // 2])
        assert read_truth(path, 0) is None
    finally:
        (path / "00000.json").write_text(content)
    assert read_truth(path, 0) is not None


def test_a_folder_without_a_drive_is_refused_in_one_line(tmp_path):
    with pytest.raises(PolarsimError, match=r"ground\.npz"):
        render_frames(tmp_path, driven.vehicle(), options(), 0)


def test_a_scaled_camera_sees_the_same():
    whole, half = (mount_of(driven.vehicle().camera(FRONT), scale) for scale in (1, 0.5))
    point = np.array([0.1, 0.2, 2.0])
    np.testing.assert_allclose(half.lens.project(point), whole.lens.project(point) / 2)
    assert whole.lens.width == 1936
