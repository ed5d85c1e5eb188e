"""Faults of earlier runs exceed the limits of consistency metrics, without ground truth."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates

from polarsim.formats import png
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.photo import BLACK_LEVEL, NO_ROCK, REFERENCE_WIDTH_PX, PhotoKey
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scene import TerrainMesh
from polarsim.run_files.wall_edges import EdgeSamples
from polarsim.scoring.consistency import box_overlaps, cameras_together, ground_support, scans_on_meshes
from polarsim.scoring.consistency_warnings import LIMITS, metric_warning, warnings_of
from polarsim.scoring.left_right import boxes_of_both, photos_of_both
from polarsim.scoring.metrics import Metric, metrics_table
from polarsim.scoring.score import PhotoLabels
from polarsim.scoring.surface import Surface
from polarsim.scoring.wall_shadows import wall_shadow_metrics
from tests.support.polar_rig import default_rig


@pytest.fixture
def scene():
    """Sand with bumps, which make horizontal translations observable."""
    axis = np.linspace(-1.8, 1.8, 121)
    x, y = (values.ravel() for values in np.meshgrid(axis, axis))
    vertices = np.column_stack([x, y, 0.04 * np.sin(5 * x) * np.cos(6 * y)])
    corner = (np.arange(120)[:, None] * 121 + np.arange(120)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 122], corner[:, None] + [0, 122, 121]])
    return TerrainMesh(vertices, faces, np.full(len(faces), NO_ROCK))


@pytest.fixture
def scans(scene, rng):
    """Two scans of the sand with 2 mm of noise."""
    surface, scans = Surface(scene.vertices, scene.faces), {}
    for position in "AC":
        points, face = surface.sample(10_000, rng)
        scans[position] = points + 0.002 * rng.normal(size=(len(points), 1)) * surface.normals[face]
    return scans


def exceeded(metrics, photo_width=REFERENCE_WIDTH_PX):
    """Return subject and name of the metrics that exceed their limits in photos of a width."""
    return {(metric.subject, metric.metric) for metric in metrics if metric_warning(metric, photo_width)}


def rotated(points, degrees, axis, translation_mm=(0, 0, 0)):
    rotvec = np.zeros(3)
    rotvec[axis] = np.radians(degrees)
    return Pose.from_rotvec(rotvec, np.array(translation_mm) / 1000).apply(points)


def test_a_consistent_run_exceeds_no_limit(scans, scene):
    assert exceeded(scans_on_meshes(scans, scene)) == set()


def test_every_metric_above_the_limit_has_a_warning_with_terrain_and_subject():
    metrics = [Metric("scan A", name, 100.0 if limit.above else -1.0, "1", 1, "own") for name, limit in LIMITS.items()]
    sentences = warnings_of(metrics_table("consistency", 3, metrics), REFERENCE_WIDTH_PX)
    assert len(sentences) == len(LIMITS)
    assert all(sentence.startswith("Terrain 3: scan A: ") for sentence in sentences)


def test_meshes_that_are_rotated_against_the_scans_are_reported(scans, scene):
    # An ICP after the cameras stage rotated all surfaces by (0.185, 0.084, 0.007) degrees.
    rotated_mesh = TerrainMesh(rotated(scene.vertices, 0.185, 0), scene.faces, scene.rock_of_face)
    metrics = scans_on_meshes(scans, rotated_mesh)
    assert ("all scans on the meshes", "common_rotation") in exceeded(metrics)
    assert metrics[0].value == pytest.approx(0.185, abs=0.02)


def test_scans_that_were_aligned_after_the_poses_were_written_are_reported(scans, scene):
    # Written poses from A to C had errors of 2.1 mm and 0.035 degrees, unlike the meshes.
    apart = {"A": rotated(scans["A"], 0.018, 2, (1, 0.3, 0)), "C": rotated(scans["C"], -0.018, 2, (-1, -0.3, 0))}
    assert ("scans A and C", "translation_between") in exceeded(scans_on_meshes(apart, scene))


def test_a_camera_that_only_the_survey_localises_is_reported(world):
    localised = {position: LocalisedRig(default_rig(), pose, "labels", {}) for position, pose in world.poses.items()}
    localised["C"] = LocalisedRig(default_rig(), world.poses["C"], "survey", {})
    assert exceeded(cameras_together(localised, localised)) == {("camera C", "surveyed")}


def test_a_common_rotation_of_cameras_since_the_meshes_is_reported(world):
    before = {position: LocalisedRig(default_rig(), pose, "scans", {}) for position, pose in world.poses.items()}
    rotation = Pose.from_rotvec(np.radians([0.15, 0.1, 0]), np.zeros(3))
    after = {
        position: LocalisedRig(rig.rig, rotation @ rig.sandbox_from_left, "scans, photos", {})
        for position, rig in before.items()
    }
    metrics = cameras_together(before, after)
    assert exceeded(metrics) == {("cameras since the meshes", "cameras_rotation")}
    assert metrics[-1].value == pytest.approx(0.180, abs=0.001)


def test_meshes_that_miss_their_boxes_are_reported():
    matches = pd.DataFrame({"position": list("AAC"), "iou": [0.8, 0.7, 0.4]})
    assert exceeded(box_overlaps(matches)) == {("meshes on boxes, position C", "boxes_iou")}


@pytest.fixture(scope="module")
def wavy():
    """Ray caster of a ground with hills, and the texture of the ground."""
    rng = np.random.default_rng(4)
    axis = np.linspace(-2, 2, 161)
    x, y = np.meshgrid(axis, axis)
    height = 0.3 * gaussian_filter(rng.normal(size=x.shape), 6)
    corner = (np.arange(160)[:, None] * 161 + np.arange(160)).ravel()
    faces = np.concatenate([corner[:, None] + [0, 1, 162], corner[:, None] + [0, 162, 161]])
    return make_caster(np.stack([x, y, height], -1).reshape(-1, 3), faces), gaussian_filter(
        rng.normal(size=(1200, 1200)), 3
    )


STANDING = LocalisedRig(
    default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(27)), "scans, photos", {}
)


def scaled(localised, scale):
    """Return a localised rig whose photos have a scale."""
    rig = localised.rig
    return replace(localised, rig=replace(rig, left=rig.left.scaled(scale), right=rig.right.scaled(scale)))


def stereo_photos(wavy, standing, folder):
    """Return the ray caster and the left and right photos of a localised rig under two Sun lamps."""
    rays, pattern = wavy
    pictures = {}
    for camera in "LR":
        pose, lens = standing.sandbox_from(camera), standing.rig.lens(camera)
        directions = pose.rotate(lens.pixel_directions()).reshape(-1, 3).astype(np.float32)
        distance, _ = rays.nearest(np.broadcast_to(pose.translation, directions.shape), directions)
        hit = np.isfinite(distance)
        position = (pose.translation + distance[hit, None] * directions[hit])[:, :2]
        grey = np.zeros(len(directions))
        grey[hit] = 1000 + 15000 * map_coordinates(pattern, ((position[:, ::-1] + 2) / 4 * 1199).T, order=1)
        photo = (BLACK_LEVEL + np.clip(grey, 0, 3000)).reshape(lens.shape).astype(np.uint16)
        for azimuth in ("30", "270"):
            path = folder / f"03_A_off_{azimuth}_{camera}_0256.png"
            png.write_png(path, photo)
            pictures.setdefault(("A", camera), {})[azimuth] = path
    return rays, pictures


@pytest.fixture(scope="module")
def stereo(wavy, tmp_path_factory):
    return stereo_photos(wavy, STANDING, tmp_path_factory.mktemp("stereo"))


def rotated_right(rig, degrees):
    rotation = Pose.from_rotvec(np.radians(degrees), np.zeros(3))
    return replace(rig, rig=replace(rig.rig, left_from_right=rig.rig.left_from_right @ rotation))


@pytest.mark.slow
def test_photos_of_a_correct_rig_exceed_no_limit(stereo):
    metrics = photos_of_both({"A": STANDING}, *stereo)
    assert exceeded(metrics) == set()
    value_of = {metric.metric: metric.value for metric in metrics}
    assert value_of["windows_found"] > 0.8
    assert value_of["across_rows"] < 0.1
    assert value_of["across_rows_spread"] < 0.3


@pytest.mark.parametrize(
    ("rotation_deg", "metric"), [([0.1, 0, 0], "across_rows"), ([0, 0, 0.3], "across_rows_spread")]
)
def test_a_rotated_right_camera_is_reported(stereo, rotation_deg, metric):
    metrics = photos_of_both({"A": rotated_right(STANDING, rotation_deg)}, *stereo)
    assert exceeded(metrics) == {("left and right photos, position A", metric)}
    if metric == "across_rows":
        assert metrics[1].value == pytest.approx(3.6, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.4, 0.7, 1.3])
@pytest.mark.parametrize(("pitch_deg", "reported"), [(0.02, False), (0.07, True)])  # 0.7 and 2.5 px of reference photos
def test_the_same_errors_of_the_rig_are_reported_in_photos_of_any_width(wavy, tmp_path, scale, pitch_deg, reported):
    standing = scaled(STANDING, scale)
    stereo = stereo_photos(wavy, standing, tmp_path)
    found = exceeded(
        photos_of_both({"A": rotated_right(standing, [pitch_deg, 0, 0])}, *stereo), standing.rig.left.width
    )
    assert found == ({("left and right photos, position A", "across_rows")} if reported else set())


@pytest.mark.parametrize("width", [612, 968, REFERENCE_WIDTH_PX, 2448, 4096])
@pytest.mark.parametrize("name", LIMITS)
def test_limits_in_pixels_follow_the_width_of_photos_and_others_do_not(name, width):
    limit, lengths = LIMITS[name], name in ("across_rows", "across_rows_spread", "boxes_across_rows")
    value = limit.value * (width / 1936 if lengths else 1)
    warned = [
        bool(metric_warning(Metric("scan A", name, share * value, "px" if lengths else "1", 1, "own"), width))
        for share in (0.99, 1.01)
    ]
    assert warned == ([False, True] if limit.above else [True, False])


def test_exchanged_photos_are_reported(stereo):
    rays, pictures = stereo
    swapped = {("A", camera): pictures["A", other] for camera, other in ("LR", "RL")}
    assert ("left and right photos, position A", "windows_found") in exceeded(
        photos_of_both({"A": STANDING}, rays, swapped)
    )


def test_positions_without_photos_of_both_cameras_have_no_metrics(stereo):
    rays, pictures = stereo
    assert photos_of_both({"A": STANDING}, rays, {("A", "L"): pictures["A", "L"]}) == []
    assert photos_of_both({"A": replace(STANDING, method="survey")}, rays, pictures) == []


@pytest.fixture
def rocky(rng):
    """Outlines of 12 rocks, and annotated boxes in both cameras with errors of 2 px."""
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
            annotated[PhotoKey(3, "A", "off", azimuth, camera, 256)] = PhotoLabels(np.zeros(len(boxes), int), shown)
    return outlines, annotated


def test_boxes_of_both_cameras_on_their_meshes_exceed_no_limit(rocky):
    metrics = boxes_of_both({"A": STANDING}, *rocky)
    assert {metric.metric for metric in metrics} == {"iou_lost", "boxes_across_rows"}
    assert exceeded(metrics) == set()


def test_a_rotated_right_camera_is_reported_by_boxes(rocky):
    metrics = boxes_of_both({"A": rotated_right(STANDING, [0.1, 0, 0])}, *rocky)
    assert exceeded(metrics) == {("left and right boxes, position A", "boxes_across_rows")}


def test_exchanged_cameras_are_reported_by_boxes(rocky):
    outlines, annotated = rocky
    swapped = {replace(key, camera={"L": "R", "R": "L"}[key.camera]): boxes for key, boxes in annotated.items()}
    localised = replace(STANDING, sandbox_from_left=STANDING.sandbox_from("R"))  # localised by the exchanged boxes
    metrics = boxes_of_both({"A": localised}, outlines, swapped)
    assert ("left and right boxes, position A", "iou_lost") in exceeded(metrics)


def test_few_boxes_of_a_camera_have_no_metrics(rocky):
    outlines, annotated = rocky
    assert boxes_of_both({"A": STANDING}, outlines, {k: v for k, v in annotated.items() if k.camera == "L"}) == []


def test_a_fitted_ground_that_does_not_support_its_rocks_is_reported():
    side = np.array([-2.0, 2.0])
    corners = np.array([[x, y, 0.0] for y in side for x in side])
    ground = Mesh(corners, np.array([[0, 1, 3], [0, 3, 2]]))
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    foot = np.stack([0.1 * np.cos(angle), 0.1 * np.sin(angle), np.zeros(24)], axis=1)
    places = [np.array([x, y, 0.0]) for x in (-1.2, 0.0, 1.2) for y in (-1.2, 0.0, 1.2)]
    for lifted, reported in ((0, set()), (3, {("fitted ground", "feet_off")})):
        rims = [foot + place + [0, 0, 0.03 * (number < lifted)] for number, place in enumerate(places)]
        metrics = ground_support(ground, rims, np.full(2, 1.7))
        assert {metric.metric: metric.value for metric in metrics}["feet_off"] == pytest.approx(lifted / 9)
        assert exceeded(metrics) == reported
    single_rock = {metric.metric: metric.value for metric in ground_support(ground, [foot], np.full(2, 1.7))}
    assert single_rock["far_from_feet"] == pytest.approx(1 - np.pi * 0.6**2 / 3.4**2, abs=0.02)
    for beyond_m, share in ((1.95, 0), (2.05, 1)):  # less and more than half of the foot is outside the ground
        at_edge = ground_support(ground, [foot + np.array([beyond_m, 0, 0])], np.full(2, 1.7))
        assert {metric.metric: metric.value for metric in at_edge}["feet_off"] == share
    (bare,) = ground_support(ground, [], np.full(2, 1.7))
    assert (bare.metric, bare.value) == ("far_from_feet", 1.0)


def test_shadow_edges_of_walls_are_summarised_by_median_and_sun():
    def samples(offsets_m):
        count = len(offsets_m)
        offset = np.array(offsets_m, float)
        return EdgeSamples(np.zeros(count, int), np.zeros((count, 3)), offset, 100 * np.abs(offset))

    few, none = samples([0.1]), samples([])
    edges = {"30": samples([0.1, -0.2, 0.3] * 4), "180": samples([-0.01] * 10), "270": none, "350": few}
    metrics = wall_shadow_metrics(edges)
    values = {(m.subject, m.metric): (m.value, m.unit, m.n) for m in metrics}
    subject = "shadow edges of walls"
    assert values[subject, "edge_mm_median"] == (pytest.approx(100), "mm", 23)
    assert values[subject, "edge_px_median"] == (pytest.approx(10), "px", 23)
    assert values[f"Sun 30, {subject}", "edge_mm_median"] == (pytest.approx(200), "mm", 12)
    assert values[f"Sun 180, {subject}", "edge_mm_median"] == (pytest.approx(10), "mm", 10)
    assert not any("270" in of or "350" in of for of, _ in values)
    assert exceeded(metrics) == {(subject, "edge_mm_median"), (f"Sun 30, {subject}", "edge_mm_median")}
    assert wall_shadow_metrics({"30": samples([])}) == []
