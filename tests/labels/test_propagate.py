import logging

import numpy as np
import pandas as pd
import pytest

from polarsim.errors import FormatError, LabelError
from polarsim.formats import obj, png, tables, yolo
from polarsim.formats.coco import write_coco
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.boxes import box_centres, iou
from polarsim.geometry.poses import Pose
from polarsim.labels.association import associate_rocks
from polarsim.labels.brightness import OlatBrightness, PhotoBrightness
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PositionLabels, propagate_labels
from polarsim.photo import BLACK_LEVEL, FIRST_ID_WITHOUT_MESH, PhotoKey
from polarsim.run_files import inventory, rigs
from polarsim.run_files.lamps import surveyed_suns
from polarsim.run_files.scene import read_terrain
from polarsim.site import polar
from tests.support.polar_survey import SANDBOX

from .conftest import BLOCKS, TERRAIN, block, localised

POLAR = polar()
SIZE = POLAR.images.size

KEYS = [
    key
    for key in polar().photos_of(TERRAIN)
    if key.position in "AC" and key.exposure_ms in (64, 128, 1024, 2048) and key.azimuth in ("no", "30", "270")
]


def propagate(scene, out, keys=KEYS, **options):
    propagate_labels(
        scene.inputs(keys),
        boxes=out / "boxes",
        table=out / "labels.parquet",
        options=LabelsOptions(**{"ray_step_px": 4, "visibility": "annotator", **options}),
    )
    return {key: yolo.read_boxes(out / "boxes" / f"{key}.txt", size=SIZE) for key in keys}


def key(text: str) -> PhotoKey:
    return PhotoKey.parse(f"{TERRAIN:02d}_{text}")


def rocks(labels, text):
    classes, boxes = labels[key(text)]
    return boxes[classes == 0]


def shadows(labels, text):
    classes, boxes = labels[key(text)]
    return boxes[classes == 1]


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return tmp_path_factory.mktemp("propagated")


@pytest.fixture(scope="module")
def labels(untouched_scene, out):
    return propagate(untouched_scene, out)


def test_every_photo_of_the_grid_gets_a_file_and_nothing_else_is_written(out, labels):
    assert {path.stem for path in (out / "boxes").iterdir()} == {str(k) for k in KEYS}


def test_shadows_start_at_a_minimum_exposure_and_rocks_do_not(labels):
    assert len(rocks(labels, "A_off_30_L_0064")) == 2
    assert len(shadows(labels, "A_off_30_L_0064")) == 0
    assert len(shadows(labels, "A_off_30_L_0128")) == 2


def test_a_terrain_can_override_the_minimum_shadow_exposure(scene, tmp_path):
    found = propagate(scene, tmp_path / "early", min_shadow_exposure_ms_by_terrain={TERRAIN: 64, 1: 1024})
    assert len(shadows(found, "A_off_30_L_0064")) == 2


def test_labels_of_the_right_camera_follow_its_lens(untouched_scene, labels):
    photo = "A_on_30_R_1024"
    expected = np.array([untouched_scene.expected_box("A", "R", rock) for rock in BLOCKS])
    assert iou(rocks(labels, photo), expected).max(axis=1).min() > 0.85
    assert len(shadows(labels, photo)) == 2


def test_an_azimuth_without_seeds_gets_fused_rocks_and_cast_shadows(untouched_scene, labels):
    expected = np.array([untouched_scene.expected_box("A", "L", rock) for rock in BLOCKS])
    assert iou(rocks(labels, "A_off_270_L_0128"), expected).max(axis=1).min() > 0.9
    found = shadows(labels, "A_off_270_L_0128")
    assert len(found) == 2
    assert found[:, 2].max() > expected[:, 2].max()  # the lamp is on the left
    assert (found[:, 0] > expected[:, 0].min()).all()


@pytest.mark.parametrize("camera", ["L", "R"])
def test_a_position_without_seeds_gets_the_projected_meshes(untouched_scene, labels, camera):
    expected = np.array([untouched_scene.expected_box("C", camera, rock) for rock in BLOCKS])
    assert iou(rocks(labels, f"C_off_30_{camera}_0128"), expected).max(axis=1).min() > 0.9
    assert len(shadows(labels, f"C_off_30_{camera}_0128")) == 2


