import numpy as np
import pytest

from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.render.options import RenderOptions
from polarsim.render.sensor import expose, noise_generator

RADIANCE = np.array([[0.0, 0.1, 1.0, 5.0, 100.0]], np.float32)
OPTIONS = RenderOptions()
KEY = PhotoKey.parse("03_A_off_180_L_0256")


def test_twice_the_exposure_is_twice_the_signal_between_black_level_and_saturation():
    short, long = (expose(RADIANCE, light, OPTIONS).astype(int) - BLACK_LEVEL for light in (100, 200))
    assert short[0].tolist() == [0, 10, 100, 500, WHITE_LEVEL - BLACK_LEVEL]
    assert long[0].tolist() == [0, 20, 200, 1000, WHITE_LEVEL - BLACK_LEVEL]
    assert expose(np.full((1, 1), 1e30, np.float32), 1e6, OPTIONS)[0, 0] == WHITE_LEVEL


def test_values_are_rounded():
    photo = expose(np.array([[0.149, 0.151]], np.float32), 10, OPTIONS)
    assert photo[0].tolist() == [BLACK_LEVEL + 1, BLACK_LEVEL + 2]


@pytest.mark.parametrize(("per_dn", "read"), [(8.0, 7.0), (2.0, 4.0), (20.0, 60.0)])
def test_the_photon_transfer_curve_yields_gain_and_read_noise(rng, per_dn, read):
    """The variance of grey values is their mean over the gain, plus read noise, plus rounding's 1/12."""
    options = OPTIONS.model_copy(update={"electrons_per_dn": per_dn, "read_noise_electrons": read})
    signals = np.linspace(0, 2000, 9, dtype=np.float32)
    photos = [expose(np.full((300, 300), signal), 1, options, rng).astype(float) for signal in signals]
    means = np.array([photo.mean() - BLACK_LEVEL for photo in photos])
    variances = np.array([photo.var() for photo in photos])
    np.testing.assert_allclose(means, signals, atol=0.5)
    np.testing.assert_allclose(variances, signals / per_dn + (read / per_dn) ** 2 + 1 / 12, rtol=0.03)
    slope, _ = np.polyfit(means, variances, 1, w=1 / (1 + variances))
    assert 1 / slope == pytest.approx(per_dn, rel=0.02)


def test_without_light_and_read_noise_nothing_varies(rng):
    options = OPTIONS.model_copy(update={"read_noise_electrons": 0})
    assert (expose(np.zeros((50, 50), np.float32), 1000, options, rng) == BLACK_LEVEL).all()


def test_noise_differs_between_images_and_is_reproducible():
    noisy = RenderOptions(noise=True)
    assert noise_generator(OPTIONS, KEY) is None
    drawn = [
        noise_generator(options, key).standard_normal(50)
        for options, key in (
            (noisy, KEY),
            (noisy, KEY),
            (noisy, KEY.with_exposure(512)),
            (noisy.model_copy(update={"seed": 1}), KEY),
        )
    ]
    np.testing.assert_array_equal(drawn[0], drawn[1])
    for other in drawn[2:]:
        assert np.abs(np.corrcoef(drawn[0], other)[0, 1]) < 0.5
