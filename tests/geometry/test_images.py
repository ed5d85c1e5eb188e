"""Downscaled images keep their mean and aspect ratio, and lose grain."""

import numpy as np
import pytest

from polarsim.geometry.images import resize, resize_longer_side


def test_a_smaller_image_keeps_the_mean(rng):
    photo = rng.integers(0, 255, (1216, 1936)).astype(np.uint8)
    small = resize(photo, (484, 304))
    assert small.shape == (304, 484)
    assert small.mean() == pytest.approx(photo.mean(), abs=0.6)
    assert small.std() == pytest.approx(photo.std() / 4, rel=0.1)  # the mean of 16 pixels has a quarter of the grain


@pytest.mark.parametrize(("pixels", "shape"), [(64, (32, 64)), (128, (64, 128)), (200, (100, 200)), (1, (1, 1))])
def test_the_longer_side_is_resized_with_the_same_aspect_ratio(rng, pixels, shape):
    image = rng.random((64, 128)).astype(np.float32)
    found = resize_longer_side(image, pixels)
    assert found.shape == shape
    assert (found is image) == (pixels == 128)
