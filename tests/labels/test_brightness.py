import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png, tables
from polarsim.labels.brightness import PhotoBrightness, noise_dn
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from tests.support.polar_photos import HEIGHT, WIDTH


@pytest.fixture
def index(tmp_path):
    """Two exposures of an exposure bracket: 2 DN a millisecond on the left, 20 on the right, which the longer one
    clips.
    """
    rows = []
    for exposure in (64, 256):
        signal = np.repeat([[2.0, 20.0]], WIDTH // 2, axis=1) * exposure
        picture = np.minimum(np.broadcast_to(signal, (HEIGHT, WIDTH)) + BLACK_LEVEL, WHITE_LEVEL).astype(np.uint16)
        path = tmp_path / f"{exposure}.png"
        png.write_png(path, picture)
        rows.append({"key": f"03_A_off_30_L_{exposure:04d}", "path": str(path)})
    rows.append({"key": "03_A_off_30_R_0064", "path": str(tmp_path / "missing.png")})
    table = pd.DataFrame(rows).reindex(columns=list(tables.PHOTO_COLUMNS))
    tables.write_parquet(tmp_path / "photos.parquet", table)
    return tmp_path / "photos.parquet"


def test_every_pixel_comes_from_the_longest_exposure_that_did_not_clip_it(index):
    brightness = PhotoBrightness(index, 3, 1.0).brightness((3, "A", "off", "30", "L"))
    assert brightness.exposures_ms == (64, 256)
    np.testing.assert_allclose(brightness.rate[5, [10, 1900]], [2, 20], rtol=1e-3)


def test_an_exposure_is_clipped_as_its_photo_was(index):
    brightness = PhotoBrightness(index, 3, 1.0).brightness((3, "A", "off", "30", "L"))
    np.testing.assert_allclose(brightness.at(256)[5, [10, 1900]], [512, WHITE_LEVEL - BLACK_LEVEL], rtol=1e-3)


def test_a_bracket_without_readable_photo_has_no_brightness(index, caplog):
    photos = PhotoBrightness(index, 3, 1.0)
    assert photos.brightness((3, "A", "off", "30", "R")) is None
    assert "missing.png" in caplog.text
    assert photos.brightness((3, "A", "on", "30", "L")) is None
    assert PhotoBrightness(index, 4, 1.0).brightness((3, "A", "off", "30", "L")) is None


def test_noise_is_that_of_photons_and_read_out():
    # 33,000 electrons at 12 bits: 8 a grey value, so 4,096 values have sqrt(32,768) / 8 = 22.6 of noise; 7 of read-out.
    np.testing.assert_allclose(noise_dn(np.array([0.0, 4096.0])), [7 / 8, np.hypot(22.627, 0.875)], rtol=1e-3)
