import pytest

from polarsim.labels.label import COEFFICIENTS, confidence


@pytest.mark.parametrize(("kind", "source"), COEFFICIENTS)
def test_a_confidence_is_a_probability_that_grows_with_size(kind, source):
    small, large = (confidence(kind, source, 1.0, size) for size in (0.0, 400.0))
    assert 0 < small <= large < 1


def test_a_rock_missing_at_annotated_azimuths_has_lower_confidence():
    assert confidence("rock", "fused", 0.5, 60) < confidence("rock", "fused", 1.0, 60)


@pytest.mark.parametrize("kind", ["rock", "shadow"])
def test_translated_labels_have_low_confidence_unless_large(kind):
    blind, tilted = (confidence(kind, "translated", 1.0, 40, pitch_known=known) for known in (False, True))
    assert blind < 0.65 < tilted < confidence(kind, "fused", 1.0, 40)
    assert confidence(kind, "translated", 1.0, 120, pitch_known=False) > 0.8
