"""Range maps from stereo photos: a textured height field with known shape, calibration and poses."""

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import ndimage

from polarsim.acquire.index import photo_table
from polarsim.cameras import range_maps
from polarsim.cameras.crossings import Ortho, common_spacing, match_orthophotos, point_spacing
from polarsim.cameras.disparities import FULL, HALF, RangePoints, StereoPhotos, _without_speckles, measure_points
from polarsim.cameras.range_maps import measure_ranges, possible_matches
from polarsim.cameras.self_calibration import Crossing, StereoPixels, correct_calibration, triangulated
from polarsim.errors import ReconstructionError
from polarsim.formats import png, tables
from polarsim.geometry.poses import Pose, angle_between
from polarsim.geometry.stereo import StereoRig
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import write_rig
from polarsim.site import polar
from tests.relief.scenes import LENS, camera, photograph, relief, texture
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import AREA

RIG = StereoRig(LENS, LENS, Pose(np.eye(3), np.array([0.3, 0.0, 0.0])))
TRUE = default_rig()


def pair(seeds, right_seeds=None):
    """Return photos from A, one for each texture: as many lamps."""
    sides = ((camera("A", "L"), seeds), (camera("A", "R"), right_seeds or seeds))
    return StereoPhotos(*([photograph(at, relief, texture(seed)) for seed in chosen] for at, chosen in sides))


def height_errors(points_left):
    """Return the errors (n,) of the points near the centre of the sandbox, metres."""
    points = camera("A", "L").world_from_camera.apply(points_left[np.isfinite(points_left[..., 2])])
    near = (np.abs(points[:, :2]) < 0.7).all(axis=1)
    return (points[:, 2] - relief(points[:, 0], points[:, 1]))[near]


def test_two_lamps_measure_the_ground():
    points = measure_points(pair((0, 1)), RIG, [HALF, FULL], AREA.depths).points_left
    errors = height_errors(points)
    assert np.isfinite(points[..., 2]).mean() > 0.3  # the ground fills a part of the photo
    pixel = 0.027  # metres of height for a pixel of disparity, at 3 m with this lens
    assert np.median(np.abs(errors)) < 0.2 * pixel
    assert abs(np.median(errors)) < 0.05 * pixel


def test_brightness_and_slow_light_of_a_photo_do_not_matter():
    photos = pair((0,))
    falloff = np.linspace(1, 3, LENS.width, dtype=np.float32)
    changed = StereoPhotos(photos.left, [picture * falloff for picture in photos.right])
    first, second = (measure_points(one, RIG, [HALF], AREA.depths).points_left[..., 2] for one in (photos, changed))
    both = np.isfinite(first) & np.isfinite(second)
    assert both.sum() > 0.9 * np.isfinite(first).sum()
    assert np.median(np.abs(first - second)[both]) < 0.002


def before_a_wall(far, near, seeds):
    """Return photos of a bright square with much contrast at a depth, before a wall with little, and its edge, px."""
    left, right = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        wall, square = (
            ndimage.gaussian_filter(rng.normal(size=(LENS.height, LENS.width)), 1.0, mode="wrap") for _ in range(2)
        )
        wall, square = 100 + 10 * wall / wall.std(), 200 + 50 * square / square.std()
        mask = np.zeros(wall.shape, bool)
        mask[100:180, 200:280] = True
        left.append(np.where(mask, square, wall).astype(np.float32))
        shift = [round(LENS.fx * 0.3 / depth) for depth in (far, near)]
        moved = np.where(np.roll(mask, -shift[1], 1), np.roll(square, -shift[1], 1), np.roll(wall, -shift[0], 1))
        right.append(moved.astype(np.float32))
    return StereoPhotos(left, right), 280


def test_foreground_does_not_extend_over_the_background():
    far, near = 3.03, 2.4145  # 51 and 64 px
    photos, edge = before_a_wall(far, near, (0, 1))
    depth = measure_points(photos, RIG, [HALF, FULL], AREA.depths).points_left[110:170, :, 2]
    beside, inside = depth[:, edge + 2 : edge + 10], depth[:, edge - 10 : edge - 2]
    assert np.isfinite(beside).mean() > 0.6
    assert np.nanmean(beside < (far + near) / 2) < 0.1
    assert np.isfinite(inside).mean() > 0.6
    assert np.nanmean(inside < (far + near) / 2) > 0.95


def test_small_separate_areas_are_not_measured():
    disparity = np.full((100, 120), 50.0) + 0.2 * np.arange(100)[:, None]  # a slope is no step
    known = np.ones(disparity.shape, bool)
    disparity[20:30, 20:30] += 8
    disparity[50:80, 50:80] += 8
    kept = _without_speckles(disparity, known, 1.0)
    assert not kept[20:30, 20:30].any()
    known[20:30, 20:30] = False
    np.testing.assert_array_equal(kept, known)