def test_without_any_seed_all_labels_come_from_geometry(scene, tmp_path):
    for path in scene.seeds.iterdir():
        path.unlink()
    found = propagate(scene, tmp_path / "none")
    assert len(rocks(found, "A_off_30_L_0128")) == 2
    table = tables.read_parquet(tmp_path / "none" / "labels.parquet", tables.LABEL_COLUMNS)
    assert set(table["source"]) == {"projected", "cast"}


def test_without_photos_olat_images_determine_the_visible_labels(scene, tmp_path):
    """Sun lamps give labels at the shortest exposure; the rover light has a tenth of the intensity."""
    photos = ("A_off_30_L_0064", "A_off_30_L_1024", "A_off_no_L_2048", "A_on_no_L_0064", "A_on_no_L_2048")
    labels = propagate(scene, tmp_path, [key(photo) for photo in photos], visibility="photo")
    assert len(rocks(labels, "A_off_30_L_0064")) == len(rocks(labels, "A_off_30_L_1024")) == len(BLOCKS)
    assert not len(rocks(labels, "A_off_no_L_2048"))  # no lamp
    assert len(rocks(labels, "A_on_no_L_2048")) == len(BLOCKS)
    assert len(rocks(labels, "A_on_no_L_0064")) <= len(rocks(labels, "A_on_no_L_2048"))


@pytest.mark.parametrize("lost", ["mesh", "pose"])
def test_rocks_without_a_mesh_and_positions_without_a_pose_keep_their_labels_without_photos(scene, tmp_path, lost):
    if lost == "mesh":  # OLAT images include domes
        (scene.meshes / obj.rock_name(TERRAIN, min(BLOCKS))).unlink()
    else:  # a position without a pose has no OLAT image
        lose_pose(scene, "A", np.array([0.3, -0.4, 0.1]))
    labels = propagate(scene, tmp_path, [key("A_off_30_L_1024")], visibility="photo")
    assert len(rocks(labels, "A_off_30_L_1024")) == len(BLOCKS)


def test_shadow_edges_follow_the_photo_except_in_annotated_photos(scene, tmp_path):
    """In photos rendered from the scene, dark regions are cast shadows."""
    key_annotated, sibling = key("A_off_30_L_0256"), key("A_off_30_L_1024")
    rocks_only = yolo.read_boxes(scene.seeds / f"{key_annotated}.txt", size=SIZE)[1][: len(BLOCKS)]
    localised_rigs = rigs.read_all_localised(scene.cameras)
    suns = surveyed_suns(localised_rigs, polar(), TERRAIN)
    known = associate_rocks(read_terrain(scene.meshes, TERRAIN, SANDBOX), localised_rigs, suns, polar().rig_lamp, {})
    brightness = OlatBrightness(known, polar()).brightness((3, "A", "off", "30", "L"))
    rows = []
    for one in (key_annotated, sibling):
        png.write_png(tmp_path / f"{one}.png", (brightness.at(one.exposure_ms) + BLACK_LEVEL).astype(np.uint16))
        rows.append({"key": str(one), "path": str(tmp_path / f"{one}.png")})
    tables.write_parquet(scene.photos, pd.DataFrame(rows).reindex(columns=list(tables.PHOTO_COLUMNS)))
    shown = PhotoBrightness(scene.photos, TERRAIN, 1.0).brightness((3, "A", "off", "30", "L"))
    shadows = PositionLabels(known, "A", LabelsOptions()).shadows
    cast = shadows.cast("L", "off", "30", dict(zip(BLOCKS, rocks_only, strict=True)), shown)
    annotated = np.array([cast[rock].box + np.array([-4, 3, 4, 3]) for rock in BLOCKS])
    assert all(cast[rock].in_photo for rock in BLOCKS)
    boxes = np.concatenate([rocks_only, annotated])
    yolo.write_boxes(scene.seeds / f"{key_annotated}.txt", np.array([0, 0, 1, 1]), boxes, size=SIZE)
    labels = propagate(scene, tmp_path / "out", keys=[key_annotated, sibling], visibility="photo", ray_step_px=2)
    np.testing.assert_allclose(labels[key_annotated][1], boxes, atol=0.01)
    found = labels[sibling][1][labels[sibling][0] == 1]
    np.testing.assert_allclose(found, annotated + np.array([2, -1.5, -2, -1.5]), atol=0.6)


