"""Faults that runs have had, put back in: the run itself must notice, without any truth."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from polarsim.formats import png
from polarsim.geometry.casters import caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, looking
from polarsim.geometry.stereo import stated_rig
from polarsim.photo import BLACK_LEVEL, NO_ROCK, PhotoKey
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.scoring.complaints import complaint, complaints
from polarsim.scoring.consistency import box_overlaps, cameras_together, ground_support, scans_on_meshes
from polarsim.scoring.left_right import boxes_of_both, photos_of_both
from polarsim.scoring.metrics import metrics_table
from polarsim.scoring.score import Labels
from polarsim.scoring.surface import Surface


@pytest.fixture
def scene():
    """Sand with bumps that tell translations along it too."""
    axis = np.linspace(-1.8, 1.8, 121)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis))
    vertices = np.column_stack([x, y, 0.04 * np.sin(5 * x) * np.cos(6 * y)])
    corner = (np.arange(120)[:, None] * 121 + np.arange(120)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 122], corner[:, None] + [0, 122, 121]])
    return TerrainMesh(vertices, faces, np.full(len(faces), NO_ROCK))


@pytest.fixture
def scans(scene, rng):
    """Two scans of the sand, 2 mm of noise."""
    surface, seen = Surface(scene.vertices, scene.faces), {}
    for position in "AC":
        points, face = surface.sample(20_000, rng)
        seen[position] = points + 0.002 * rng.normal(size=(len(points), 1)) * surface.normals[face]
    return seen


def said(metrics):
    return complaints(metrics_table("consistency", 3, metrics))


def rotated(points, degrees, axis, translation_mm=(0, 0, 0)):
    rotvec = np.zeros(3)
    rotvec[axis] = np.radians(degrees)
    return Pose.from_rotvec(rotvec, np.array(translation_mm) / 1000).apply(points)


def test_a_sound_run_has_nothing_to_say(scans, scene):
    assert said(scans_on_meshes(scans, scene)) == []


def test_meshes_in_another_frame_than_the_scans_are_noticed(scans, scene):
    # An ICP after the cameras stage rotated all surfaces by (0.185, 0.084, 0.007) degrees.
    rotated_mesh = TerrainMesh(rotated(scene.vertices, 0.185, 0), scene.faces, scene.rock_of_face)
    (first, *_) = said(scans_on_meshes(scans, rotated_mesh))
    assert first.startswith("Terrain 3: all scans on the meshes: all scans together would have to rotate by 0.1")


def test_scans_that_were_aligned_behind_the_cameras_back_are_noticed(scans, scene):
    # Poses from A to C were written 2.1 mm and 0.035 degrees off; the meshes knew better.
    apart = {"A": rotated(scans["A"], 0.018, 2, (1, 0.3, 0)), "C": rotated(scans["C"], -0.018, 2, (-1, -0.3, 0))}
    assert any(
        "scans A and C" in sentence and "mm otherwise than written" in sentence
        for sentence in said(scans_on_meshes(apart, scene))
    )


def test_a_camera_that_only_the_survey_localises_is_named(world):
    localised = {position: LocalisedRig(stated_rig(), pose, "labels", {}) for position, pose in world.poses.items()}
    localised["C"] = LocalisedRig(stated_rig(), world.poses["C"], "survey", {})
    (sentence,) = said(cameras_together(localised, localised))
    assert sentence.startswith("Terrain 3: camera C: nothing proves the pose of the camera")


def test_cameras_that_photos_rotated_away_from_the_meshes_are_noticed(world):
    before = {position: LocalisedRig(stated_rig(), pose, "scans", {}) for position, pose in world.poses.items()}
    rotation = Pose.from_rotvec(np.radians([0.15, 0.1, 0]), np.zeros(3))
    after = {
        position: LocalisedRig(rig.rig, rotation @ rig.sandbox_from_left, "scans, photos", {})
        for position, rig in before.items()
    }
    (sentence,) = said(cameras_together(before, after))
    assert "rotated together by 0.180 degrees" in sentence


def test_meshes_that_miss_their_boxes_are_noticed():
    matches = pd.DataFrame({"position": list("AAC"), "iou": [0.8, 0.7, 0.4]})
    (sentence,) = said(box_overlaps(matches))
    assert "position C" in sentence
    assert "0.40" in sentence


@pytest.fixture(scope="module")
def wavy():
    """A ground with hills, ready for rays, and the pattern that is painted on it."""
    rng = np.random.default_rng(4)
    axis = np.linspace(-2, 2, 161)
    x, y = np.meshgrid(axis, axis)
    height = 0.3 * gaussian_filter(rng.normal(size=x.shape), 6)
    corner = (np.arange(160)[:, None] * 161 + np.arange(160)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 162], corner[:, None] + [0, 162, 161]])
    return caster(np.stack([x, y, height], -1).reshape(-1, 3), faces), gaussian_filter(rng.normal(size=(1200, 1200)), 3)


@pytest.fixture(scope="module")
def stereo(wavy, tmp_path_factory):
    """A localised rig and its best photos, left and right, under two Sun lamps."""
    rays, pattern = wavy
    folder, pictures = tmp_path_factory.mktemp("stereo"), {}
    for camera in "LR":
        pose, lens = STANDING.sandbox_from(camera), STANDING.rig.lens(camera)
        directions = pose.rotate(lens.pixel_directions()).reshape(-1, 3).astype(np.float32)
        distance, _ = rays.nearest(np.broadcast_to(pose.translation, directions.shape), directions)
        hit = np.isfinite(distance)
        position = (pose.translation + distance[hit, None] * directions[hit])[:, :2]
        grey = np.zeros(len(directions))
        grey[hit] = 1000 + 15000 * map_coordinates(pattern, ((position[:, ::-1] + 2) / 4 * 1199).T, order=1)
        photo = (BLACK_LEVEL + np.clip(grey, 0, 3000)).reshape(lens.shape).astype(np.uint16)
        for azimuth in ("30", "270"):
            path = folder / f"03_A_off_{azimuth}_{camera}_0256.png"
            png.write(path, photo)
            pictures.setdefault(("A", camera), {})[azimuth] = path
    return rays, pictures


STANDING = LocalisedRig(stated_rig(), looking(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(27)), "scans, photos", {})


def rotated_right(rig, degrees):
    rotation = Pose.from_rotvec(np.radians(degrees), np.zeros(3))
    return replace(rig, rig=replace(rig.rig, left_from_right=rig.rig.left_from_right @ rotation))


def test_photos_of_one_rig_have_nothing_to_say(stereo):
    metrics = photos_of_both({"A": STANDING}, *stereo)
    assert said(metrics) == []
    known = {metric.metric: metric.value for metric in metrics}
    assert known["windows_found"] > 0.8
    assert known["across_rows"] < 0.1
    assert known["across_rows_spread"] < 0.3


def test_a_right_camera_that_is_rotated_about_x_is_noticed(stereo):
    (sentence,) = said(photos_of_both({"A": rotated_right(STANDING, [0.1, 0, 0])}, *stereo))
    assert "left and right photos, position A: the right photos lie 3.6 px beside the rows" in sentence


def test_a_right_camera_that_is_rotated_about_its_view_is_noticed(stereo):
    (sentence,) = said(photos_of_both({"A": rotated_right(STANDING, [0, 0, 0.3])}, *stereo))
    assert "the right photos' rows stray by" in sentence


def test_exchanged_photos_are_noticed(stereo):
    rays, pictures = stereo
    swapped = {("A", camera): pictures["A", other] for camera, other in ("LR", "RL")}
    sentences = said(photos_of_both({"A": STANDING}, rays, swapped))
    assert any("are these one rig's?" in sentence for sentence in sentences)


def test_positions_without_photos_of_both_cameras_say_nothing(stereo):
    rays, pictures = stereo
    assert photos_of_both({"A": STANDING}, rays, {("A", "L"): pictures["A", "L"]}) == []
    assert photos_of_both({"A": replace(STANDING, method="survey")}, rays, pictures) == []


@pytest.fixture
def rocky(rng):
    """Outlines of a dozen rocks, and boxes that people drew of them in both cameras, edges 2 px off."""
    points = [
        np.array([x, y, 0.06]) + rng.uniform(-0.5, 0.5, (80, 3)) * [size, size, 0.12]
        for x, y, size in rng.uniform((-1.2, -1.2, 0.12), (1.2, 1.2, 0.3), (12, 3))
    ]
    outlines = Outlines(np.arange(1, 13), np.array(points), np.array(points))
    annotated = {}
    for camera in "LR":
        boxes = outlines.seen(STANDING.camera(camera))
        for azimuth in ("30", "180", "270"):
            shown = np.round(boxes + rng.normal(0, 2, boxes.shape))
            annotated[PhotoKey(3, "A", "off", azimuth, camera, 256)] = Labels(np.zeros(len(boxes), int), shown)
    return outlines, annotated


def test_boxes_of_both_cameras_on_their_meshes_have_nothing_to_say(rocky):
    metrics = boxes_of_both({"A": STANDING}, *rocky)
    assert {metric.metric for metric in metrics} == {"iou_lost", "boxes_across_rows"}
    assert said(metrics) == []


def test_boxes_tell_of_a_right_camera_that_is_rotated(rocky):
    (sentence,) = said(boxes_of_both({"A": rotated_right(STANDING, [0.1, 0, 0])}, *rocky))
    assert "left and right boxes, position A: boxes of the right camera lie" in sentence


def test_boxes_tell_of_cameras_that_were_exchanged(rocky):
    outlines, annotated = rocky
    swapped = {replace(key, camera={"L": "R", "R": "L"}[key.camera]): boxes for key, boxes in annotated.items()}
    seen_left = replace(STANDING, sandbox_from_left=STANDING.sandbox_from("R"))  # as localised by what is called left
    (sentence, *_) = said(boxes_of_both({"A": seen_left}, outlines, swapped))
    assert "of IoU worse than the left one's" in sentence


def test_few_boxes_of_a_camera_say_nothing(rocky):
    outlines, annotated = rocky
    assert boxes_of_both({"A": STANDING}, outlines, {k: v for k, v in annotated.items() if k.camera == "L"}) == []


def test_a_fitted_ground_that_does_not_support_its_rocks_is_reported():
    side = np.array([-2.0, 2.0])
    corners = np.array([[x, y, 0.0] for y in side for x in side])
    ground = Mesh(corners, np.array([[0, 1, 3], [0, 3, 2]]))
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    foot = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), np.zeros(24)], axis=1)
    places = [np.array([x, y, 0.0]) for x in (-1.2, 0.0, 1.2) for y in (-1.2, 0.0, 1.2)]
    for lifted, complained in ((0, []), (3, ["feet_off"])):
        rims = [foot + place + [0, 0, 0.03 * (number < lifted)] for number, place in enumerate(places)]
        metrics = {one.metric: one for one in ground_support(ground, rims, 1.7)}
        assert metrics["feet_off"].value == pytest.approx(lifted / 9)
        assert [one.metric for one in metrics.values() if complaint(one.subject, one.metric, one.value)] == complained
    one = {metric.metric: metric.value for metric in ground_support(ground, [foot], 1.7)}
    assert one["far_from_feet"] == pytest.approx(1 - np.pi * 0.6**2 / 3.4**2, abs=0.02)
    (bare,) = ground_support(ground, [], 1.7)
    assert (bare.metric, bare.value) == ("far_from_feet", 1.0)
