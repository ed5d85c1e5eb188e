import numpy as np
import pytest

from polarsim.detect.frame import letterbox


@pytest.mark.parametrize(("height", "width", "imgsz"), [(201, 320, 320), (221, 352, 352), (1216, 1936, 320)])
def test_a_framed_picture_has_whole_strides_and_lies_in_the_centre(height, width, imgsz):
    pixels, (left, top), _ = letterbox(np.full((height, width), 7, np.uint8), imgsz, (width, height))
    rows, columns = np.flatnonzero((pixels == 7).any(axis=1)), np.flatnonzero((pixels == 7).any(axis=0))
    assert pixels.shape[0] % 32 == pixels.shape[1] % 32 == 0
    assert pixels.shape[1] == imgsz
    assert (columns[0], rows[0]) == (left, top)
    assert abs((pixels.shape[0] - 1 - rows[-1]) - rows[0]) <= 1


def test_a_point_in_a_framed_picture_leads_back_to_the_photo(rng):
    photo = np.zeros((1216, 1936), np.uint8)
    photo[600:640, 1000:1100] = 255
    pixels, offset, scale = letterbox(photo, 640, (1936, 1216))
    rows, columns = np.nonzero(pixels == 255)
    low = (np.array([columns.min(), rows.min()]) - offset) * scale
    high = (np.array([columns.max(), rows.max()]) + 1 - offset) * scale
    np.testing.assert_allclose([*low, *high], [1000, 600, 1100, 640], atol=3.1)  # one input pixel is three photo pixels
