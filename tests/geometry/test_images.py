"""Downscaled images keep their mean and aspect ratio, and lose grain."""

import numpy as np
import pytest

from polarsim.geometry.images import bilinear, resize, resize_longer_side


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


@pytest.mark.parametrize("values", [(), (3,)])
def test_values_between_nodes_are_bilinear_and_those_outside_are_of_the_edge(rng, values):
    """By hand: a + b x + c y + d x y, which bilinear interpolation reproduces."""
    a, b, c, d = rng.normal(size=(4, *values))
    at = rng.uniform(-1, 6, (50, 2))
    rows, columns = (np.arange(size).reshape(shape + (1,) * len(values)) for size, shape in ((4, (4, 1)), (6, (1, 6))))
    found = bilinear(a + b * columns + c * rows + d * columns * rows, *at.T)
    x, y = (np.clip(part, 0, size).reshape(-1, *(1 for _ in values)) for part, size in zip(at.T, (5, 3), strict=True))
    np.testing.assert_allclose(found, a + b * x + c * y + d * x * y, atol=1e-12)
