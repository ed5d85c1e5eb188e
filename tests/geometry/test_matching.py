import numpy as np

from polarsim.geometry.matching_numba import match_predictions_of_photo


def test_the_most_confident_prediction_gets_the_best_free_label():
    """`tests/detect/test_metrics.py` compares precision, also of size classes, with pycocotools."""
    overlap = np.array([[0.6, 0.8], [0.7, 0.9], [0.55, 0.0]])
    right, passed = match_predictions_of_photo(overlap, np.array([0.5]), np.zeros((1, 2), bool))
    assert right[0, 0].tolist() == [True, True, False]  # the first prediction matches the second label
    assert not passed.any()
