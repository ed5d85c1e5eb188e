import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from polarsim.cameras.heightmaps import agreement, correlate_rotations, height_map, relief_correlation
from polarsim.cameras.icp import ScanSurface, align_jointly, covariances, measure, thin_to_planes
from polarsim.cameras.sandbox_frame import find_sandbox_frame
from polarsim.cameras.scans import level_pose, place_scans, register_scans
from polarsim.errors import RegistrationError
from polarsim.geometry.poses import Pose, angle_between, camera_pose
from polarsim.geometry.stereo import rectified_left
from tests.support.polar_survey import AREA, SANDBOX, STATIONS

from .conftest import make_sandbox

pytestmark = pytest.mark.usefixtures("coarse_scans")


@pytest.fixture(scope="module")
def network(scans):
    return register_scans(scans, STATIONS, AREA)


def relative(poses, first, second):
    return poses[first].inverse() @ poses[second]


def test_scans_are_registered(network, true_poses):
    found, true = (relative(poses, "A", "C") for poses in (network.level_from_left, true_poses))
    # A quarter of the photos' resolution and 2 mm of noise; 5 m between the tripods.
    assert np.linalg.norm(found.translation - true.translation) < 0.002
    assert np.degrees(angle_between(found, true)) < 0.03
    assert network.pairs[0].agreement > 0.9


def test_scans_with_known_poses_keep_their_relative_pose(scans, network):
    tilted = Pose.from_rotvec(np.array([0.004, -0.003, 0.1]), np.array([0.05, 0.0, 0.02]))
    known = {position: tilted @ pose for position, pose in network.level_from_left.items()}
    placed = place_scans(scans, known, AREA)
    for position, pose in placed.level_from_left.items():
        np.testing.assert_allclose(pose.matrix, known[position].matrix, atol=1e-9)
        apart = network.level_from_left[position].inverse().apply(network.points[position])
        again = known[position].inverse().apply(placed.points[position])
        assert np.abs(np.median(apart, axis=0) - np.median(again, axis=0)).max() < 0.05
    assert placed.pairs[0].agreement == pytest.approx(network.pairs[0].agreement, abs=0.02)


FAR_OFF = Pose.from_rotvec(np.array([0, 0, 0.15]), np.array([-0.9, 0.9, 0.0]))


@pytest.mark.parametrize("common_from_level", [Pose.identity(), FAR_OFF], ids=["near", "metres off"])
def test_the_walls_give_origin_and_heading(network, true_poses, common_from_level):
    frame = find_sandbox_frame(
        {position: common_from_level.apply(points) for position, points in network.points.items()},
        {position: common_from_level.rotate(normals) for position, normals in network.normals.items()},
        {position: common_from_level @ pose for position, pose in network.level_from_left.items()},
        STATIONS,
        SANDBOX,
    )
    assert frame.walls >= 3
    for position, pose in network.level_from_left.items():
        found = frame.sandbox_from_level @ common_from_level @ pose
        assert np.linalg.norm(found.translation - true_poses[position].translation) < 0.015
        assert np.degrees(angle_between(found, true_poses[position])) < 0.4  # the relief tilts the sand's plane


def test_without_walls_the_survey_defines_the_frame(network, true_poses):
    low = {p: points[points[:, 2] < 0.05] for p, points in network.points.items()}
    normals = {p: network.normals[p][network.points[p][:, 2] < 0.05] for p in low}
    frame = find_sandbox_frame(low, normals, network.level_from_left, STATIONS, SANDBOX)
    assert frame.walls == 0
    for position, pose in network.level_from_left.items():
        found = frame.sandbox_from_level @ pose
        # The survey is off by 0.1 m (A) and 0.6 m (C) in this scene.
        assert np.linalg.norm(found.translation - true_poses[position].translation) < 0.45


def test_positions_without_a_survey_start_at_the_same_pose(scans, rng):
    """As on terrain 13, where B and C are within decimetres of A."""
    a_from_b = Pose.from_rotvec(np.array([0.02, -0.03, 0.05]), np.array([0.15, -0.1, 0.05]))
    beside = a_from_b.inverse().apply(scans["A"]) + rng.normal(0, 0.001, scans["A"].shape)
    found = relative(register_scans({"A": scans["A"], "B": beside}, {}, AREA).level_from_left, "A", "B")
    assert np.linalg.norm(found.translation - a_from_b.translation) < 0.002
    assert np.degrees(angle_between(found, a_from_b)) < 0.03


