from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.cameras.adjust import MatchedPoints, Priors, adjust
from polarsim.geometry.poses import Pose, angle_between, camera_pose
from polarsim.run_files.rigs import LocalisedRig
from tests.support.polar_rig import default_rig

PRIORS = Priors(0.003, np.radians(0.1))
INDEPENDENT = 300
TRUE = {
    "A": LocalisedRig(default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(27)), "scans"),
    "C": LocalisedRig(default_rig(), camera_pose(np.array([0.8, -3.6, 1.5]), np.radians(103), np.radians(27)), "scans"),
}


def sightings(true, rng, noise_px=0.3, outliers=0.0, count=600, stated_px=0.7):
    points = np.column_stack([rng.uniform(-1.8, 1.8, (count, 2)), rng.uniform(0, 0.3, count)])
    seen = {}
    for position, rig in true.items():
        for camera in "LR":
            pixels = rig.project(camera, points) + rng.normal(0, noise_px, (count, 2))
            wrong = rng.random(count) < outliers
            pixels[wrong] += rng.uniform(-10, 10, (wrong.sum(), 2))
            inside = ((pixels > 0) & (pixels < [1936, 1216])).all(axis=1)
            whitening = np.tile(np.eye(2) / stated_px, (inside.sum(), 1, 1))
            seen[position, camera] = MatchedPoints(points[inside], pixels[inside], whitening)
    return seen


def disturbed(true, rng, mm=2.0, deg=0.05):
    return {
        position: replace(
            rig,
            sandbox_from_left=rig.sandbox_from_left
            @ Pose.from_rotvec(np.radians(rng.normal(0, deg, 3)), rng.normal(0, mm / 1000, 3)),
        )
        for position, rig in true.items()
    }


def errors(localised, true):
    pairs = [(localised[p].sandbox_from_left, true[p].sandbox_from_left) for p in true]
    return (
        max(np.linalg.norm(a.translation - b.translation) for a, b in pairs),
        np.degrees(max(angle_between(a, b) for a, b in pairs)),
    )


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 10**6))
def test_disturbed_poses_come_back_among_outliers(seed):
    rng = np.random.default_rng(seed)
    found = adjust(disturbed(TRUE, rng), sightings(TRUE, rng, outliers=0.3), PRIORS, INDEPENDENT, lenses=False)
    metres, degrees = errors(found.localised, TRUE)
    assert metres < 0.0008
    assert degrees < 0.01


def test_a_calibration_that_is_off_is_mended_for_all_positions_alike():
    rng = np.random.default_rng(3)
    rig = default_rig()
    bent = replace(rig.left, fx=rig.left.fx + 3, fy=rig.left.fy + 3, distortion=(-0.111, *rig.left.distortion[1:]))
    true = {p: replace(one, rig=replace(rig, left=bent)) for p, one in TRUE.items()}
    seen = sightings(true, rng, noise_px=0.1)
    kept, mended = (adjust(TRUE, seen, PRIORS, INDEPENDENT, lenses=lenses) for lenses in (False, True))
    lens = mended.localised["A"].rig.left
    assert mended.localised["C"].rig.left == lens
    assert abs(lens.fx - bent.fx) < 1.2
    assert abs(lens.distortion[0] - bent.distortion[0]) < 0.0015
    assert kept.localised["A"].rig.left == rig.left
    assert errors(mended.localised, true)[0] < errors(kept.localised, true)[0]


def test_where_nothing_is_seen_the_priors_stay():
    nothing = {("A", "L"): MatchedPoints(np.zeros((0, 3)), np.zeros((0, 2)), np.zeros((0, 2, 2)))}
    found = adjust({"A": TRUE["A"]}, nothing, PRIORS, INDEPENDENT, lenses=True)
    np.testing.assert_allclose(found.localised["A"].sandbox_from_left.matrix, TRUE["A"].sandbox_from_left.matrix)
    sd = np.sqrt(np.diag(found.covariance["A"]))
    np.testing.assert_allclose(sd, [PRIORS.pose_rad] * 3 + [PRIORS.pose_m] * 3)


@pytest.mark.parametrize("independent", [50, 300])
def test_many_windows_of_a_view_count_for_no_more_than_so_many(independent):
    few, many = (sightings(TRUE, np.random.default_rng(1), count=count) for count in (1000, 4000))
    one, other = (adjust(TRUE, seen, PRIORS, independent, lenses=False).covariance["A"] for seen in (few, many))
    np.testing.assert_allclose(np.diag(one), np.diag(other), rtol=0.15)


def test_what_windows_do_not_tell_does_not_matter():
    """Windows on upright edges do not measure heights: wrong heights there move no camera."""
    rng = np.random.default_rng(4)
    seen = {
        view: MatchedPoints(
            one.points, one.pixels + np.array([0, 8]), np.tile(np.diag([1 / 0.7, 0]), (len(one.pixels), 1, 1))
        )
        for view, one in sightings(TRUE, rng, noise_px=0).items()
    }
    found = adjust(TRUE, seen, PRIORS, INDEPENDENT, lenses=False)
    metres, degrees = errors(found.localised, TRUE)
    assert metres < 1e-5
    assert degrees < 1e-4


def test_photos_of_twice_the_size_have_the_same_adjustment():
    """Errors of calibrations are proportional to the size: 3 px of a principal point are 6 px."""
    seen = sightings(TRUE, np.random.default_rng(3))
    wrong = {position: replace(rig, rig=off_centre(rig.rig)) for position, rig in TRUE.items()}
    large = {position: replace(rig, rig=scaled(rig.rig, 2.0)) for position, rig in wrong.items()}
    seen_large = {
        view: MatchedPoints(points.points, 2 * points.pixels, points.whitening / 2) for view, points in seen.items()
    }
    one = adjust(wrong, seen, PRIORS, INDEPENDENT, lenses=True).localised["A"]
    other = adjust(large, seen_large, PRIORS, INDEPENDENT, lenses=True).localised["A"]
    np.testing.assert_allclose(other.sandbox_from_left.matrix, one.sandbox_from_left.matrix, atol=1e-9)
    assert other.rig.left.cx == pytest.approx(2 * one.rig.left.cx, abs=1e-5)


def off_centre(rig):
    return replace(rig, left=replace(rig.left, cx=rig.left.cx + 3))


def scaled(rig, factor):
    return replace(rig, left=rig.left.scaled(factor), right=rig.right.scaled(factor))