def test_only_long_exposures_are_labelled_under_the_rover_light_and_none_without_a_lamp(labels):
    assert len(rocks(labels, "A_on_no_L_2048")) == 2
    assert len(rocks(labels, "A_on_no_L_0064")) == 0  # the rover light is too weak for short exposures
    for position in "AC":
        for camera in "LR":
            assert not len(labels[key(f"{position}_off_no_{camera}_2048")][1])


@pytest.fixture
def unlit_keys():
    exposures = (1024, 2048, 4096, 8192)
    return [key(f"{position}_off_no_{camera}_{ms}") for position in "AC" for camera in "LR" for ms in exposures]


def test_unlit_photos_have_labels_from_the_minimum_annotated_exposure(scene, tmp_path, unlit_keys):
    """With stray light, as at 04_B, annotations determine the minimum exposure of each position."""
    expected = np.array([scene.expected_box("A", "L", rock) for rock in BLOCKS])
    yolo.write_boxes(scene.seeds / f"{key('A_off_no_L_4096')}.txt", np.array([0, 0]), expected, size=SIZE)
    labels = propagate(scene, tmp_path / "out", keys=unlit_keys)
    told = {str(one) for one, (classes, _) in labels.items() if len(classes)}
    assert told == {f"03_A_off_no_{camera}_{ms}" for camera in "LR" for ms in (4096, 8192)}
    np.testing.assert_allclose(rocks(labels, "A_off_no_L_4096"), expected, atol=0.01)
    assert not len(shadows(labels, "A_off_no_R_8192"))  # nothing that could throw one


def test_an_annotation_without_rocks_does_not_enable_unlit_labels(scene, tmp_path, unlit_keys):
    yolo.write_boxes(scene.seeds / f"{key('A_off_no_L_2048')}.txt", np.zeros(0, int), np.zeros((0, 4)), size=SIZE)
    assert not any(len(classes) for classes, _ in propagate(scene, tmp_path / "out", keys=unlit_keys).values())


@pytest.mark.parametrize("visibility", ["annotator", "photo"])
def test_a_photo_decides_whether_stray_light_shows_a_rock(scene, tmp_path, rng, visibility):
    """Two photos without any lamp, 8192 ms: only noise, and a bright block."""
    dark, stray = key("C_off_no_L_8192"), key("A_off_no_L_8192")
    x0, y0, x1, y1 = scene.expected_box("A", "L", 4).astype(int)
    noise = rng.normal(BLACK_LEVEL, 0.8, (2, 1216, 1936))
    noise[1, y0:y1, x0:x1] += 60
    rows = []
    for one, picture in zip((dark, stray), noise, strict=True):
        png.write_png(tmp_path / f"{one}.png", picture.clip(0).round().astype(np.uint16))
        rows.append({"key": str(one), "path": str(tmp_path / f"{one}.png")})
    tables.write_parquet(scene.photos, pd.DataFrame(rows).reindex(columns=list(tables.PHOTO_COLUMNS)))
    labels = propagate(scene, tmp_path / "out", keys=[dark, stray], visibility=visibility)
    assert not len(labels[dark][1])
    found = rocks(labels, "A_off_no_L_8192")
    assert iou(found, scene.expected_box("A", "L", 4)[None]).max() > 0.8
    assert len(found) == 1


