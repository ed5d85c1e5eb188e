"""Background of scenes: brightness, and only at unlit pixels."""

import numpy as np
import pytest

from polarsim.scenes.background import add_background, draw_hall


def test_the_hall_is_added_to_unlit_pixels_only(rng):
    for _ in range(10):
        hall = draw_hall((60, 90), rng)
        assert hall.mean() == pytest.approx(1)
        assert hall.min() >= 0
    bare = np.zeros((60, 90), bool)
    bare[:10] = True
    found = add_background(np.where(bare, 0, 1).astype(np.float32), bare, (0.3, 0.3), rng)
    assert 0 < found[:10].mean() < 1
    assert (found[10:] == 1).all()