def test_photos_of_different_scenes_match_at_fewer_pixels():
    photos = (pair((0, 1), right) for right in (None, (5, 6)))
    same, other = (measure_points(of, RIG, [HALF], AREA.depths).points_left for of in photos)
    assert np.isfinite(other[..., 2]).mean() < 0.3 * np.isfinite(same[..., 2]).mean()


def test_matches_of_different_scenes_are_excluded(stations):
    rng = np.random.default_rng(0)
    points = rng.uniform([-1, -1, 0], [1, 1, 0.3], (300, 3))
    pixels = stereo_pixels(TRUE, stations["A"], points)
    wrong = rng.uniform([0, 0], [TRUE.right.width, TRUE.right.height], (300, 2))
    a_third = StereoPixels(pixels.left, np.where(np.arange(300)[:, None] % 3 == 0, wrong, pixels.right))
    assert 200 <= len(possible_matches(TRUE, a_third, AREA.depths).left) < 215
    assert len(possible_matches(TRUE, StereoPixels(pixels.left, wrong), AREA.depths).left) == 0


@pytest.fixture
def stations():
    """Return `sandbox_from_left` of two positions."""
    return {name: camera(name, "L").world_from_camera for name in "AC"}


def stereo_pixels(rig, pose, points):
    left = pose.inverse().apply(points)
    return StereoPixels(rig.left.project(left), rig.right.project(rig.left_from_right.inverse().apply(left)))


def test_ground_from_two_positions_corrects_principal_point_and_poses(stations):
    rng = np.random.default_rng(0)
    plan = rng.uniform(-1, 1, (300, 2))
    points = np.column_stack([plan, 0.05 * np.sin(3 * plan[:, 0]) * plan[:, 1]])
    pixels = {name: stereo_pixels(TRUE, pose, points) for name, pose in stations.items()}
    stated = replace(TRUE, right=replace(TRUE.right, cx=TRUE.right.cx + 1.2, cy=TRUE.right.cy - 1.0))
    started = {**stations, "C": stations["C"] @ Pose.from_rotvec(np.full(3, 0.004), np.full(3, 0.03))}
    moved = triangulated(stated, pixels["A"]) - stations["A"].inverse().apply(points)
    assert np.linalg.norm(moved, axis=1).min() > 0.005  # metres: the error of the calibration
    rig, poses = correct_calibration(stated, list(pixels.values()), {("A", "C"): Crossing(*pixels.values())}, started)
    left = triangulated(rig, pixels["A"]) - stations["A"].inverse().apply(points)
    assert np.median(np.linalg.norm(left, axis=1)) < 0.002
    relative, true = (of["A"].inverse() @ of["C"] for of in (poses, stations))
    assert np.linalg.norm(relative.translation - true.translation) < 0.004
    assert np.degrees(angle_between(relative, true)) < 0.06


def test_matching_errors_do_not_shorten_the_baseline(stations):
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-1, 1, (300, 2)), np.zeros(300)])
    pixels = {name: stereo_pixels(TRUE, pose, points) for name, pose in stations.items()}
    noisy = [StereoPixels(of.left + rng.normal(0, 3, (300, 2)), of.right) for of in pixels.values()]
    rig, _ = correct_calibration(TRUE, [], {("A", "C"): Crossing(*noisy)}, stations)
    assert rig != TRUE
    assert np.linalg.norm(rig.left_from_right.translation) == pytest.approx(
        np.linalg.norm(TRUE.left_from_right.translation), rel=1e-12
    )


def test_cells_follow_the_position_whose_points_are_farther_apart():
    def ground(row_step, columns):
        y, x = np.mgrid[-1:1:row_step, -1 : 1 : complex(0, columns)]
        return RangePoints(LENS, np.stack([x, y, np.zeros_like(x)], axis=-1), [])

    half = np.array([1.0, 1.0])
    near, far = (point_spacing(ground(step, 500), Pose.identity(), half) for step in (0.006, 0.018))
    np.testing.assert_allclose(near[np.isfinite(near)], 0.006)
    assert common_spacing(near, far) == pytest.approx(0.018)
    assert common_spacing(near, np.full_like(far, np.nan)) is None


def test_epipolar_lines_correct_the_height_of_a_principal_point(stations):
    points = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 0.3], (300, 3))
    pixels = stereo_pixels(TRUE, stations["A"], points)
    stated = replace(TRUE, right=replace(TRUE.right, cy=TRUE.right.cy - 1.0))
    rig, poses = correct_calibration(stated, [pixels], {}, stations)
    assert poses == stations
    off = (stereo_pixels(rig, stations["A"], points).right - pixels.right)[:, 1]
    shared = (stereo_pixels(rig, stations["A"], points).left - pixels.left)[:, 1]
    assert np.abs(off - shared).max() < 0.1  # of the pixel that the calibration was wrong by


