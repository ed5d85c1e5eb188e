"""Stereo depth of a textured ground with a box, in ray-cast images of a rig."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.detect.options import ComparisonOptions, StereoOptions
from polarsim.detect.stereo import truth as truth_module
from polarsim.detect.stereo.match import match_stereo
from polarsim.detect.stereo.measure import compare_stereo, measure_stereo
from polarsim.detect.stereo.rectify import rectify
from polarsim.detect.stereo.truth import DepthTruth, depth_range, depth_truth, rock_performance, score_depth
from polarsim.errors import DetectError
from polarsim.formats import obj, png, tables
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import NO_ROCK, PhotoKey
from polarsim.report.stereo_table import tabulate_stereo
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.run_files.scene import TerrainMesh, read_terrain
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import SANDBOX

SCALE = 0.25
OPTIONS = StereoOptions(scale=SCALE, exposures_ms=(256,))
RIG = default_rig()
LOCALISED = LocalisedRig(RIG, camera_pose(np.array([-3.2, 0.0, 1.5]), 0.0, np.radians(26)))
GROUND = Mesh(np.array([[-9.0, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
BOX = Mesh(
    np.array([[x, y, z] for x in (0.0, 0.5) for y in (-0.3, 0.3) for z in (-0.1, 0.4)]),
    np.array(
        [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [1, 5, 7], [1, 7, 3]]
    ),
)


@pytest.fixture(scope="module")
def meshes(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    obj.write_obj(folder / "terrain01_ground.obj", GROUND, "ground")
    obj.write_obj(folder / "terrain01_rock7.obj", BOX, "rock7")
    return folder


def grey(points: np.ndarray) -> np.ndarray:
    """Return the texture at points of the sandbox: waves of 3 to 30 cm in many directions."""
    random = np.random.default_rng(0)
    waves = random.normal(0, 1, (40, 3))
    waves *= (2 * np.pi / random.uniform(0.03, 0.3, 40) / np.linalg.norm(waves, axis=1))[:, None]
    return np.sin(points @ waves.T + random.uniform(0, 7, 40)).sum(axis=1)


def picture(mesh: TerrainMesh, camera: str) -> np.ndarray:
    """Render the scene (h, w) uint8 at a quarter of the size of a photo."""
    lens, pose = RIG.lens(camera).scaled(SCALE), LOCALISED.sandbox_from(camera)
    directions = pose.rotate(lens.pixel_directions().reshape(-1, 3))
    origins = np.broadcast_to(pose.translation, directions.shape)
    distance, _ = make_caster(mesh.vertices, mesh.faces).nearest(origins, directions)
    distance = np.where(np.isfinite(distance), distance, 50)
    value = grey(origins + distance[:, None] * directions)
    return np.clip(128 + 18 * value, 1, 255).astype(np.uint8).reshape(lens.shape)


@pytest.fixture(scope="module")
def scene(meshes):
    """Mesh, rectification, reference depth, left and right image."""
    mesh = read_terrain(meshes, 1, SANDBOX)
    rig = rectify(RIG, SCALE)
    truth = depth_truth(mesh, make_caster(mesh.vertices, mesh.faces), LOCALISED, rig)
    return mesh, rig, truth, picture(mesh, "L"), picture(mesh, "R")


@given(st.floats(-1, 1), st.floats(-0.6, 0.6), st.floats(1.5, 9))
def test_rectified_points_have_equal_rows_and_the_expected_disparity(x, y, z):
    rig = rectify(RIG, SCALE)
    position = np.array([x * z * 0.4, y * z * 0.4, z])  # frame of the rectified left camera
    left = rig.lens.project(position)
    right = rig.lens.project(position - [rig.baseline, 0, 0])
    assert left[1] == pytest.approx(right[1], abs=1e-9)
    assert left[0] - right[0] == pytest.approx(float(rig.disparity(z)), rel=1e-9)
    # The maps from rectified to original pixels agree with the lens model.
    column, row = np.floor(left).astype(int)
    if 0 <= column < rig.lens.width and 0 <= row < rig.lens.height:
        direction = rig.left_from_rectified.rotate(rig.lens.directions(np.array([column + 0.5, row + 0.5])))
        taken = RIG.left.scaled(SCALE).project(direction) - 0.5  # OpenCV counts from the first pixel's centre
        np.testing.assert_allclose([rig.left_maps[0][row, column], rig.left_maps[1][row, column]], taken, atol=2e-3)


def test_a_rig_with_exchanged_cameras_is_an_error():
    with pytest.raises(DetectError):
        rectify(StereoRig(RIG.right, RIG.left, RIG.left_from_right.inverse()), SCALE)


def test_the_reference_depth_of_plane_box_and_occlusion(scene):
    _, rig, truth, *_ = scene
    sandbox_from_rectified = LOCALISED.sandbox_from_left @ rig.left_from_rectified
    directions = sandbox_from_rectified.rotate(rig.lens.pixel_directions())
    ground = (truth.rock == NO_ROCK) & np.isfinite(truth.depth)
    heights = sandbox_from_rectified.translation[2] + truth.depth[ground] * directions[ground][:, 2]
    np.testing.assert_allclose(heights, 0, atol=1e-4)
    assert set(np.unique(truth.rock)) == {NO_ROCK, 7}
    rows, columns = np.nonzero(truth.rock == 7)
    centre = int(np.median(rows))
    hidden = ~truth.shared[centre] & np.isfinite(truth.depth[centre])
    left_of_box = columns[rows == centre].min()
    assert hidden[left_of_box - 8 : left_of_box - 1].any()  # occluded by the left edge of the box in the right image
    assert truth.shared[rows, columns].mean() > 0.8


def test_depth_of_a_textured_scene_is_right_and_without_bias(scene):
    _, rig, truth, left, right = scene
    depth = match_stereo(left, right, rig, 1.5, 12)
    asked = truth.shared & (truth.depth < 6)
    error = (rig.disparity(depth) - rig.disparity(truth.depth))[asked]
    assert np.isfinite(error).mean() > 0.9
    assert np.nanmedian(np.abs(error)) < 0.15  # px at width 484; measured 0.1
    assert abs(np.nanmedian(error)) < 0.06  # measured 0.03; 0.25 with the default five directions
    assert np.nanmean(np.abs(depth - truth.depth)[asked] > 0.03 * truth.depth[asked]) < 0.2


def test_depths_of_a_smaller_sandbox_are_evaluated(scene):
    """Cameras and meshes of a quarter of the size have the same images."""
    _, rig, truth, left, right = scene
    small = replace(truth, depth=truth.depth / 4)
    assert depth_range(truth) == (1.5, 9.0)
    nearest, farthest = depth_range(small)
    assert (nearest, farthest) == (pytest.approx(np.nanmin(truth.depth) / 4), 9.0)
    expected = score_depth(match_stereo(left, right, rig, *depth_range(truth)), truth)
    found = score_depth(match_stereo(left, right, replace(rig, baseline=rig.baseline / 4), nearest, farthest), small)
    assert expected["pixels"] > 30_000
    assert found["pixels"] == expected["pixels"]
    assert found["valid_share"] == pytest.approx(expected["valid_share"], abs=0.01)
    assert found["median_abs_error_mm"] == pytest.approx(expected["median_abs_error_mm"] / 4, rel=0.05)


def test_a_missing_depth_is_bad_and_hidden_pixels_are_ignored(monkeypatch):
    monkeypatch.setattr(truth_module, "BAD_DEPTH_PERCENT", 2)
    monkeypatch.setattr(truth_module, "MIN_ROCK_PX", 3)
    truth = DepthTruth(
        np.array([[2.0, 2, 2, 2, np.nan, 2]]),
        np.array([[7, 7, 7, NO_ROCK, NO_ROCK, 7]]),
        np.array([[True, True, True, True, False, False]]),
    )
    depth = np.array([[2.01, 2.05, np.nan, 1.97, 1, 9]])
    depth_metrics = score_depth(depth, truth)
    assert depth_metrics["pixels"] == 4
    assert depth_metrics["valid_share"] == 0.75
    assert depth_metrics["median_abs_error_mm"] == pytest.approx(30)
    assert depth_metrics["bad_share"] == 0.75
    assert depth_metrics["bad_relative_share"] == 0.5
    assert rock_performance(depth, truth) == [{"rock": 7, "pixels": 3, "performance": pytest.approx(1 / 3)}]
    monkeypatch.setattr(truth_module, "MIN_ROCK_PX", 4)
    assert rock_performance(depth, truth) == []


def test_a_domain_and_its_copy_have_equal_metrics(scene, meshes, tmp_path):
    import cv2

    *_, left, right = scene
    write_localised(tmp_path / "PosA.json", LOCALISED)
    rows = []
    for camera, pixels in (("L", left), ("R", right)):
        for exposure in (64, 256):
            key = PhotoKey(1, "A", "off", "30", camera, exposure)
            photo = np.clip(cv2.resize(pixels.astype(np.float32), (1936, 1216)) * exposure / 64, 0, 4079) + 16
            path = tmp_path / "twins" / "Terrain01" / f"{key}.png"
            png.write_png(path, photo.astype(np.uint16))
            rows.append(tables.key_columns(key) | {"path": str(path)})
    tables.write_parquet(tmp_path / "photos.parquet", pd.DataFrame(rows))
    alone = PhotoKey(1, "A", "off", "180", "L", 256)
    pairs, rocks_of_pairs, stereo, instances, ipd = (
        tmp_path / f"{name}.parquet" for name in ("pairs", "rocks", "stereo", "instances", "ipd")
    )
    measure_stereo(
        site=polar(),
        terrain=1, keys=[PhotoKey.parse(row["key"]) for row in rows] + [alone], cameras=tmp_path, meshes=meshes,
        pictures={"analog": tmp_path / "photos.parquet", "hapke": tmp_path / "twins"},
        pairs=pairs, rocks=rocks_of_pairs, options=OPTIONS, threads=1,
    )  # fmt: skip
    compare_stereo(
        pairs=[pairs], rocks=[rocks_of_pairs], stereo=stereo, instances=instances, ipd=ipd, options=ComparisonOptions()
    )
    table = tables.read_parquet(stereo)
    assert table["domain"].tolist() == ["analog", "hapke"]  # of two exposures, one is in the options
    assert (table["valid_share"] > 0.8).all()
    assert (table["median_abs_error_mm"] < 60).all()  # half a pixel at 4 m is 50 mm at this size
    difference = tables.read_parquet(ipd)
    assert difference[["pairs", "ipd", "ipd_abs"]].to_numpy().tolist() == [[1, 0, 0]]
    origin = {"run": "demo", "source": "analog", "config": "0"}
    tabulate_stereo(stereo=stereo, instances=instances, ipd=ipd, stem=tmp_path / "stereo_table", origin=origin)
    table = tables.read_parquet(tmp_path / "stereo_table.parquet")
    assert table["terrain"].tolist() == ["all", "01"] * 2
    assert table["pairs"].tolist() == [1] * 4
    assert "| Analog - Hapke | 1 | 0.000 | 0.000 |" in (tmp_path / "stereo_table.md").read_text()


def test_a_terrain_without_a_pair_is_an_error(meshes, tmp_path):
    write_localised(tmp_path / "PosA.json", LOCALISED)
    tables.write_parquet(tmp_path / "photos.parquet", pd.DataFrame({"key": ["x"], "path": ["y"]}))
    with pytest.raises(DetectError):
        measure_stereo(
        site=polar(),
            terrain=1, keys=[PhotoKey(1, "A", "off", "30", "L", 256)], cameras=tmp_path, meshes=meshes,
            pictures={"analog": tmp_path / "photos.parquet"}, pairs=tmp_path / "pairs.parquet",
            rocks=tmp_path / "rocks.parquet", options=OPTIONS, threads=1,
        )  # fmt: skip


def test_nothing_is_matched_outside_the_right_image(scene):
    """With black pixels at the border, as in shadow, the replicated border would match everything."""
    _, rig, _, left, right = scene
    left, right = left.copy(), right.copy()
    left[:, :60], right[:, :20] = 1, 1
    left[40:60, 5:30] = 90
    right[:, 0] = 90
    depth = match_stereo(left, right, rig, 1.5, 12)
    row, column = np.nonzero(np.isfinite(depth))
    assert len(row)
    assert (rig.disparity(depth[row, column]) <= column + 1e-3).all()