@pytest.mark.slow
def test_scans_of_two_terrains_are_refused(scans):
    # The relief in the same box has bumps of 10 cm in C only.
    level = level_pose("C", scans["C"], STATIONS, AREA)
    bumpy = level.apply(scans["C"])
    bumpy[:, 2] += 0.1 * np.sin(9 * bumpy[:, 0]) * np.sin(11 * bumpy[:, 1])
    with pytest.raises(RegistrationError, match=r"[AC] and [AC]"):
        register_scans({"A": scans["A"], "C": level.inverse().apply(bumpy)}, STATIONS, AREA)


def test_copies_of_a_scan_are_refused(scans):
    with pytest.raises(RegistrationError, match="A and C"):
        register_scans({"A": scans["A"], "C": scans["A"].copy()}, STATIONS, AREA)


@pytest.fixture(scope="module")
def foreign(true_poses):
    """Scans of A and C of another sandbox: relief of the same height, other rocks, the same walls."""
    box, rng = make_sandbox(9), np.random.default_rng(1)
    left_from_rectified = rectified_left(box.rig).left_from_rectified
    maps = {position: box.scan(true_poses[position], rng, 0.002) for position in "AC"}
    return {p: left_from_rectified.apply(m[np.isfinite(m).all(axis=-1)]) for p, m in maps.items()}


def test_scans_of_two_terrains_with_similar_relief_are_refused(scans, foreign):
    """70 % of their cells agree to 15 mm, because sand is flat; the rocks differ."""
    with pytest.raises(RegistrationError, match=r"[AC] and [AC]"):
        register_scans({"A": scans["A"], "C": foreign["C"]}, STATIONS, AREA)


@pytest.mark.slow
def test_a_scan_that_contradicts_two_scans_is_excluded(sandbox, scans, foreign):
    """It has more points than the other scan of its sandbox, and is tried earlier as the reference."""
    left_from_rectified = rectified_left(sandbox.rig).left_from_rectified
    beside = camera_pose(np.array([3.5, 0.35, 1.5]), np.radians(182), np.radians(25))  # of a position without survey
    third = sandbox.scan(beside, np.random.default_rng(2), 0.002)
    third = left_from_rectified.apply(third[np.isfinite(third).all(axis=-1)])
    given = {**scans, "D": third}
    odd = max("AC", key=lambda position: len(foreign[position]))
    network = register_scans({**given, odd: foreign[odd]}, STATIONS, AREA)
    assert set(network.level_from_left) == set("ACD") - {odd}
    assert len(network.refused) == 1
    assert f" {odd} " in str(network.refused[0])
    assert network.pairs[0].agreement > 0.9


def test_a_scan_that_is_rotated_by_180_degrees_is_excluded(scans):
    backwards = scans["C"] * np.array([-1, 1, -1])  # by 180 degrees about the camera's vertical
    network = register_scans({"A": scans["A"], "C": backwards}, STATIONS, AREA)
    assert list(network.level_from_left) == ["A"]
    (reason,) = network.refused
    assert "position C" in str(reason)


