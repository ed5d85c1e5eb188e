import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.render.fitting.exposures import Linear, mean_of, merge_exposures, single_lamps
from polarsim.site import polar

SMALL = Lens(10.0, 10.0, 4.0, 3.0, (0.0,) * 5, width=8, height=6)


def photo(rate, exposure_ms):
    """A photo without noise."""
    return np.clip(np.rint(np.asarray(rate) * exposure_ms) + BLACK_LEVEL, 0, WHITE_LEVEL).astype(np.uint16)


@given(st.lists(st.floats(0.3, 100), min_size=4, max_size=4))
def test_merging_recovers_light_from_partly_clipped_exposures(rates):
    rate = np.array(rates).reshape(2, 2)
    found = merge_exposures((photo(rate, ms), ms) for ms in (16.0, 64.0, 256.0))
    np.testing.assert_allclose(found.rate, rate, rtol=0.02)
    assert (found.variance > 0).all()


def test_pixels_without_usable_exposure_have_infinite_variance():
    found = merge_exposures((photo([[1e4, 0.001, 1.0]], ms), ms) for ms in (16.0, 64.0))
    assert np.isinf(found.variance).tolist() == [[True, True, False]]


def test_the_variance_agrees_with_the_noise():
    rng = np.random.default_rng(1)
    rate, ms = 2.0, 256.0
    light = rate * ms
    noisy = [light + np.sqrt(light / 8 + 0.8) * rng.standard_normal((100, 100)) + BLACK_LEVEL for _ in range(2)]
    found = merge_exposures((np.rint(one).astype(np.uint16), ms) for one in noisy)
    assert found.rate.var() == pytest.approx(float(found.variance.mean()), rel=0.1)


def test_merging_no_photos_returns_none():
    assert merge_exposures([]) is None


def write(folder, rates):
    paths = {}
    for name, rate in rates.items():
        for ms in (64, 256):
            key = PhotoKey.parse(f"03_A_{name}_L_{ms:04d}")
            paths[key] = folder / f"{key}.png"
            png.write_png(paths[key], photo(np.full((6, 8), rate), ms))
    return paths


def test_the_rover_light_is_a_difference_without_photos_of_it_alone(tmp_path):
    found = single_lamps(
        write(tmp_path, {"off_30": 2.0, "on_30": 5.0, "off_180": 1.0, "on_180": 4.0}), SMALL, polar().suns
    )
    assert list(found) == ["30", "180", "rover"]
    np.testing.assert_allclose(found["rover"].rate, 3.0, rtol=0.02)


def test_photos_of_only_the_rover_light_have_priority(tmp_path):
    found = single_lamps(
        write(tmp_path, {"off_30": 2.0, "on_30": 5.0, "on_no": 4.0, "off_no": 0.5}), SMALL, polar().suns
    )
    np.testing.assert_allclose(found["rover"].rate, 4.0, rtol=0.02)


def test_the_mean_is_weighted_by_inverse_variance():
    one = Linear(np.array([[2.0, 2.0, 0.0]]), np.array([[1.0, np.inf, np.inf]]))
    other = Linear(np.array([[5.0, 5.0, 0.0]]), np.array([[2.0, 2.0, np.inf]]))
    found = mean_of([one, other])
    np.testing.assert_allclose(found.rate, [[3.0, 5.0, 0.0]])
    np.testing.assert_allclose(found.variance, [[2 / 3, 2.0, np.inf]])


def test_an_invalid_photo_is_skipped_with_a_warning(tmp_path, caplog):
    paths = write(tmp_path, {"off_30": 2.0})
    broken = next(iter(paths.values()))
    broken.write_bytes(b"no picture")
    np.testing.assert_allclose(single_lamps(paths, SMALL, polar().suns)["30"].rate, 2.0, rtol=0.02)
    assert broken.name in caplog.text
