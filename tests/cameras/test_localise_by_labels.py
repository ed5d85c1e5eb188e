from dataclasses import replace

import numpy as np
import pytest

from polarsim.cameras import search
from polarsim.cameras.labels import check_localisation, localise_by_labels, survey_prior
from polarsim.cameras.refine import EdgeNoise, EdgeProblem, unknowns_of
from polarsim.cameras.search import SearchRanges
from polarsim.cameras.surveyed import (
    SHARED_PITCH_SD_DEG,
    USUAL_PITCH_SD_DEG,
    expected_survey_pose,
    offset_surveyed_pose,
)
from polarsim.errors import RegistrationError
from polarsim.geometry.boxes import match_by_position_and_size
from polarsim.geometry.outlines import outlines_of
from polarsim.geometry.poses import Pose, angle_between, camera_pose, yaw_pitch_roll
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import RANGES, TRIPODS, surveyed_pose

pytestmark = pytest.mark.usefixtures("coarse_search")
LENS = default_rig().left


@pytest.fixture(scope="module")
def outlines(labelled):
    return outlines_of(labelled.meshes, 0.0, 0.0)  # rocks without skirts


@pytest.fixture(scope="module")
def localisation_of_a(labelled, outlines):
    return localise_by_labels(labelled.seen("A"), outlines, LENS, surveyed_pose("A"), RANGES)


def spoiled(boxes, rng):
    """Remove a fifth of the boxes, and add five false boxes of real sizes."""
    kept = boxes[np.sort(rng.permutation(len(boxes))[: round(0.8 * len(boxes))])]
    sizes = boxes[rng.integers(len(boxes), size=5), 2:] - boxes[rng.integers(len(boxes), size=5), :2]
    sizes = np.clip(np.abs(sizes), 20, 200)
    corner = rng.uniform([100, 400], [1700, 1000], (5, 2))
    return np.concatenate([kept, np.column_stack([corner, corner + sizes])])


def test_the_pose_is_found_with_missing_and_false_boxes(labelled, outlines, true_poses, rng):
    position = "C"
    boxes = spoiled(labelled.seen(position), rng)
    localisation = localise_by_labels(boxes, outlines, LENS, surveyed_pose(position), RANGES)
    found, true = localisation.fit.sandbox_from_left, true_poses[position]
    # Edges of 2 px and 12 rocks at 4 m: about 2 px / sqrt(12) * 4 m / 2070 px = 1 mm across, ten times that in depth.
    assert np.linalg.norm(found.translation - true.translation) < 0.03
    assert np.degrees(angle_between(found, true)) < 0.5
    ids = outlines.rocks[localisation.fit.outline]
    annotated = labelled.boxes[position][ids - 1]
    real = localisation.fit.box < round(0.8 * len(labelled.seen(position)))
    np.testing.assert_array_equal(boxes[localisation.fit.box][real], annotated[real])  # correct pairs of rock and box


def test_the_pose_is_found_without_a_survey(labelled, outlines, true_poses, monkeypatch):
    monkeypatch.setattr(search, "AZIMUTH_STEP_DEG", 6.0)
    near = SearchRanges((3.0, 4.5), RANGES.height)
    found = localise_by_labels(labelled.seen("A"), outlines, LENS, None, near).fit.sandbox_from_left
    assert np.linalg.norm(found.translation - true_poses["A"].translation) < 0.03


def test_mirrored_boxes_are_refused(labelled, outlines):
    mirrored = labelled.seen("A") * [-1, 1, -1, 1] + [LENS.width, 0, LENS.width, 0]
    localisation = localise_by_labels(mirrored[:, [2, 1, 0, 3]], outlines, LENS, surveyed_pose("A"), RANGES)
    with pytest.raises(RegistrationError):
        check_localisation(localisation, 1.0)


def test_an_ambiguous_pose_is_refused(localisation_of_a):
    with pytest.raises(RegistrationError):
        check_localisation(replace(localisation_of_a, runner_up=localisation_of_a.share - 0.05), 1.0)


