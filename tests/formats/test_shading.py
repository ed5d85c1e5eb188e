import numpy as np
import pytest

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.formats.shading import BY_RELIEF, BY_WALL, FACES_AWAY, LIT, cast_shadow, read_shading, self_shadow

CODES = np.array([[0, LIT, BY_RELIEF, BY_WALL], [FACES_AWAY, 1007, 2007, 2999]], np.uint16)


def test_shadows_of_a_picture_are_apart(tmp_path):
    png.write(tmp_path / "a.png", CODES)
    shading = read_shading(tmp_path / "a.png")
    np.testing.assert_array_equal(self_shadow(shading), [[0, 0, 0, 0], [1, 1, 0, 0]])
    np.testing.assert_array_equal(cast_shadow(shading), [[0, 0, 1, 1], [0, 0, 1, 1]])


@pytest.mark.parametrize(
    "pixels", [CODES.astype(np.uint8), np.full((2, 2), 5, np.uint16), np.ones((2, 2, 3), np.uint16)]
)
def test_other_pictures_are_refused_in_one_line(tmp_path, pixels):
    png.write(tmp_path / "a.png", pixels)
    with pytest.raises(FormatError, match=f"^{tmp_path}/a.png: [^\n]*$"):
        read_shading(tmp_path / "a.png")
