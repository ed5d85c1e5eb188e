import numpy as np
import pytest

from polarsim.labels.rover_light import COEFFICIENTS, TERMS, probability, terms


def test_a_probability_is_the_logistic_function_of_the_terms():
    own = terms(0.5, 1.0, 25.0, 4.5)
    assert own == pytest.approx([1, -0.5, 0, np.log(0.5), 1.0])  # half the azimuths, half of 50 px, 1 m beyond 3.5 m
    score = np.dot(COEFFICIENTS, [1, -0.5, 0, np.log(0.5), 1.0])
    assert probability(own) == pytest.approx(1 / (1 + np.exp(-score)))
    assert len(own) == len(TERMS) == len(COEFFICIENTS)


def test_far_small_seldom_annotated_rocks_are_less_likely_and_large_ones_no_likelier_for_their_size():
    usual = probability(terms(1.0, 1.0, 40.0, 3.0))
    for other in (terms(1.0, 1.0, 40.0, 6.0), terms(1.0, 1.0, 20.0, 3.0), terms(0.5, 1.0, 40.0, 3.0)):
        assert probability(other) < usual
    assert probability(terms(1.0, 1.0, 400.0, 3.0)) == probability(terms(1.0, 1.0, 60.0, 3.0))
