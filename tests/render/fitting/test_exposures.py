import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.formats import png
from polarsim.geometry.lens import Lens
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL, PhotoKey
from polarsim.render.fitting.exposures import Linear, mean_of, merged, single_lamps

SMALL = Lens(10.0, 10.0, 4.0, 3.0, (0.0,) * 5, 8, 6)


def photo(rate, exposure_ms):
    """A photo without noise."""
    return np.clip(np.rint(np.asarray(rate) * exposure_ms) + BLACK_LEVEL, 0, WHITE_LEVEL).astype(np.uint16)


@given(st.lists(st.floats(0.3, 100), min_size=4, max_size=4))
def test_light_comes_back_from_exposures_of_which_some_clip(rates):
    rate = np.array(rates).reshape(2, 2)
    found = merged((photo(rate, ms), ms) for ms in (16.0, 64.0, 256.0))
    np.testing.assert_allclose(found.rate, rate, rtol=0.02)
    assert (found.variance > 0).all()


def test_what_all_photos_clip_or_leave_black_is_unknown():
    found = merged((photo([[1e4, 0.001, 1.0]], ms), ms) for ms in (16.0, 64.0))
    assert np.isinf(found.variance).tolist() == [[True, True, False]]


def test_variance_is_what_noise_makes():
    rng = np.random.default_rng(1)
    rate, ms = 2.0, 256.0
    light = rate * ms
    noisy = [light + np.sqrt(light / 8 + 0.8) * rng.standard_normal((100, 100)) + BLACK_LEVEL for _ in range(2)]
    found = merged((np.rint(one).astype(np.uint16), ms) for one in noisy)
    assert found.rate.var() == pytest.approx(float(found.variance.mean()), rel=0.1)


def test_no_photo_is_no_picture():
    assert merged([]) is None


def write(folder, rates):
    paths = {}
    for name, rate in rates.items():
        for ms in (64, 256):
            key = PhotoKey.parse(f"03_A_{name}_L_{ms:04d}")
            paths[key] = folder / f"{key}.png"
            png.write(paths[key], photo(np.full((6, 8), rate), ms))
    return paths


def test_the_rover_light_is_what_a_sun_lamp_lacks_where_it_is_never_alone(tmp_path):
    found = single_lamps(write(tmp_path, {"off_30": 2.0, "on_30": 5.0, "off_180": 1.0, "on_180": 4.0}), SMALL)
    assert list(found) == ["30", "180", "rover"]
    np.testing.assert_allclose(found["rover"].rate, 3.0, rtol=0.02)


def test_the_rover_light_alone_goes_before_differences(tmp_path):
    found = single_lamps(write(tmp_path, {"off_30": 2.0, "on_30": 5.0, "on_no": 4.0, "off_no": 0.5}), SMALL)
    np.testing.assert_allclose(found["rover"].rate, 4.0, rtol=0.02)


def test_a_mean_leans_to_what_is_sure_and_passes_over_what_is_unknown():
    one = Linear(np.array([[2.0, 2.0, 0.0]]), np.array([[1.0, np.inf, np.inf]]))
    other = Linear(np.array([[5.0, 5.0, 0.0]]), np.array([[2.0, 2.0, np.inf]]))
    found = mean_of([one, other])
    np.testing.assert_allclose(found.rate, [[3.0, 5.0, 0.0]])
    np.testing.assert_allclose(found.variance, [[2 / 3, 2.0, np.inf]])


def test_a_broken_photo_is_named_and_left_out(tmp_path, caplog):
    paths = write(tmp_path, {"off_30": 2.0})
    broken = next(iter(paths.values()))
    broken.write_bytes(b"no picture")
    np.testing.assert_allclose(single_lamps(paths, SMALL)["30"].rate, 2.0, rtol=0.02)
    assert broken.name in caplog.text
