import numpy as np
import pytest

from polarsim.geometry.lens import Lens
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.render.sensor import expose, vignette

RADIANCE = np.array([[0.0, 0.1, 1.0, 5.0, 100.0]], np.float32)


def test_darkness_is_the_black_level():
    assert expose(RADIANCE, 10)[0, 0] == BLACK_LEVEL


def test_twice_the_exposure_is_twice_the_signal_until_it_clips():
    short, long = (expose(RADIANCE, light).astype(int) - BLACK_LEVEL for light in (100, 200))
    assert short[0].tolist() == [0, 10, 100, 500, WHITE_LEVEL - BLACK_LEVEL]
    assert long[0].tolist() == [0, 20, 200, 1000, WHITE_LEVEL - BLACK_LEVEL]


def test_no_light_is_too_bright_for_the_sensor():
    assert expose(np.full((1, 1), 1e30, np.float32), 1e6)[0, 0] == WHITE_LEVEL


def test_values_are_rounded():
    assert expose(np.array([[0.149, 0.151]], np.float32), 10)[0].tolist() == [BLACK_LEVEL + 1, BLACK_LEVEL + 2]


def test_noise_follows_shot_and_read_noise(rng):
    photo = expose(np.full((400, 400), 1.0, np.float32), 1000, rng).astype(float)
    assert photo.mean() == pytest.approx(BLACK_LEVEL + 1000, abs=0.2)
    assert photo.std() == pytest.approx(np.sqrt(8 * 1000 + 49) / 8, rel=0.02)  # 8 electrons a grey value, 7 read


def test_the_same_noise_for_the_same_seed():
    photos = [expose(RADIANCE, 100, np.random.default_rng(1)) for _ in range(2)]
    np.testing.assert_array_equal(*photos)


def test_vignetting_is_cos_to_the_fourth():
    lens = Lens(100, 100, 100.5, 50.5, width=201, height=101)
    shade = vignette(lens)
    assert shade[50, 100] == 1
    assert shade[50, 200] == pytest.approx(np.cos(np.pi / 4) ** 4)