def test_the_table_has_the_boxes_of_the_files_and_the_meshes_numbers(out, labels):
    table = tables.read_parquet(out / "labels.parquet", tables.LABEL_COLUMNS)
    assert list(table.columns) == list(tables.LABEL_COLUMNS)
    assert len(table) == sum(len(classes) for classes, _ in labels.values())
    assert set(table["rock"]) == set(BLOCKS)
    own = table[(table["key"] == "03_A_off_30_L_0128") & (table["kind"] == "rock")].set_index("rock")
    assert own.loc[4, "x0"] > own.loc[7, "x0"] or own.loc[4, "y1"] > own.loc[7, "y1"]  # block 4 lies nearer
    sources = table.groupby(["position", "camera", "azimuth"])["source"].unique().apply(set)
    assert sources["A", "L", "30"] == {"seed"}
    assert sources["A", "R", "30"] == {"fused"}
    assert sources["A", "L", "270"] == {"fused", "cast"}
    assert table["confidence"].between(0, 1).all()


def test_a_rock_without_a_mesh_has_one_number_under_all_lamps(scene, tmp_path):
    (scene.meshes / "terrain03_rock7.obj").unlink()
    propagate(scene, tmp_path / "less")
    table = tables.read_parquet(tmp_path / "less" / "labels.parquet")
    assert set(table["rock"]) == {4, FIRST_ID_WITHOUT_MESH}
    assert "projected" in set(table[table["rock"] == FIRST_ID_WITHOUT_MESH]["source"])  # at position C, by its stand-in


def test_a_correction_overrides_its_photo_and_is_propagated(scene, tmp_path):
    edited = tmp_path / "edited"
    classes, boxes = yolo.read_boxes(scene.seeds / "03_A_off_30_L_0256.txt", size=SIZE)
    moved = boxes + np.where((classes == 0)[:, None], [0, 0, 9, 0], 0)  # both rocks end 9 px further right
    yolo.write_boxes(edited / "03_A_on_30_L_1024.txt", classes, moved, size=SIZE)
    found = propagate(scene, tmp_path / "out", corrections=edited)
    wanted = moved[classes == 0]
    for photo in ("A_on_30_L_1024", "A_off_30_L_0128", "A_on_30_L_2048"):  # itself, another light, another exposure
        np.testing.assert_allclose(np.sort(rocks(found, photo), axis=0), np.sort(wanted, axis=0), atol=2e-3)
    plain = propagate(scene, tmp_path / "plain")
    for photo in ("A_off_30_R_0128", "A_off_270_L_0128"):  # the other camera, another azimuth
        gain = np.sort(rocks(found, photo)[:, 2]) - np.sort(rocks(plain, photo)[:, 2])
        assert (gain > 2).all(), photo
    table = tables.read_parquet(tmp_path / "out" / "labels.parquet")
    assert set(table[(table["key"] == "03_A_on_30_L_1024") & (table["kind"] == "rock")]["rock"]) == set(BLOCKS)


def test_corrections_may_be_a_coco_file(scene, tmp_path):
    photo = key("A_off_30_L_0128")
    box = np.array([300.0, 500, 360, 560])
    write_coco(
        tmp_path / "edited" / "instances_default.json",
        {photo: [Annotation("rock", 9, box)]},
        POLAR,
        SIZE,
    )
    found = propagate(scene, tmp_path / "out", corrections=tmp_path / "edited")
    np.testing.assert_allclose(rocks(found, "A_off_30_L_0128"), [box], atol=2e-3)
    assert len(shadows(found, "A_off_30_L_0128")) == 0
    yolo.write_boxes(tmp_path / "edited" / f"{photo}.txt", np.array([0]), box[None], size=SIZE)
    with pytest.raises(FormatError, match=r"instances_default\.json"):
        propagate(scene, tmp_path / "twice", corrections=tmp_path / "edited")


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ("seeds/03_A_off_30_L_0256.txt", r"03_A_off_30_L_0256\.txt:1"),
        ("edited/03_A_on_30_L_1024.txt", r"03_A_on_30_L_1024\.txt:1"),
        ("edited", "no such folder"),
        ("inventory.json", "terrain 11, expected 03"),
    ],
)
def test_invalid_input_leaves_no_output(scene, tmp_path, broken, reason):
    if broken == "inventory.json":
        inventory.write_inventory(scene.inventory, inventory.Inventory(11, "release"))
    elif broken.endswith(".txt"):
        (tmp_path / broken).parent.mkdir(exist_ok=True)
        (tmp_path / broken).write_text("0 0.5 0.5 0.1\n")
    corrections = tmp_path / "edited" if broken.startswith("edited") else None
    with pytest.raises((FormatError, LabelError), match=reason):
        propagate(scene, tmp_path / "out", corrections=corrections)
    assert not (tmp_path / "out").exists()