def wall(distance=2.8):
    """Return a scan of a wall in front of the camera, perpendicular to the optical axis."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(-1.2, 1.2, 0.01), np.arange(-0.8, 0.8, 0.01)))
    return np.column_stack([x, y, distance + 0.002 * np.random.default_rng(3).standard_normal(len(x))])


def test_scans_of_walls_localise_no_terrain():
    with pytest.raises(RegistrationError, match="position A"):
        register_scans({"A": wall(), "C": wall(2.7)}, STATIONS, AREA)


def test_a_scan_without_sand_is_refused():
    with pytest.raises(RegistrationError, match="position A"):
        level_pose("A", np.full((50_000, 3), [0.0, 0.0, 30.0]), STATIONS, AREA)


def test_correlation_finds_a_known_rotation_and_translation(rng):
    bumps = rng.uniform(-1.2, 1.2, (60, 2))
    grid = np.stack(np.meshgrid(*[np.arange(-1.5, 1.5, 0.01)] * 2), axis=-1).reshape(-1, 2)
    heights = sum(0.05 * np.exp(-((grid - bump) ** 2).sum(axis=1) / 0.05**2) for bump in bumps)
    fixed = np.column_stack([grid, heights])
    true = Pose.from_rotvec(np.array([0, 0, np.radians(6.0)]), np.array([0.30, -0.12, 0.0]))
    best = correlate_rotations(
        fixed, true.inverse().apply(fixed), 2.0, 0.02, np.radians(np.arange(-10, 11, 2.0)), 1.0, 3
    )
    assert np.linalg.norm(best[0].translation - true.translation) < 0.03
    assert np.degrees(angle_between(best[0], true)) < 0.01


def test_a_height_map_has_the_mean_of_each_cell():
    heights = height_map(np.array([[0.01, 0.01, 1.0], [0.03, 0.03, 3.0], [-0.09, 0.07, 5.0]]), 0.1, 0.05).height
    assert heights.shape == (4, 4)
    assert heights[2, 2] == 2.0  # y row, x column: both first points
    assert heights[3, 0] == 5.0
    assert np.isfinite(heights).sum() == 2


def test_relief_correlates_with_itself_and_not_with_another(rng):
    grid = np.stack(np.meshgrid(*[np.arange(-1.5, 1.5, 0.01)] * 2), axis=-1).reshape(-1, 2)
    one, other = (np.column_stack([grid, 0.05 * np.sin(f * grid[:, 0]) * np.sin(f * grid[:, 1])]) for f in (9, 13))
    noisy = one + 0.01 * rng.standard_normal(one.shape) * [0, 0, 1]
    assert relief_correlation(one, noisy, 1.6, 0.02, 0.005) > 0.95
    assert abs(relief_correlation(one, other, 1.6, 0.02, 0.005)) < 0.05
    assert relief_correlation(one * [1, 1, 0.01], other * [1, 1, 0.01], 1.6, 0.02, 0.005) == 1.0  # too flat


def test_agreement_is_computed_over_shared_cells():
    plane = np.column_stack([np.mgrid[0:10, 0:10].reshape(2, -1).T * 0.1 - 0.45, np.zeros(100)])
    raised = plane[plane[:, 0] > 0] + np.array([0, 0, 0.05])
    both = np.concatenate([plane[plane[:, 0] < -0.3], raised])
    share, cells = agreement(plane, both, 0.5, 0.1, 0.01)
    assert cells == 70
    assert share == pytest.approx(20 / 70)


@pytest.mark.parametrize("reference", ["A", "B"])
def test_joint_alignment_undoes_small_motions_of_three_views(rng, reference):
    step = np.arange(-1, 1, 0.02)
    x, y = (grid.ravel() for grid in np.meshgrid(step, step))
    z, slope = 0.1 * np.sin(4 * x) * np.cos(5 * y), np.array([0.4, 0.5])
    normals = np.column_stack(
        [-slope[0] * np.cos(4 * x) * np.cos(5 * y), slope[1] * np.sin(4 * x) * np.sin(5 * y), np.ones_like(x)]
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = np.column_stack([x, y, z])
    motions = {
        name: Pose.from_rotvec(0.004 * rng.standard_normal(3), 0.004 * rng.standard_normal(3)) for name in "BC"
    } | {"A": Pose.identity()}
    surfaces = {
        name: ScanSurface(motion.inverse().apply(points), motion.inverse().rotate(normals), np.full(len(points), 0.001))
        for name, motion in motions.items()
    }
    start = {name: Pose.identity() for name in motions}
    found = align_jointly(surfaces, start, reference)
    for name, motion in motions.items():
        np.testing.assert_allclose(relative(found, "A", name).matrix, motion.matrix, atol=1e-5)
    on_itself = measure(surfaces["A"], surfaces["B"], relative(found, "A", "B"), 0.005)
    assert on_itself.fitness > 0.99
    assert on_itself.rmse < 1e-4


EYES = {"A": np.array([3.5, -0.4, 1.5]), "B": np.array([0.9, -3.7, 1.5]), "C": np.array([-2.0, 2.5, 1.5])}


def noisy_copies(rng, noise):
    """Return a relief scanned from three positions, 14 mm apart, with noise along the beams, at the true poses."""
    surfaces = {}
    for name, eye in EYES.items():
        x, y = rng.uniform(-1.2, 1.2, (2, 30_000))
        points = np.column_stack(
            [x, y, 0.05 * np.sin(4 * x + 1) * np.cos(5 * y) + 0.02 * np.sin(11 * x) * np.sin(9 * y)]
        )
        beams = (points - eye) / np.linalg.norm(points - eye, axis=1, keepdims=True)
        surfaces[name] = thin_to_planes(points + noise * rng.normal(size=(len(x), 1)) * beams, eye, 0.02)
    return surfaces


def rotations_and_translations(poses):
    """Return small motions (s, 6) minus their mean."""
    motions = np.array(
        [[*Rotation.from_matrix(pose.rotation).as_rotvec(), *pose.translation] for _, pose in sorted(poses.items())]
    )
    return motions - motions.mean(axis=0)


def test_formal_errors_are_as_large_as_the_true_ones(rng):
    ratios = []
    for _ in range(2):
        surfaces = noisy_copies(rng, 0.003)
        found = align_jointly(surfaces, {name: Pose.identity() for name in EYES}, "A")
        formal = covariances(surfaces, found)
        for error, name in zip(rotations_and_translations(found), sorted(EYES), strict=True):
            ratios.append(error @ np.linalg.pinv(formal[name], rcond=1e-6, hermitian=True) @ error / 6)
    assert 0.5 < 1 / np.sqrt(np.mean(ratios)) < 2