def test_windows_of_maps_are_found_at_their_displacement():
    rng = np.random.default_rng(0)
    pattern = rng.normal(size=(420, 420, 2)).astype(np.float32)
    x = 0.01 * np.arange(420)
    height = np.broadcast_to(0.02 * x, (420, 420))
    fixed = Ortho(height, pattern, np.full(2, 2.1))
    moving = Ortho(height + 0.003, np.roll(pattern, (4, -3), axis=(0, 1)), np.full(2, 2.1))
    first, second = match_orthophotos(fixed, moving, 0.01, 0.06)
    assert len(first) > 900
    np.testing.assert_allclose((second - first)[:, :2], np.broadcast_to([-0.03, 0.04], (len(first), 2)), atol=0.003)
    np.testing.assert_allclose((second - first)[:, 2], 0.003 - 0.02 * 0.03, atol=1e-6)


@pytest.mark.parametrize(
    ("windows", "corrected", "message"),
    [((0,), False, "only epipolar lines"), ((300, 0), True, "registered like scans")],
)
def test_without_matched_ground_the_rig_of_the_round_before_is_kept(
    monkeypatch, caplog, stations, windows, corrected, message
):
    points = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 0.1], (300, 3))
    pixels = {name: stereo_pixels(TRUE, pose, points) for name, pose in stations.items()}
    stated = replace(TRUE, right=replace(TRUE.right, cx=TRUE.right.cx + 1.2))
    counts = iter(windows)

    def find_crossing(*_):
        count = next(counts)
        return Crossing(*(StereoPixels(of.left[:count], of.right[:count]) for of in pixels.values()))

    monkeypatch.setattr(range_maps, "_registered", lambda *_: stations)
    monkeypatch.setattr(range_maps, "measure_points", lambda *_: None)
    monkeypatch.setattr(range_maps, "find_crossing", find_crossing)
    photos = dict.fromkeys(stations)
    rig, poses = range_maps._calibrated_by_ground(polar(), 3, stated, stated, photos, pixels, photos, AREA)
    assert poses == {}
    error = abs(rig.right.cx - rig.left.cx - TRUE.right.cx + TRUE.left.cx)
    assert error < 0.2 if corrected else rig == stated
    assert message in caplog.text


def test_a_position_that_the_first_calibration_bends_is_registered_after_its_correction(monkeypatch, stations):
    stations = {**stations, "B": stations["A"] @ Pose.from_rotvec(np.zeros(3), np.array([0.2, 0, 0]))}
    points = np.random.default_rng(0).uniform([-1, -1, 0], [1, 1, 0.1], (300, 3))
    pixels = {name: stereo_pixels(TRUE, pose, points) for name, pose in stations.items()}
    registrations = iter([{name: stations[name] for name in "AC"}, stations])
    monkeypatch.setattr(range_maps, "_registered", lambda *_: next(registrations))
    monkeypatch.setattr(range_maps, "measure_points", lambda *_: None)
    monkeypatch.setattr(range_maps, "find_crossing", lambda _, pair, *__: Crossing(*(pixels[name] for name in pair)))
    photos = dict.fromkeys(stations)
    _, poses = range_maps._calibrated_by_ground(polar(), 3, TRUE, TRUE, photos, pixels, photos, AREA)
    assert sorted(poses) == ["A", "B", "C"]


@pytest.mark.parametrize("suns", [[], ["30"], ["30", "180"]], ids=len)
def test_photos_that_share_no_features_are_an_error_with_the_table(tmp_path, caplog, suns):
    table, rng = tmp_path / "photos.parquet", np.random.default_rng(0)
    rows = []
    for camera_name, sun in product("LR", suns):
        path = tmp_path / f"03_A_off_{sun}_{camera_name}_0256.png"
        png.write_png(path, rng.integers(900, 1100, TRUE.left.shape).astype(np.uint16))
        rows.append({"key": path.stem, "path": str(path)})
    tables.write_parquet(table, pd.DataFrame(rows) if rows else photo_table([]))
    write_rig(tmp_path / "calibration.json", TRUE, "stated")
    write_inventory(tmp_path / "inventory.json", Inventory(3, "files"))
    with pytest.raises(ReconstructionError) as caught:
        measure_ranges(
            site=polar(),
            terrain=3,
            photos=table,
            calibration=tmp_path / "calibration.json",
            inventory=tmp_path / "inventory.json",
            corrected=tmp_path / "corrected.json",
            measured=tmp_path / "measured.json",
            maps=tmp_path / "maps",
        )
    assert caught.value.path == table
    assert not (tmp_path / "measured.json").exists()
    assert ("single Sun lamp at A" in caplog.text) == (len(suns) == 1)