def test_seeds_of_the_right_camera_label_the_left_camera(scene, tmp_path):
    for path in list(scene.seeds.iterdir()):
        path.unlink()
    annotated = np.array([scene.expected_box("A", "R", rock) for rock in BLOCKS])
    yolo.write_boxes(scene.seeds / "03_A_off_30_R_0256.txt", np.array([0, 0]), annotated, size=SIZE)
    found = propagate(scene, tmp_path / "right")
    expected = np.array([scene.expected_box("A", "L", rock) for rock in BLOCKS])
    assert iou(rocks(found, "A_off_30_L_0128"), expected).max(axis=1).min() > 0.85
    table = tables.read_parquet(tmp_path / "right" / "labels.parquet")
    assert set(table["rock"]) == set(BLOCKS)


def test_a_rock_cut_by_the_left_border_is_complete_in_the_right_photo(scene, tmp_path):
    # A block at the right border of the left photo is 150 px further left, and complete, in the right photo.
    for path in scene.meshes.glob("*rock*"):
        path.unlink()
    position = localised("A")
    ray = position.sandbox_from("L").rotate(position.rig.left.directions(np.array([[1925.0, 650.0]])))[0]
    centre = position.sandbox_from("L").translation
    foot = centre - ray * centre[2] / ray[2]
    mesh = block(foot, np.array([0.3, 0.3, 0.16]))
    obj.write_obj(scene.meshes / obj.rock_name(TERRAIN, 4), mesh, "rock4")
    left, right = (position.project(camera, mesh.vertices) for camera in "LR")
    annotated = np.clip([[*left.min(axis=0), *left.max(axis=0)]], 0, [1936, 1216, 1936, 1216])
    assert annotated[0, 2] == 1936
    for path in scene.seeds.iterdir():
        yolo.write_boxes(path, np.array([0]), annotated, size=SIZE)
    (found,) = rocks(propagate(scene, tmp_path / "cut"), "A_off_30_R_0128")
    np.testing.assert_allclose(found, [*right.min(axis=0), *right.max(axis=0)], atol=8)


def test_the_same_input_gives_the_same_bytes(scene, tmp_path):
    for name in ("first", "second"):
        propagate(scene, tmp_path / name)
    for path in (tmp_path / "first").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "second" / path.relative_to(tmp_path / "first")).read_bytes()


def test_a_position_without_a_pose_is_a_warning_and_empty_files(scene, tmp_path, caplog):
    (scene.cameras / "PosC.json").unlink()
    with caplog.at_level(logging.WARNING):
        found = propagate(scene, tmp_path / "gap")
    assert "position C" in caplog.text
    assert len(found[key("C_off_30_L_0128")][0]) == 0


def test_a_bare_terrain_has_no_labels(scene, tmp_path):
    for path in [*scene.seeds.iterdir(), *scene.meshes.glob("*rock*")]:
        path.unlink()
    assert all(len(classes) == 0 for classes, _ in propagate(scene, tmp_path / "bare").values())


def lose_pose(scene, position, off, method=rigs.SURVEYED, **metrics):
    """Write the pose of a position as localised by `method` or by the survey only."""
    lost = localised(position)
    pose = Pose(lost.sandbox_from_left.rotation, lost.sandbox_from_left.translation + off)
    rigs.write_localised(scene.cameras / f"Pos{position}.json", rigs.LocalisedRig(lost.rig, pose, method, metrics))


