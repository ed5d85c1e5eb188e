import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.errors import RegistrationError
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, angle_between, camera_pose
from polarsim.scoring.alignment import fit_alignment, refine_alignment
from polarsim.scoring.surface import Surface

A = camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, 0.4)
C = camera_pose(np.array([0.8, -3.8, 1.5]), 1.8, 0.4)
numbers = st.floats(-1, 1)


@given(st.tuples(numbers, numbers, numbers), st.tuples(numbers, numbers, numbers))
def test_the_alignment_undoes_any_rigid_motion_of_the_frame(rotation, translation):
    moved = Pose.from_rotvec(np.array(rotation), np.array(translation))
    alignment = fit_alignment({"A": moved @ A, "C": moved @ C}, {"A": A, "B": A, "C": C})
    np.testing.assert_allclose((alignment @ moved).matrix, np.eye(4), atol=1e-9)


def test_a_scale_error_of_cameras_remains_after_alignment():
    off = 0.004 * (C.translation - A.translation) / np.linalg.norm(C.translation - A.translation)
    apart = {"A": Pose(A.rotation, A.translation - off), "C": Pose(C.rotation, C.translation + off)}
    alignment = fit_alignment(apart, {"A": A, "C": C})
    assert np.linalg.norm(alignment.apply(A.translation - off) - A.translation) == pytest.approx(0.004, rel=1e-6)


def test_frames_without_a_common_position_cannot_be_compared():
    with pytest.raises(RegistrationError, match="no common position"):
        fit_alignment({"A": A}, {"B": A})


@pytest.mark.parametrize(
    ("rotation", "translation"),
    [((0, 0, 0.001), (0.004, -0.005, 0)), ((0.001, -0.001, 0), (0, 0, 0.005)), ((0, 0, 0), (-0.005, 0.005, 0.005))],
)
def test_icp_finds_a_small_motion_of_the_whole_terrain(rotation, translation, sand):
    surface = Surface(sand.vertices, sand.faces)
    points, _ = surface.sample(4000, np.random.default_rng(1))
    truth_from_sandbox = Pose.from_rotvec(np.array(rotation), np.array(translation))
    found = refine_alignment(Pose.identity(), truth_from_sandbox.apply(points), surface)
    assert angle_between(found, truth_from_sandbox) < 1e-4
    np.testing.assert_allclose(found.apply(points), truth_from_sandbox.apply(points), atol=1e-4)


def test_points_are_spread_by_area_and_lie_on_the_surface():
    surface = Surface(
        np.array([[0, 0, 0], [3.0, 0, 0], [3, 1, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    )
    points, face = surface.sample(20000, np.random.default_rng(1))
    assert np.mean(face == 2) == pytest.approx(0.5 / 3.5, abs=0.01)
    np.testing.assert_allclose(surface.distance(points), 0, atol=1e-6)
    np.testing.assert_allclose(points[face < 2].mean(axis=0), [1.5, 0.5, 0], atol=0.02)


def test_distances_are_measured_to_the_nearest_point(cube):
    surface = Surface(*_fields(cube((0, 0, 0), 2)))
    np.testing.assert_allclose(
        surface.distance(np.array([[1.5, 0, 0], [2, 2, 0], [0, 0, 0.25]])), [0.5, 2**0.5, 0.75], rtol=1e-6
    )


def test_only_faces_towards_the_viewpoint_are_visible(cube):
    surface = Surface(*_fields(cube((0, 0, 0), 2)))
    points = np.array([[1, 0.1, 0.2], [-1, 0.1, 0.2], [0.1, 0.2, 1]])
    seen = surface.seen_from(np.array([5.0, 0, 0.5]), points, np.array([[1.0, 0, 0], [-1, 0, 0], [0, 0, 1]]))
    assert seen.tolist() == [True, False, False]


def _fields(mesh):
    return mesh.vertices, mesh.faces


def test_motions_along_level_ground_are_determined_by_cameras(sand):
    flat = Mesh(sand.vertices * [1, 1, 0], sand.faces)
    points, _ = Surface(flat.vertices, flat.faces).sample(2000, np.random.default_rng(1))
    start = Pose(np.eye(3), np.array([0.004, -0.003, 0.002]))
    found = refine_alignment(start, points, Surface(flat.vertices, flat.faces))
    np.testing.assert_allclose(found.translation[:2], start.translation[:2], atol=1e-5)
    assert abs(found.translation[2]) < 1e-5
