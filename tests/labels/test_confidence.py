import pytest

from polarsim.labels.label import COEFFICIENTS, confidence


@pytest.mark.parametrize(("kind", "source"), COEFFICIENTS)
def test_a_confidence_is_a_probability_that_grows_with_size(kind, source):
    small, large = (confidence(kind, source, 1.0, size) for size in (0.0, 400.0))
    assert 0 < small <= large < 1


def test_a_rock_that_other_azimuths_do_not_show_is_less_sure():
    assert confidence("rock", "fused", 0.5, 60) < confidence("rock", "fused", 1.0, 60)


def test_what_a_person_drew_is_surer_than_what_geometry_made_of_it():
    order = [confidence("shadow", source, 1.0, 60) for source in ("seed", "fused", "cast")]
    assert order == sorted(order, reverse=True)


@pytest.mark.parametrize("kind", ["rock", "shadow"])
def test_what_moved_to_the_other_camera_without_its_pose_is_a_guess_unless_it_is_large(kind):
    blind, tilted = (confidence(kind, "translated", 1.0, 40, pitch_known=known) for known in (False, True))
    assert blind < 0.65 < tilted < confidence(kind, "fused", 1.0, 40)
    assert confidence(kind, "translated", 1.0, 120, pitch_known=False) > 0.8