@pytest.mark.parametrize("method", ["labels", rigs.UNCERTAIN_LABELS, rigs.SURVEYED])
def test_exposures_of_a_seeded_bracket_equal_the_seed_for_any_pose(scene, tmp_path, method):
    lose_pose(scene, "A", np.array([0.3, -0.4, 0.1]), method)
    found = propagate(scene, tmp_path / "lost", [one for one in KEYS if (one.position, one.azimuth) == ("A", "30")])
    _, seed = yolo.read_boxes(scene.seeds / "03_A_off_30_L_0256.txt", size=SIZE)
    for light in ("off", "on"):
        for exposure in (64, 128, 1024, 2048):
            np.testing.assert_array_equal(rocks(found, f"A_{light}_30_L_{exposure:04d}"), seed[: len(BLOCKS)])
        np.testing.assert_array_equal(shadows(found, f"A_{light}_30_L_1024"), seed[len(BLOCKS) :])


@pytest.mark.parametrize("method", [rigs.UNCERTAIN_LABELS, rigs.SURVEYED])
def test_an_unverified_position_copies_rocks_between_azimuths(scene, tmp_path, method):
    (scene.seeds / "03_A_off_180_L_0256.txt").unlink()
    lose_pose(scene, "A", np.array([0.3, -0.4, 0.1]), method)
    found = propagate(scene, tmp_path / "lost", [key("A_off_270_L_0128")])
    _, seed = yolo.read_boxes(scene.seeds / "03_A_off_30_L_0256.txt", size=SIZE)
    np.testing.assert_array_equal(rocks(found, "A_off_270_L_0128"), seed[: len(BLOCKS)])


def test_a_guessed_pose_moves_labels_to_the_other_camera_along_its_epipolar_lines(scene, tmp_path):
    lose_pose(scene, "A", np.zeros(3), rigs.UNCERTAIN_LABELS)
    found = propagate(scene, tmp_path / "lost", [key("A_off_30_R_1024")])
    expected = np.array([scene.expected_box("A", "R", rock) for rock in BLOCKS])
    np.testing.assert_allclose(box_centres(rocks(found, "A_off_30_R_1024")), box_centres(expected), atol=3)
    assert set(tables.read_parquet(tmp_path / "lost" / "labels.parquet")["source"]) == {"translated"}


def test_labels_moved_with_an_unknown_pitch_have_lower_confidence(scene, tmp_path):
    sure = {}
    for name, metrics in {"usual": {rigs.PITCH_SD: 2.6}, "shared": {rigs.PITCH_SD: 0.8}}.items():
        lose_pose(scene, "A", np.zeros(3), **metrics)
        propagate(scene, tmp_path / name, [key("A_off_30_R_1024")])
        sure[name] = tables.read_parquet(tmp_path / name / "labels.parquet")["confidence"].to_numpy()
        assert len(sure[name]) == 2 * len(BLOCKS)
    assert (sure["usual"] < sure["shared"]).all()


def test_an_unlocalised_position_uses_only_its_annotations(untouched_scene, scene, tmp_path, labels):
    lose_pose(scene, "A", np.array([0.3, -0.4, 0.1]))
    found = propagate(scene, tmp_path / "lost")
    for photo in ("A_off_30_L_1024", "A_off_270_L_0128"):  # the camera does not move
        np.testing.assert_allclose(np.sort(rocks(found, photo), 0), np.sort(rocks(labels, photo), 0), atol=1.5)
    assert len(shadows(found, "A_off_270_L_0128")) == 0  # cast shadows are unknown without a pose
    table = tables.read_parquet(tmp_path / "lost" / "labels.parquet")
    assert set(table["source"]) == {"seed", "fused", "translated", "projected", "cast"}
    assert set(table[table["position"] == "A"]["source"]) == {"seed", "fused", "translated"}
    np.testing.assert_array_equal(rocks(found, "C_off_30_L_0128"), rocks(labels, "C_off_30_L_0128"))


def test_a_position_without_pose_and_annotation_has_no_labels(scene, tmp_path):
    lose_pose(scene, "C", np.array([-0.4, 0.3, 0.0]))
    found = propagate(scene, tmp_path / "lost")
    assert not len(found[key("C_off_30_L_0128")][1])