def test_the_second_best_pose_is_at_another_position(localisation_of_a):
    assert localisation_of_a.share > 0.8
    assert localisation_of_a.runner_up < 0.5 * localisation_of_a.share


def test_too_few_boxes_are_refused(outlines):
    with pytest.raises(RegistrationError):
        localise_by_labels(np.zeros((2, 4)), outlines, LENS, surveyed_pose("A"), RANGES)


def test_boxes_are_matched_by_size_and_distance():
    rock = np.array([[100.0, 100, 140, 130]])
    assert len(match_by_position_and_size(rock, np.array([[60.0, 70, 180, 160]]), 40)[0]) == 0  # three times as large
    assert len(match_by_position_and_size(rock, np.array([[110.0, 105, 150, 135]]), 40)[0]) == 1
    assert len(match_by_position_and_size(rock, np.array([[150.0, 105, 190, 135]]), 40)[0]) == 0  # too far


def test_the_jacobian_is_that_of_the_residuals(labelled, outlines, true_poses):
    position = "C"
    seen = np.isfinite(labelled.boxes[position]).all(axis=1)
    part = outlines_of({rock: labelled.meshes[rock] for rock in outlines.rocks[seen]}, 0.0, 0.0)
    noise = EdgeNoise(3, 3)
    problem = EdgeProblem(part, labelled.seen(position), LENS, survey_prior(surveyed_pose(position)), noise)
    at = unknowns_of(true_poses[position])
    numeric = np.stack(
        [(problem.residuals(at + d) - problem.residuals(at - d)) / 2e-7 for d in 1e-7 * np.eye(6)], axis=1
    )
    np.testing.assert_allclose(problem.jacobian(at), numeric, rtol=1e-4, atol=1e-2)


def test_edges_have_the_same_residuals_in_photos_of_half_the_size(labelled, outlines, true_poses):
    seen = np.isfinite(labelled.boxes["C"]).all(axis=1)
    part = outlines_of({rock: labelled.meshes[rock] for rock in outlines.rocks[seen]}, 0.0, 0.0)
    boxes, prior = labelled.seen("C") + 1, survey_prior(surveyed_pose("C"))
    full = EdgeProblem(part, boxes, LENS, prior, EdgeNoise(3, 3))
    half = EdgeProblem(part, boxes / 2, LENS.scaled(0.5), prior, EdgeNoise(3, 3))
    at = unknowns_of(true_poses["C"])
    np.testing.assert_allclose(half.residuals(at), full.residuals(at), atol=1e-9)
    np.testing.assert_allclose(half.jacobian(at), full.jacobian(at), atol=1e-7)


def test_an_unlocalised_position_gets_the_mean_offset_of_localised_positions():
    translation = np.array([0.1, -0.2, 0.3])
    localised = {p: Pose(surveyed_pose(p).rotation, surveyed_pose(p).translation + translation) for p in "AC"}
    np.testing.assert_allclose(
        offset_surveyed_pose("B", localised, TRIPODS).translation, surveyed_pose("B").translation + translation
    )
    np.testing.assert_array_equal(offset_surveyed_pose("B", {}, TRIPODS).matrix, surveyed_pose("B").matrix)
    assert offset_surveyed_pose("G", localised, TRIPODS) is None


def test_a_position_without_evidence_gets_the_tilt_of_its_neighbour_or_the_usual_tilt():
    steep = camera_pose(surveyed_pose("A").translation, np.pi, np.radians(19.0))
    for localised, pitch, sd in (
        ({"A": steep, "C": surveyed_pose("C")}, 19.0, SHARED_PITCH_SD_DEG),
        ({"C": steep}, 25.4, USUAL_PITCH_SD_DEG),
        ({}, 25.4, USUAL_PITCH_SD_DEG),
    ):
        pose, found_sd = expected_survey_pose("B", localised, TRIPODS)
        np.testing.assert_allclose(pose.translation, offset_surveyed_pose("B", localised, TRIPODS).translation)
        np.testing.assert_allclose(np.degrees(yaw_pitch_roll(pose)), [180, pitch, 0], atol=1e-9)
        assert found_sd == sd
    assert expected_survey_pose("G", {"A": steep}, TRIPODS) is None
